// The former names of keys and values of YAML files, which are read until version 1.0.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/model/scene_simulator.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::model {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;
using thicklens::testing::ErrorOf;
using thicklens::testing::TemporaryFolder;

constexpr char kNotice[] = "'picture' is deprecated and will be removed in 1.0: use 'image'";

std::string CameraLine() {
  return std::string("camera: ") + THICKLENS_SOURCE_DIR + "/configs/cameras/case-ii.yaml\n";
}

class RenamedKeys : public ::testing::Test {
 protected:
  // The words of the texture of two layers, or of the target.
  SceneSimulationOptions Scene(const std::string& words) const {
    const std::string layer = "- plane: {depth_mm: 300}\n  texture: {" + words + "}\n";
    return ReadSceneSimulation(folder_.Put(
        "scene.yaml", "schema: thicklens/simulate-scene/1\n" + CameraLine() +
                          "truth: {focus_depth_mm: 300, blur_ratio: 0.45}\nsize_px: [64, 64]\n"
                          "layers:\n" +
                          layer + layer));
  }
  SweepSimulationOptions Sweep(const std::string& words) const {
    return ReadSweepSimulation(folder_.Put(
        "sweep.yaml", "schema: thicklens/simulate-sweep/1\n" + CameraLine() +
                          "truth: {focus_depth_mm: 300, blur_ratio: 0.45, blur_floor_px: 0.5}\n"
                          "size_px: [64, 64]\ntarget: {" +
                          words + "}\nbench: {first_depth_mm: 290, step_mm: 4, frames: 6}\n"));
  }

  TemporaryFolder folder_;
};

TEST_F(RenamedKeys, FormerNamesReadAsThePresentOnes) {
  for (const char* words : {"kind: picture, picture: a.png", "kind: picture, image: a.png",
                            "kind: image, picture: a.png"}) {
    SCOPED_TRACE(words);
    const SceneSimulationOptions scene = Scene(words);
    for (const SceneLayer& layer : scene.layers) {
      EXPECT_EQ(layer.texture.kind, TextureKind::kImage);
      EXPECT_EQ(layer.texture.image_path, folder_ / "a.png");
    }
    EXPECT_THAT(scene.notices,
                ElementsAre(AllOf(HasSubstr("layers[0].texture."),
                                  StartsWith(folder_ / "scene.yaml:"), EndsWith(kNotice))));
    const SweepSimulationOptions sweep = Sweep(words);
    EXPECT_EQ(sweep.target.kind, TargetKind::kImage);
    EXPECT_EQ(sweep.target.image_path, folder_ / "a.png");
    EXPECT_THAT(sweep.notices, ElementsAre(AllOf(HasSubstr("target."), EndsWith(kNotice))));
  }
}

TEST_F(RenamedKeys, PresentNamesGiveNoNotice) {
  EXPECT_THAT(Scene("kind: image, image: a.png").notices, IsEmpty());
  EXPECT_THAT(Sweep("kind: image, image: a.png").notices, IsEmpty());
}

TEST_F(RenamedKeys, BothNamesAtOnceAreAnErrorThatNamesBoth) {
  const std::string both = "kind: image, picture: a.png, image: a.png";
  const auto names_both =
      AllOf(HasSubstr(".picture: "), HasSubstr("'picture'"), HasSubstr("give only 'image'"));
  EXPECT_THAT(ErrorOf([&] { Scene(both); }), names_both);
  EXPECT_THAT(ErrorOf([&] { Sweep(both); }), names_both);
}

TEST_F(RenamedKeys, MessagesListPresentNamesOnly) {
  const auto lists_image = AllOf(HasSubstr("image"), Not(HasSubstr("picture")));
  EXPECT_THAT(ErrorOf([&] { Scene("kind: nothing"); }), lists_image);
  EXPECT_THAT(ErrorOf([&] { Scene("kind: image, file: a.png"); }), lists_image);
  EXPECT_THAT(ErrorOf([&] { Sweep("kind: nothing"); }), lists_image);
  EXPECT_THAT(ErrorOf([&] { Sweep("kind: image, file: a.png"); }), lists_image);
  // The former key belongs to the same kind as the present one.
  EXPECT_THAT(ErrorOf([&] { Scene("kind: noise, picture: a.png"); }),
              HasSubstr("unknown key 'picture'"));
  EXPECT_THAT(ErrorOf([&] { Sweep("kind: knife-edge, picture: a.png"); }),
              HasSubstr("only for a target of the kind 'image'"));
}

}  // namespace
}  // namespace thicklens::model

// thicklens simulate image and simulate light-field as a user runs them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "support/part_of.h"
#include "support/temporary_folder.h"
#include "thicklens/base/yaml_reader.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/scene_simulator.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;
using Arguments = std::vector<std::string>;

// A card in front of a slanted background, 40 x 30 px.
std::string SceneConfig(const std::string& more) {
  return std::string("schema: thicklens/simulate-scene/1\ncamera: ") + THICKLENS_SOURCE_DIR +
         "/configs/cameras/case-ii.yaml\n"
         "truth: {focus_depth_mm: 300, blur_ratio: 0.45, blur_floor_px: 0.5}\n"
         "size_px: [40, 30]\n"
         "layers:\n"
         "- {name: wall, plane: {depth_mm: 303, slope: [1, 0]}, texture: {kind: dead-leaves}}\n"
         "- plane: {depth_mm: 297}\n"
         "  outline: {centre_px: [20, 15], size_px: [15, 11]}\n"
         "  texture: {kind: noise}\n" +
         more;
}

class SimulateSceneTest : public ::testing::Test {
 protected:
  ProgramResult Run(Arguments arguments) const {
    arguments.insert(arguments.begin(), "simulate");
    return ChildProgram(arguments, scratch_.path(), 0).Wait();
  }
  void Succeed(const Arguments& arguments) const {
    const ProgramResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, 0) << result.err;
  }
  // Runs a command that must fail with one line and exit code 1, and returns the line.
  std::string Failure(const Arguments& arguments) const {
    const ProgramResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_THAT(result.err, ::testing::StartsWith("thicklens: error: "));
    return result.err;
  }
  nlohmann::json JsonOf(const std::string& name) const {
    return nlohmann::json::parse(ContentOf(folder_ / name));
  }

  TemporaryFolder folder_, scratch_;
};

TEST_F(SimulateSceneTest, ImageFolderHoldsWhatTheSimulatorMakes) {
  const std::string config = folder_.Put("scene.yaml", SceneConfig("noise_sigma_grey_levels: 1\n"));
  const std::string out = folder_ / "out";
  const ProgramResult result = Run({"image", config, "-o", out, "--json", folder_ / "a.json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, AllOf(HasSubstr("40 x 30 px"), HasSubstr(out)));

  const model::SceneSimulationOptions options = model::ReadSceneSimulation(config);
  const model::SceneSimulator simulator(options, {});
  const model::EncodedImage image = io::ToEncodedImage(io::ReadImageFile(out + "/picture.png"));
  EXPECT_EQ(image.bits, 8);
  EXPECT_EQ(image.channels, 3);
  EXPECT_EQ(image.values, simulator.Store(simulator.RenderNoiseless({})).values);
  const model::RawDepthMap depth = io::ReadDepthMap(out + "/depth.pfm");
  EXPECT_EQ(depth.width_px, 40);
  EXPECT_EQ(depth.values, simulator.RenderDepth().values);
  EXPECT_EQ(depth.values[15 * 40 + 20], 297);
  const model::Camera camera = model::ReadCamera(out + "/camera.yaml");
  EXPECT_EQ(camera.sensor.width_px, 40);
  EXPECT_EQ(camera.image_distance_mm(), options.camera.image_distance_mm());
  EXPECT_EQ(camera.blur_ratio(), 0.45);
  EXPECT_EQ(camera.calibration->blur_floor_px->value, 0.5);
  const YamlNode truth = YamlNode::LoadFile(out + "/truth.yaml");
  EXPECT_EQ(truth.At("nearest_depth_mm").Number(), 297);

  const nlohmann::json json = JsonOf("a.json");
  EXPECT_EQ(json["status"], "ok");
  EXPECT_EQ(json["output"], out);
  EXPECT_EQ(json["width_px"], 40);
  EXPECT_EQ(json["height_px"], 30);
  EXPECT_EQ(json["bits"], 8);
  EXPECT_EQ(json["layers"], 2);
  EXPECT_EQ(json["rays_per_pixel"], 600);
  EXPECT_GE(json["mean_rays_per_pixel"], 16);
  EXPECT_LE(json["mean_rays_per_pixel"], 600);
  EXPECT_EQ(json["nearest_depth_mm"], 297);
  EXPECT_NEAR(json["truth"]["focus_depth_mm"], 300, 1e-9);
  EXPECT_EQ(json["truth"]["blur_ratio"], 0.45);
}

TEST_F(SimulateSceneTest, EffectsAreChosenAndReported) {
  const std::string config = folder_.Put("scene.yaml", SceneConfig("without: [falloff]\n"));
  Succeed({"image", config, "-o", folder_ / "auto", "--json", folder_ / "auto.json"});
  const nlohmann::json automatic = JsonOf("auto.json")["effects"];
  ASSERT_EQ(automatic.size(), 12U);
  EXPECT_EQ(automatic[1]["name"], "defocus");
  EXPECT_EQ(automatic[1]["unit"], "px");
  EXPECT_TRUE(automatic[1]["on"]);
  EXPECT_GT(automatic[1]["bound_grey_levels"], 5);
  EXPECT_NEAR(automatic[1]["where"]["depth_mm"], 300, 10);
  EXPECT_EQ(automatic[3]["name"], "falloff");
  EXPECT_FALSE(automatic[3]["on"]);

  // The command line overrides the file.
  const ProgramResult given =
      Run({"image", config, "-o", folder_ / "given", "--effects", "defocus,falloff", "--without",
           "defocus", "--json", folder_ / "given.json"});
  EXPECT_THAT(given.out, HasSubstr("effects: falloff\neffects ignored, "));
  EXPECT_EQ(JsonOf("given.json")["bits"], 16);
  const YamlNode truth = YamlNode::LoadFile(folder_ / "given" + "/truth.yaml");
  ASSERT_EQ(truth.At("effects").Elements().size(), 1U);
  EXPECT_EQ(truth.At("effects").Elements()[0].Text(), "falloff");
  EXPECT_EQ(model::ReadCamera(folder_ / "given" + "/camera.yaml").sensor.transfer.Name(), "linear");

  const ProgramResult foreign = Run({"image", config, "-o", folder_ / "c", "--effects", "tilt"});
  EXPECT_EQ(foreign.exit_code, 2);
  EXPECT_THAT(foreign.err, HasSubstr("--effects: effect tilt is not available here"));
  EXPECT_EQ(Run({"image", config, "-o", folder_ / "c", "--without", "bokeh"}).exit_code, 2);
  EXPECT_EQ(Run({"image", config, "-o", folder_ / "c", "--effect-tolerance", "1"}).exit_code, 2);
}

TEST_F(SimulateSceneTest, LightFieldFolderHoldsTheTrueViews) {
  const std::string config = folder_.Put("scene.yaml", SceneConfig("views: [3, 5]\n"));
  Succeed({"light-field", config, "-o", folder_ / "a", "--format", "tiff", "--quiet"});
  const model::SceneSimulationOptions options = model::ReadSceneSimulation(config);
  const model::SceneSimulator simulator(options, {});
  const model::LightField expected = simulator.RenderLightField(3, 5, {});
  const model::LightField tiff = io::ReadLightField(folder_ / "a", {});
  EXPECT_EQ(tiff.values, expected.values);
  EXPECT_EQ(tiff.origin.method, "simulated");
  ASSERT_TRUE(tiff.grid && tiff.camera);
  EXPECT_EQ(tiff.grid->u_step_mm, expected.grid->u_step_mm);

  Succeed({"light-field", config, "-o", folder_ / "b", "--views", "1x3", "--json",
           folder_ / "b.json", "--quiet"});
  const model::LightField png = io::ReadLightField(folder_ / "b", {});
  EXPECT_EQ(png.u_count, 1);
  EXPECT_EQ(png.v_count, 3);
  const model::LightField three = simulator.RenderLightField(1, 3, {});
  ASSERT_EQ(png.values.size(), three.values.size());
  for (std::size_t i = 0; i < three.values.size(); ++i)
    EXPECT_NEAR(png.values[i], three.values[i], 1e-5f);
  const nlohmann::json json = JsonOf("b.json");
  EXPECT_EQ(json["status"], "ok");
  EXPECT_THAT(json["views"], ElementsAre(1, 3));
  EXPECT_EQ(json["clipped_values"], 0);
}

TEST_F(SimulateSceneTest, TheUvPlaneMayLieOffTheAperture) {
  const std::string config = folder_.Put("scene.yaml", SceneConfig("uv_depth_mm: 3\n"));
  Succeed({"light-field", config, "-o", folder_ / "a", "--views", "3x3", "--quiet"});
  EXPECT_EQ(io::ReadLightField(folder_ / "a", {}).grid->planes.uv_depth_mm, 3);
  Succeed({"light-field", config, "-o", folder_ / "b", "--views", "3x3", "--uv-depth", "-2",
           "--quiet"});
  EXPECT_EQ(io::ReadLightField(folder_ / "b", {}).grid->planes.uv_depth_mm, -2);
  const ProgramResult far =
      Run({"light-field", config, "-o", folder_ / "c", "--uv-depth", "299.99"});
  EXPECT_EQ(far.exit_code, 1);
  EXPECT_THAT(far.err, HasSubstr("uv_depth_mm is 299.99"));
}

TEST_F(SimulateSceneTest, SeedDecidesAndThreadsDoNot) {
  const std::string config = folder_.Put(
      "scene.yaml", SceneConfig("noise_sigma_grey_levels: 1\nrays_per_pixel: 50\nseed: 2\n"));
  const auto image = [&](const Arguments& more) {
    Arguments arguments = {"image", config, "-o", folder_ / "out", "--quiet"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    Succeed(arguments);  // replaces its own older folder
    return ContentOf(folder_ / "out/picture.png");
  };
  const std::string first = image({"--threads", "1"});
  EXPECT_EQ(image({"--threads", "3"}), first);
  EXPECT_EQ(image({"--seed", "2"}), first);
  EXPECT_NE(image({"--seed", "3"}), first);
}

TEST_F(SimulateSceneTest, TextureMayBeAnImageFile) {
  model::EncodedImage texture{32, 32, 3, 8, {}};
  for (int i = 0; i < 32 * 32; ++i) {
    for (const int level : {188, 0, 255}) {
      texture.values.push_back(static_cast<std::uint16_t>(level));
    }
  }
  folder_.Put("purple.png", io::EncodePng(texture));
  const std::string config =
      folder_.Put("scene.yaml", SceneConfig("without: [falloff]\n")
                                    .replace(SceneConfig("").find("{kind: dead-leaves}"), 19,
                                             "{kind: image, image: purple.png}"));
  Succeed({"image", config, "-o", folder_ / "out", "--quiet"});
  const model::EncodedImage image =
      io::ToEncodedImage(io::ReadImageFile(folder_ / "out/picture.png"));
  // The file is sRGB, the camera linear: 188 of 255 is half the light.
  EXPECT_NEAR(image.values[0], 128, 1);
  EXPECT_EQ(image.values[1], 0);
  EXPECT_EQ(image.values[2], 255);

  fs::remove(folder_ / "purple.png");
  EXPECT_THAT(Failure({"image", config, "-o", folder_ / "other"}), HasSubstr("purple.png"));
  EXPECT_FALSE(fs::exists(folder_ / "other"));
}

TEST_F(SimulateSceneTest, OutlineMayBeAMaskFile) {
  model::EncodedImage mask{40, 30, 1, 8, std::vector<std::uint16_t>(40 * 30, 0)};
  for (int y = 10; y < 20; ++y) std::fill_n(mask.values.begin() + 40 * y + 5, 10, 128);
  const std::string outline = "{centre_px: [20, 15], size_px: [15, 11]}";
  const std::string text = SceneConfig("");
  const std::string config = folder_.Put(
      "scene.yaml",
      std::string(text).replace(text.find(outline), outline.size(), "{mask: masks/card.png}"));
  folder_.Put("masks/card.png", io::EncodePng(mask));
  Succeed({"image", config, "-o", folder_ / "out", "--quiet"});
  const model::RawDepthMap depth = io::ReadDepthMap(folder_ / "out/depth.pfm");
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 40; ++x) {
      const bool card = x >= 5 && x < 15 && y >= 10 && y < 20;
      EXPECT_EQ(depth.values[static_cast<std::size_t>(40 * y + x)] == 297, card) << x << ", " << y;
    }
  }

  mask.width_px = 20;
  mask.height_px = 60;
  folder_.Put("masks/card.png", io::EncodePng(mask));
  EXPECT_THAT(Failure({"image", config, "-o", folder_ / "other"}),
              AllOf(HasSubstr("layers[1]: outline.mask"), HasSubstr("card.png"),
                    HasSubstr("has 20x60 px, but the scene's image has 40x30 px")));
  folder_.Put("masks/card.png", "none");
  EXPECT_THAT(Failure({"light-field", config, "-o", folder_ / "other"}), HasSubstr("card.png"));
  EXPECT_FALSE(fs::exists(folder_ / "other"));
}

TEST_F(SimulateSceneTest, LayerMayBeAnImageWithItsDepthMap) {
  model::RawDepthMap map{40, 30, {}, false};
  for (int i = 0; i < 40 * 30; ++i) {
    map.values.push_back(i % 40 < 20 ? 0.298F : 0.302F + 1e-5F * static_cast<float>(i / 40));
  }
  folder_.Put("map.pfm", io::EncodePfm(map));
  model::EncodedImage texture{40, 30, 3, 8, {}};
  for (int i = 0; i < 40 * 30; ++i) {
    for (int c = 0; c < 3; ++c) {
      texture.values.push_back(static_cast<std::uint16_t>(i % 40 < 20 ? 188 : 0));
    }
  }
  folder_.Put("texture.png", io::EncodePng(texture));
  const std::string text = SceneConfig("without: [falloff]\n");
  const std::size_t layer = text.find("- {name: wall");
  const std::string config =
      folder_.Put("scene.yaml", text.substr(0, layer) +
                                    "- {depth: {map: map.pfm, kind: z, unit: m},\n"
                                    "   texture: {kind: image, image: texture.png}}\n" +
                                    text.substr(text.find("without")));
  Succeed({"image", config, "-o", folder_ / "out", "--quiet"});
  const model::RawDepthMap depth = io::ReadDepthMap(folder_ / "out/depth.pfm");
  ASSERT_EQ(depth.values.size(), map.values.size());
  for (std::size_t i = 0; i < map.values.size(); ++i) {
    EXPECT_NEAR(depth.values[i], 1000 * map.values[i], 1e-4F);
  }
  const model::EncodedImage image =
      io::ToEncodedImage(io::ReadImageFile(folder_ / "out/picture.png"));
  EXPECT_NEAR(image.values[3 * (40 * 15 + 2)], 128, 3);
  EXPECT_NEAR(image.values[3 * (40 * 15 + 37)], 0, 3);

  map.values[5] = 0;
  folder_.Put("map.pfm", io::EncodePfm(map));
  EXPECT_THAT(
      Failure({"image", config, "-o", folder_ / "other"}),
      AllOf(HasSubstr("layers[0]: depth.map"), HasSubstr("1 of its 1200 values are holes")));
  fs::remove(folder_ / "map.pfm");
  EXPECT_THAT(Failure({"image", config, "-o", folder_ / "other"}), HasSubstr("map.pfm"));
}

TEST_F(SimulateSceneTest, RefusesInOneLineAndWritesNothing) {
  const std::string config = folder_.Put("scene.yaml", SceneConfig("viewss: [3, 3]\n"));
  for (const char* command : {"image", "light-field"}) {
    EXPECT_THAT(Failure({command, config, "-o", folder_ / "out", "--json", folder_ / "a.json"}),
                HasSubstr("unknown key 'viewss'; did you mean 'views'"));
    EXPECT_EQ(JsonOf("a.json")["status"], "refused");
    EXPECT_THAT(Failure({command, folder_ / "none.yaml", "-o", folder_ / "out"}),
                HasSubstr("none.yaml"));
  }
  // A folder of another program, and one of the other command.
  const std::string good = folder_.Put("good.yaml", SceneConfig("rays_per_pixel: 16\n"));
  folder_.Put("mine/letter.txt", "dear");
  Succeed({"light-field", good, "-o", folder_ / "views", "--views", "1x1", "--quiet"});
  for (const char* name : {"mine", "views"}) {
    EXPECT_THAT(Failure({"image", good, "-o", folder_ / name}), HasSubstr(name));
  }
  EXPECT_THAT(folder_.Entries(), ElementsAre("a.json", "good.yaml", "mine", "scene.yaml", "views"));

  EXPECT_EQ(Run({"light-field", good, "-o", folder_ / "out", "--views", "3"}).exit_code, 2);
  EXPECT_EQ(Run({"light-field", good, "-o", folder_ / "out", "--format", "jpg"}).exit_code, 2);
  EXPECT_EQ(Run({"image", good}).exit_code, 2);
}

TEST_F(SimulateSceneTest, AnInterruptLeavesNothingHalfWritten) {
  std::string text = SceneConfig("rays_per_pixel: 2000\n");
  text.replace(text.find("[40, 30]"), 8, "[512, 512]");
  const std::string config = folder_.Put("scene.yaml", text);
  ChildProgram child({"simulate", "image", config, "-o", folder_ / "out"}, scratch_.path(), 0);
  while (child.Running() && thicklens::testing::PartOf(folder_.path(), "out").empty())
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  child.Interrupt();
  const ProgramResult result = child.Wait();
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("interrupted"));
  EXPECT_THAT(folder_.Entries(), ElementsAre("scene.yaml"));
}

}  // namespace
}  // namespace thicklens::tools

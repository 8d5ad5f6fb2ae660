// A light field that is stored as its scene: what is written is read again, and bad files are
// refused by name.
#include "thicklens/io/scene_form_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "support/test_cameras.h"
#include "thicklens/io/confidence_files.h"
#include "thicklens/io/light_field_io.h"

namespace thicklens::io {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::thicklens::testing::ContentOf;
using ::thicklens::testing::ErrorOf;
using ::thicklens::testing::TemporaryFolder;

constexpr int kWidth = 31, kHeight = 22;

estimator::SceneForm Scene(int channels, double brightest = 0.95) {
  estimator::SceneForm scene;
  model::LightField& frame = scene.frame;
  frame.s_count = kWidth;
  frame.t_count = kHeight;
  frame.u_count = 4;
  frame.v_count = 3;
  frame.channels = channels;
  frame.weights = model::ApertureWeights(model::ApertureShape::kGaussian, 4, 3);
  frame.transfer = model::TransferCurve::Gamma(2.2);
  frame.origin.method = "scene";
  frame.origin.prior = "tv";
  scene.radiance = {kWidth, kHeight, channels, {}};
  scene.disparity = {kWidth, kHeight, {}, {1, 1}};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      scene.disparity.disparity.push_back(static_cast<float>(x > 15 ? 1.1 : -0.7 + 0.01 * y));
      scene.confidence.push_back(static_cast<std::uint8_t>((7 * x + y) % 256));
      for (int c = 0; c < channels; ++c) {
        scene.radiance.values.push_back(static_cast<float>(
            brightest * std::pow(0.5 + 0.5 * std::sin(0.7 * x + 0.3 * y + c), 4)));
      }
    }
  }
  return scene;
}

class SceneFormFolder : public ::testing::Test {
 protected:
  std::string Write(const estimator::SceneForm& scene) {
    OutputFolder folder(folder_ / "lf", kLightFieldMarker, LightFieldEntries());
    WriteSceneForm(scene, &folder);
    folder.Commit();
    return folder_ / "lf";
  }
  // Replaces a part of the description.
  void Change(const std::string& what, const std::string& by) {
    const std::string path = folder_ / "lf/lightfield.yaml";
    std::string text = ContentOf(path);
    const std::size_t place = text.find(what);
    ASSERT_NE(place, std::string::npos) << what;
    std::ofstream(path) << text.replace(place, what.size(), by);
  }

  TemporaryFolder folder_;
};

TEST_F(SceneFormFolder, IsReadAsItWasWritten) {
  for (const int channels : {1, 3}) {
    const estimator::SceneForm scene = Scene(channels);
    const std::string folder = Write(scene);
    EXPECT_TRUE(IsSceneForm(folder));
    EXPECT_THAT(ContentOf(folder + "/lightfield.yaml"),
                AllOf(HasSubstr("thicklens/light-field/2"), HasSubstr("radiance_bits: 16")));
    const estimator::SceneForm back = ReadSceneForm(folder);
    // The error is that of views in PNG files: half a level of what the curve encodes, also where
    // it is steep.
    for (std::size_t i = 0; i < scene.radiance.values.size(); ++i) {
      ASSERT_NEAR(scene.frame.transfer.Encode(back.radiance.values[i]),
                  scene.frame.transfer.Encode(scene.radiance.values[i]), 0.501 / 65535);
    }
    EXPECT_EQ(back.disparity.disparity, scene.disparity.disparity);
    EXPECT_EQ(back.disparity.step, scene.disparity.step);
    EXPECT_EQ(back.confidence, scene.confidence);
    EXPECT_EQ(back.frame.channels, channels);
    EXPECT_EQ(back.frame.transfer, scene.frame.transfer);
    EXPECT_TRUE((back.frame.weights == scene.frame.weights).all());
    EXPECT_EQ(back.frame.origin.prior, "tv");
    EXPECT_FALSE(back.frame.camera);
  }
}

TEST_F(SceneFormFolder, LightThatFilesOfSixteenBitsCutOffIsFloats) {
  estimator::SceneForm dark = Scene(1);
  dark.radiance.values[7] = -1e-6F;
  for (const estimator::SceneForm& scene : {Scene(3, 40), dark}) {
    const std::string folder = Write(scene);
    EXPECT_THAT(ContentOf(folder + "/lightfield.yaml"), HasSubstr("radiance_bits: 32"));
    EXPECT_EQ(ReadSceneForm(folder).radiance.values, scene.radiance.values);
  }
}

TEST_F(SceneFormFolder, OneLightEverywhereIsKept) {
  estimator::SceneForm scene = Scene(1);
  for (const float light : {0.0F, 1.0F}) {
    std::fill(scene.radiance.values.begin(), scene.radiance.values.end(), light);
    EXPECT_EQ(ReadSceneForm(Write(scene)).radiance.values, scene.radiance.values);
  }
}

TEST_F(SceneFormFolder, ItsCameraAndProfileAreKept) {
  estimator::SceneForm scene = Scene(3);
  const model::Camera camera =
      testing::WithMethod(testing::SmallCamera(kWidth, kHeight, {2.75, 1.5}));
  scene.frame.camera = camera;
  scene.frame.grid = model::DefaultGrid(camera, 4, 3);
  scene.disparity.step = estimator::DisparityOnGrid(*scene.frame.grid, {1000.0F}, 1, 1).step;
  scene.frame.colour_profile = std::string("not\0text", 8);
  const estimator::SceneForm back = ReadSceneForm(Write(scene));
  ASSERT_TRUE(back.frame.camera && back.frame.grid);
  EXPECT_EQ(back.frame.grid->u_step_mm, scene.frame.grid->u_step_mm);
  EXPECT_EQ(back.frame.camera->image_distance_mm(), camera.image_distance_mm());
  EXPECT_EQ(back.frame.colour_profile, scene.frame.colour_profile);
}

// Whatever reads a light field reads its views.
TEST_F(SceneFormFolder, AReaderOfLightFieldsGetsItsViews) {
  const std::string folder = Write(Scene(3));
  const estimator::SceneForm scene = ReadSceneForm(folder);
  LightFieldFacts facts;
  const model::LightField views = ReadLightField(folder, {}, &facts);
  EXPECT_EQ(views.values, estimator::ViewsOf(scene, 1).values);
  EXPECT_TRUE(facts.is_own);
  EXPECT_TRUE(facts.is_plain);
  EXPECT_EQ(ReadConfidence(folder, 1), estimator::RayConfidenceOf(scene, 1));
  LightFieldReading inner;
  inner.u_count = 2;
  inner.v_count = 1;
  inner.crop = model::PixelRect{3, 2, 20, 10};
  const model::LightField part = ReadLightField(folder, inner);
  EXPECT_EQ(part.values, model::CropViews(model::InnerViews(views, 2, 1), {3, 2, 20, 10}).values);
}

TEST_F(SceneFormFolder, ReplacesViewsOfAnOlderRun) {
  const model::LightField views = estimator::ViewsOf(Scene(3), 1);
  {
    OutputFolder folder(folder_ / "lf", kLightFieldMarker, LightFieldEntries());
    WriteLightField(views, ViewFormat::kPng, &folder);
    folder.Commit();
  }
  EXPECT_FALSE(IsSceneForm(folder_ / "lf"));
  const std::string folder = Write(Scene(3));
  EXPECT_FALSE(std::filesystem::exists(folder + "/views"));
  EXPECT_EQ(ReadSceneForm(folder).confidence.size(), std::size_t{kWidth} * kHeight);
}

TEST_F(SceneFormFolder, RefusesWrongFilesByName) {
  const std::string folder = Write(Scene(3));
  const std::string good = ContentOf(folder + "/lightfield.yaml");
  const auto error_with = [&](const std::string& what, const std::string& by) {
    std::ofstream(folder + "/lightfield.yaml") << good;
    Change(what, by);
    return ErrorOf([&] { ReadSceneForm(folder); });
  };
  EXPECT_THAT(error_with("size: [31, 22]", "size: [30, 22]"),
              AllOf(HasSubstr("radiance.tiff"), HasSubstr("31x22"), HasSubstr("30x22")));
  EXPECT_THAT(error_with("channels: 3", "channels: 1"),
              AllOf(HasSubstr("radiance.tiff"), HasSubstr("found 3 channel(s)")));
  EXPECT_THAT(error_with("radiance: scene/radiance.tiff", "radiance: ../photo.tiff"),
              AllOf(HasSubstr("scene.radiance"), HasSubstr("radiance.tiff")));
  EXPECT_THAT(error_with("radiance_bits: 16", "radiance_bits: 32"),
              AllOf(HasSubstr("radiance.tiff"), HasSubstr("floats")));
  EXPECT_THAT(error_with("radiance_bits: 16", "radiance_bits: 8"), HasSubstr("16, 32"));
  EXPECT_THAT(error_with("disparity_step: [1, 1]", "disparity_step: [0.5]"),
              HasSubstr("scene.disparity_step"));
  for (const std::string step : {"[0, 0]", "[1, -1]", "[1e30, 1]", "[2, 2]"}) {
    EXPECT_THAT(error_with("disparity_step: [1, 1]", "disparity_step: " + step),
                AllOf(HasSubstr("lightfield.yaml: scene.disparity_step"), HasSubstr("[1, 1]")));
  }
  EXPECT_THAT(error_with("scene:", "views_of:"), HasSubstr("unknown key 'views_of'"));
  EXPECT_THAT(error_with("light-field/2", "light-field/3"), HasSubstr("thicklens/light-field/1"));
  std::ofstream(folder + "/lightfield.yaml") << good;
  std::filesystem::rename(folder + "/scene/disparity.tiff", folder + "/scene/elsewhere.tiff");
  EXPECT_THAT(ErrorOf([&] { ReadSceneForm(folder); }), HasSubstr("disparity.tiff"));
  std::filesystem::copy(folder + "/scene/radiance.tiff", folder + "/scene/disparity.tiff");
  EXPECT_THAT(ErrorOf([&] { ReadSceneForm(folder); }),
              AllOf(HasSubstr("disparity.tiff"), HasSubstr("floats in one channel")));
}

TEST_F(SceneFormFolder, DisparitiesBeyondTheImageAreRefused) {
  estimator::SceneForm scene = Scene(1);
  scene.disparity.disparity[40] = -31.5F;
  const std::string folder = Write(scene);
  EXPECT_THAT(ErrorOf([&] { ReadSceneForm(folder); }),
              AllOf(HasSubstr("disparity.tiff"), HasSubstr("-31.5 px"), HasSubstr("31 px")));
}

TEST_F(SceneFormFolder, LeavesFilesOfTheUserAlone) {
  const std::string folder = Write(Scene(1));
  std::ofstream(folder + "/disparity.tiff") << "mine";
  EXPECT_THAT(ErrorOf([&] { Write(Scene(1)); }), HasSubstr("disparity.tiff"));
  EXPECT_EQ(ContentOf(folder + "/disparity.tiff"), "mine");
}

TEST_F(SceneFormFolder, WhatIsNoSceneIsRefused) {
  EXPECT_FALSE(IsSceneForm(folder_ / "nothing"));
  EXPECT_THAT(ErrorOf([&] { Write(Scene(2)); }), HasSubstr("channels is 2"));
  estimator::SceneForm scene = Scene(1);
  scene.radiance.values.front() = std::numeric_limits<float>::infinity();
  EXPECT_THAT(ErrorOf([&] { Write(scene); }), HasSubstr("radiance"));
}

}  // namespace
}  // namespace thicklens::io

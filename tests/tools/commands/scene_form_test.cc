// A light field that is stored as its scene, from `estimate` to what reads light fields.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "support/test_cameras.h"
#include "thicklens/io/confidence_files.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_file.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/model/camera_file.h"
#include "tools/io/image_library.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using Arguments = std::vector<std::string>;

constexpr int kColumns = 80, kRows = 56;

class SceneFormCommandTest : public ::testing::Test, protected EstimateCommand {
 protected:
  std::string Photo() const {
    model::EncodedImage image{kColumns, kRows, 3, 8, {}};
    std::mt19937 engine(3);
    std::normal_distribution<double> noise(0, 1);
    for (int i = 0; i < kColumns * kRows * 3; ++i) {
      const double x = i / 3 % kColumns, y = i / 3 / kColumns;
      const double value = 120 + 40 * std::sin(0.35 * x + i % 3) + 30 * std::sin(0.3 * y);
      image.values.push_back(
          static_cast<std::uint16_t>(std::lround(std::clamp(value + noise(engine), 0.0, 255.0))));
    }
    return folder_.Put("picture.png", io::EncodePng(image));
  }
  // A near strip before a far wall.
  std::string Depth() const {
    model::RawDepthMap map{kColumns, kRows, {}, false};
    for (int i = 0; i < kColumns * kRows; ++i) {
      const int x = i % kColumns;
      map.values.push_back(x >= 30 && x < 50 ? 1.0F : -0.5F);
    }
    return folder_.Put("depth.pfm", io::EncodePfm(map));
  }
  Arguments Usual() const {
    return {Photo(), Depth(), "--depth-kind", "disparity", "--views", "5x3"};
  }
  ProgramResult RunProgram(const Arguments& arguments) const {
    return ChildProgram(arguments, scratch_.path(), 0).Wait();
  }
  model::LinearImage Rendered(const std::string& folder, const Arguments& what) const {
    Arguments arguments = {"render", folder, "-o", folder_ / "rendered.pfm"};
    arguments.insert(arguments.end(), what.begin(), what.end());
    const ProgramResult result = RunProgram(arguments);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    const std::string path = folder_ / "rendered.pfm";
    const cv::Mat image = io::DecodeImageFile(testing::ContentOf(path), path).pixels;
    model::LinearImage light{image.cols, image.rows, image.channels(), {}};
    for (int y = 0; y < image.rows; ++y) {
      const auto* const row = image.ptr<float>(y);
      light.values.insert(light.values.end(), row, row + image.cols * image.channels());
    }
    return light;
  }
};

double LargestDifference(const std::vector<float>& a, const std::vector<float>& b) {
  EXPECT_EQ(a.size(), b.size());
  double largest = 0;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
    largest = std::max(largest, std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i])));
  return largest;
}

TEST_F(SceneFormCommandTest, ShowsTheViewsOfTheEstimate) {
  Summary(With(Usual(), {"--format", "tiff"}));
  const model::LightField views = io::ReadLightField(Output(), {});
  const auto confidence = io::ReadConfidence(Output(), 1);
  ProgramResult result;
  const json summary = Summary(With(Usual(), {"--store", "scene"}), &result);
  EXPECT_EQ(summary["stored"], "scene");
  EXPECT_EQ(summary["clipped_fraction"], 0);
  EXPECT_GT(summary["rays"]["filled_in_share"].get<double>(), 0.001);
  EXPECT_THAT(result.out, HasSubstr("stored as their scene"));
  EXPECT_FALSE(fs::exists(fs::path(Output()) / "views"));
  EXPECT_FALSE(fs::exists(fs::path(Output()) / "confidence"));
  const model::LightField of_scene = io::ReadLightField(Output(), {});
  EXPECT_LE(LargestDifference(of_scene.values, views.values), 4e-5);
  EXPECT_EQ(io::ReadConfidence(Output(), 1), confidence);
  EXPECT_EQ(of_scene.origin.strength, views.origin.strength);
}

TEST_F(SceneFormCommandTest, RendersWhatOtherLightFieldsRender) {
  Summary(With(Usual(), {"--store", "scene"}));
  const std::string scene = Output();
  const std::string views = folder_ / "views-of-it";
  ASSERT_EQ(RunProgram({"render", scene, "--convert", "thicklens-tiff", "-o", views}).exit_code, 0);
  for (const Arguments& what :
       {Arguments{"--view", "4,1"}, {"--view", "centre"}, {"--as-captured"}, {"--epi", "row=20"}}) {
    EXPECT_LE(LargestDifference(Rendered(scene, what).values, Rendered(views, what).values), 1e-6)
        << what[0];
  }
  // At a whole disparity, stored views are displaced without interpolation too, but end at their
  // borders.
  const model::LinearImage of_scene = Rendered(scene, {"--focus-disparity", "1"});
  const model::LinearImage of_views = Rendered(views, {"--focus-disparity", "1"});
  double largest = 0;
  for (int y = 4; y < kRows - 4; ++y) {
    for (int x = 4; x < kColumns - 4; ++x)
      largest = std::max(largest, std::abs(static_cast<double>(of_scene.at(x, y, 0)) -
                                           static_cast<double>(of_views.at(x, y, 0))));
  }
  EXPECT_LE(largest, 1e-5);
  const ProgramResult compared = RunProgram({"compare", views, scene});
  EXPECT_EQ(compared.exit_code, 0) << compared.err;
  const ProgramResult page = RunProgram({"report", scene, "-o", folder_ / "page.html"});
  EXPECT_EQ(page.exit_code, 0) << page.err;
}

TEST_F(SceneFormCommandTest, RendersViewsBetweenTheViews) {
  Summary(With(Usual(), {"--store", "scene"}));
  const model::LinearImage before = Rendered(Output(), {"--view", "3,1"});
  const model::LinearImage between = Rendered(Output(), {"--view", "3.5,1"});
  const model::LinearImage after = Rendered(Output(), {"--view", "4,1"});
  EXPECT_GT(LargestDifference(between.values, before.values), 0.02);
  EXPECT_GT(LargestDifference(between.values, after.values), 0.02);
  // The wall has a disparity of -0.5 px: half a view moves it by -0.25 px, which is not whole, and
  // two views by -1 px.
  const model::LinearImage far_left = Rendered(Output(), {"--view", "1.5,1"});
  for (int x = 8; x < 20; ++x) {
    EXPECT_NEAR(far_left.at(x - 1, 20, 1), between.at(x, 20, 1), 1e-4) << x;
  }
}

TEST_F(SceneFormCommandTest, InnerViewsAndPartsAreThoseOfTheViews) {
  Summary(With(Usual(), {"--store", "scene"}));
  const std::string scene = Output();
  const std::string views = folder_ / "views-of-it";
  ASSERT_EQ(RunProgram({"render", scene, "--convert", "thicklens-tiff", "-o", views}).exit_code, 0);
  const Arguments part = {"--views", "3x1", "--crop", "10,4,40,30"};
  for (Arguments what : {Arguments{"--view", "2,0"}, {"--view", "centre"}}) {
    what.insert(what.end(), part.begin(), part.end());
    const model::LinearImage of_scene = Rendered(scene, what);
    EXPECT_EQ(of_scene.width_px, 40);
    EXPECT_LE(LargestDifference(of_scene.values, Rendered(views, what).values), 1e-6);
  }
  // Between views, a part of an inner view is a part of the view.
  const model::LinearImage whole = Rendered(scene, {"--view", "2.5,1"});
  const model::LinearImage inner =
      Rendered(scene, {"--view", "1.5,0", "--views", "3x1", "--crop", "10,4,40,30"});
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 40; ++x) ASSERT_EQ(inner.at(x, y, 1), whole.at(x + 10, y + 4, 1));
  }
  const ProgramResult refused = RunProgram(
      {"render", scene, "--view", "1.5,1", "--view-order", "swap", "-o", folder_ / "view.png"});
  EXPECT_THAT(refused.err, HasSubstr("exclude --layout"));
}

TEST_F(SceneFormCommandTest, AReportShowsItsViews) {
  const json summary = Summary(With(Usual(), {"--store", "scene", "--report", folder_ / "page"}));
  EXPECT_EQ(summary["stored"], "scene");
  EXPECT_TRUE(fs::exists(folder_ / "page/index.html"));
  EXPECT_TRUE(fs::exists(fs::path(Output()) / "scene/radiance.tiff"));
}

TEST_F(SceneFormCommandTest, ACamerasDepthsAreKept) {
  const std::string camera =
      folder_.Put("camera.yaml", model::CameraToYaml(thicklens::testing::PhotographCamera(
                                     kColumns, kRows, model::TransferCurve::Srgb())));
  model::RawDepthMap map{kColumns, kRows, {}, false};
  for (int i = 0; i < kColumns * kRows; ++i)
    map.values.push_back(static_cast<float>(i % kColumns < 40 ? 700 : 1000));
  const std::string depth = folder_.Put("depth.pfm", io::EncodePfm(map));
  const Arguments arguments = {Photo(),    depth,  "--depth-kind", "z",
                               "--camera", camera, "--depth-unit", "mm"};
  Summary(With(arguments, {"--format", "tiff"}));
  const model::LightField views = io::ReadLightField(Output(), {});
  Summary(With(arguments, {"--store", "scene"}));
  const model::LightField of_scene = io::ReadLightField(Output(), {});
  EXPECT_LE(LargestDifference(of_scene.values, views.values), 4e-5);
  ASSERT_TRUE(of_scene.grid && of_scene.camera);
  EXPECT_EQ(of_scene.landing_step_px, views.landing_step_px);
  const ProgramResult result =
      RunProgram({"render", Output(), "--focus", "700", "-o", folder_ / "focus.png"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("focus at 700 mm"));
  // Stored views are interpolated once more, which changes the details a little; at another depth
  // everything is displaced.
  const std::string stored = folder_ / "views-of-it";
  ASSERT_EQ(RunProgram({"render", Output(), "--convert", "thicklens-tiff", "-o", stored}).exit_code,
            0);
  const auto rms = [&](const char* of_scene, const char* of_views) {
    const model::LinearImage a = Rendered(Output(), {"--focus", of_scene});
    const model::LinearImage b = Rendered(stored, {"--focus", of_views});
    double squares = 0;
    int count = 0;
    for (int y = 8; y < kRows - 8; ++y) {
      for (int x = 8; x < kColumns - 8; ++x, ++count)
        squares += std::pow(static_cast<double>(a.at(x, y, 1) - b.at(x, y, 1)), 2);
    }
    return std::sqrt(squares / count);
  };
  for (const char* depth_mm : {"700", "1000"}) {
    EXPECT_LT(rms(depth_mm, depth_mm), 0.2 * rms("700", "1000")) << depth_mm;
  }
}

// The chunks of a WebP file of that name.
int ChunksOf(const std::string& bytes, const std::string& name) {
  int count = 0;
  for (std::size_t at = 12; at + 8 <= bytes.size();) {
    if (bytes.compare(at, 4, name) == 0) ++count;
    std::uint32_t size = 0;
    for (int i = 3; i >= 0; --i) {
      size = (size << 8) | static_cast<unsigned char>(bytes[at + 4 + static_cast<std::size_t>(i)]);
    }
    at += 8 + size + size % 2;
  }
  return count;
}

TEST_F(SceneFormCommandTest, BecomesAnAnimation) {
  if (!io::HasImageLibrary()) GTEST_SKIP() << "this build writes no WebP files";
  Summary(With(Usual(), {"--store", "scene"}));
  const std::string file = folder_ / "loop.webp";
  for (const std::string kind : {"parallax", "focus"}) {
    const ProgramResult result = RunProgram(
        {"render", Output(), "--animate", kind, "--frames", "6", "--seconds", "2", "-o", file});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    const std::string bytes = testing::ContentOf(file);
    EXPECT_EQ(bytes.substr(0, 4), "RIFF");
    EXPECT_EQ(ChunksOf(bytes, "ANIM"), 1);
    EXPECT_EQ(ChunksOf(bytes, "ANMF"), 6) << kind;  // all frames differ
  }
  EXPECT_THAT(RunProgram({"render", Output(), "--animate", "focus", "-o", folder_ / "a.mp4"}).err,
              HasSubstr(".webp"));
  EXPECT_THAT(
      RunProgram({"render", Output(), "--animate", "focus", "--crop", "0,0,8,8", "-o", file}).err,
      HasSubstr("excludes --views, --crop"));
  EXPECT_THAT(RunProgram({"render", Output(), "--view", "1,1", "--frames", "6", "-o", file}).err,
              HasSubstr("--frames: requires --animate"));
  Summary(With(Usual(), {"--format", "png"}));
  EXPECT_THAT(RunProgram({"render", Output(), "--animate", "focus", "-o", file}).err,
              HasSubstr("--store scene"));
}

TEST_F(SceneFormCommandTest, WhatDoesNotFitIsRefused) {
  EXPECT_THAT(Refusal(With(Usual(), {"--store", "scene", "--solver", "blocks"}), 2),
              AllOf(HasSubstr("--store scene"), HasSubstr("blocks")));
  EXPECT_THAT(Refusal(With(Usual(), {"--store", "scene", "--fill", "telea"}), 2),
              HasSubstr("--fill telea"));
  EXPECT_THAT(Refusal(With(Usual(), {"--store", "scene", "--format", "png"}), 2),
              HasSubstr("--format"));
  EXPECT_THAT(Refusal(With(Usual(), {"--store", "scene", "--within", "5s"}), 2),
              HasSubstr("--within"));
  Summary(With(Usual(), {"--format", "png"}));
  const auto error = [&](const std::string& place) {
    return RunProgram({"render", Output(), "--view", place, "-o", folder_ / "view.png"}).err;
  };
  EXPECT_THAT(error("2.5,1"), AllOf(HasSubstr("none between them"), HasSubstr("--store scene")));
  EXPECT_THAT(error("5,1"), HasSubstr("u must be from 0 to 4"));
  EXPECT_THAT(error("-1,1"), HasSubstr("from 0 to"));
}

}  // namespace
}  // namespace thicklens::tools

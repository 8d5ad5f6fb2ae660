// thicklens frames, and calibrate with darks, flats and defects.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "thicklens/base/output_file.h"
#include "thicklens/io/image_file.h"
#include "thicklens/simulate.h"
#include "tools/support/bench_simulation.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;
using Arguments = std::vector<std::string>;

constexpr int kFrameSidePx = 144;

class FramesProgram : public ::testing::Test {
 protected:
  ProgramResult Start(const Arguments& arguments) const {
    return ChildProgram(arguments, folder_.path(), 0).Wait();
  }
  nlohmann::json Json(Arguments arguments) const {
    const std::string path = folder_ / "result.json";
    arguments.insert(arguments.end(), {"--json", path});
    const ProgramResult result = Start(arguments);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return nlohmann::json::parse(ContentOf(path));
  }
  std::string Put(const std::string& name, const cv::Mat& light, double noise) {
    cv::Mat noisy(light.size(), CV_32F), stored;
    random_.fill(noisy, cv::RNG::NORMAL, 0, noise);
    noisy += light;
    noisy.convertTo(stored, CV_16U, 65535);
    const std::string path = folder_ / name;
    WriteFileAtomically(path, io::EncodeImageFile(stored, io::ImageFormat::kPng));
    return path;
  }
  static cv::Mat Level(double level) {
    return cv::Mat(kFrameSidePx, kFrameSidePx, CV_32F, cv::Scalar(level));
  }
  // Two stops from the centre to the corners.
  static cv::Mat Shading() {
    cv::Mat shading(kFrameSidePx, kFrameSidePx, CV_32F);
    for (int y = 0; y < kFrameSidePx; ++y) {
      for (int x = 0; x < kFrameSidePx; ++x)
        shading.at<float>(y, x) = static_cast<float>(
            std::pow(1 + (std::pow(x - 71.5, 2) + std::pow(y - 71.5, 2)) / (2 * 71.5 * 71.5), -2));
    }
    return shading;
  }
  static cv::Mat HotPixels() {
    cv::Mat hot = cv::Mat::zeros(kFrameSidePx, kFrameSidePx, CV_32F);
    cv::RNG random(9);
    for (int i = 0; i < 60; ++i)
      hot.at<float>(random.uniform(0, kFrameSidePx), random.uniform(0, kFrameSidePx)) = 0.4F;
    return hot;
  }

  TemporaryFolder folder_;
  cv::RNG random_{3};
};

TEST_F(FramesProgram, AveragesExposuresAndFindsTheirHotPixels) {
  Arguments arguments = {"frames", "average"};
  for (int i = 0; i < 5; ++i)
    arguments.push_back(Put("d" + std::to_string(i) + ".png", Level(0.02) + HotPixels(), 0.001));
  const std::string output = folder_ / "dark.tif", defects = folder_ / "bad.txt";
  arguments.insert(arguments.end(), {"-o", output, "--defects-out", defects, "--method", "median",
                                     "--transfer", "linear"});
  const nlohmann::json json = Json(arguments);
  const int hot = cv::countNonZero(HotPixels() > 0);
  EXPECT_EQ(json["frames"], 5);
  EXPECT_EQ(json["hot_pixels"], hot);
  EXPECT_EQ(json["method"], "median");
  EXPECT_NEAR(json["noise_of_one_frame"], 0.001, 0.0001);
  EXPECT_NEAR(json["mean_level"], 0.02 + 0.4 * hot / (kFrameSidePx * kFrameSidePx), 1e-4);
  const io::DecodedImage image = io::ReadImageData(output);
  EXPECT_EQ(image.pixels.type(), CV_32F);
  EXPECT_THAT(image.facts.description, HasSubstr("thicklens frames average 1\nframes: 5\n"));
  EXPECT_NEAR(image.pixels.at<float>(0, 0), 0.02, 0.002);
  const std::string list = ContentOf(defects);
  EXPECT_EQ(std::count(list.begin(), list.end(), '\n'), hot + 1);
  EXPECT_THAT(Start({"frames", "average", output, "-o", folder_ / "again.tif"}).out,
              AllOf(HasSubstr("frames       5"), HasSubstr("hot")));
}

TEST_F(FramesProgram, SaysWhatItTakesForGranted) {
  const std::string dark = Put("d.png", Level(0.02), 0.001);
  const ProgramResult result = Start({"frames", "average", dark, "-o", folder_ / "dark.tif"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.err, AllOf(HasSubstr("d.png"), HasSubstr("no transfer curve"),
                                HasSubstr("linear"), HasSubstr("--transfer")));
  EXPECT_THAT(
      Start({"frames", "average", dark, "-o", folder_ / "dark.tif", "--transfer", "linear"}).err,
      IsEmpty());
}

TEST_F(FramesProgram, RefusesWrongFilesAndWrongNames) {
  const std::string dark = Put("d.png", Level(0.02), 0.001);
  ProgramResult result = Start({"frames", "average", dark, "-o", folder_ / "dark.png"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, AllOf(HasSubstr("dark.png"), HasSubstr(".tif")));
  result = Start({"frames", "average", folder_ / "none.png", "-o", folder_ / "dark.tif"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("none.png"));
  result = Start({"frames", "defects", "-o", folder_ / "bad.txt"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("--dark or --flat"));
  const std::string other = Put("o.png", cv::Mat(40, 50, CV_32F, cv::Scalar(0.5)), 0.001);
  result = Start({"frames", "defects", "--dark", dark, "--flat", other, "-o", folder_ / "bad.txt",
                  "--transfer", "linear"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, AllOf(HasSubstr("d.png"), HasSubstr("144 x 144"), HasSubstr("o.png"),
                                HasSubstr("50 x 40")));
}

// A sweep with dark current, hot pixels and corners that are two stops darker, corrected by files
// of the same sensor, gives the result of the clean sweep.
TEST_F(FramesProgram, CalibrateCorrectsAWholeSweep) {
  SweepSimulation simulation = thicklens::testing::SmallBenchSimulation();
  simulation.bits = 16;
  const std::string folder = folder_ / "s";
  const Sweep sweep = SimulateSweep(simulation, folder);
  const Arguments calibrate = {"calibrate", folder + "/sweep.yaml", "--no-field"};
  const nlohmann::json clean = Json(calibrate);
  EXPECT_TRUE(clean["correction"].is_null());
  for (const model::SweepFrame& frame : sweep.description.frames) {
    cv::Mat light;
    io::ReadImageData(frame.image).pixels.convertTo(light, CV_32F, 1.0 / 65535);
    cv::Mat stored;
    cv::Mat(light.mul(Shading()) + 0.05 + HotPixels()).convertTo(stored, CV_16U, 65535);
    WriteFileAtomically(frame.image, io::EncodeImageFile(stored, io::ImageFormat::kPng));
  }
  Arguments corrected = calibrate;
  corrected.emplace_back("--dark");
  for (int i = 0; i < 4; ++i)
    corrected.push_back(Put("d" + std::to_string(i) + ".png", Level(0.05) + HotPixels(), 0.001));
  corrected.emplace_back("--flat");
  for (int i = 0; i < 4; ++i) {
    corrected.push_back(
        Put("w" + std::to_string(i) + ".png", 0.5 * Shading() + 0.05 + HotPixels(), 0.001));
  }
  Json({"frames", "defects", "--dark", folder_ / "d0.png", "--transfer", "linear", "-o",
        folder_ / "bad.png"});
  corrected.insert(corrected.end(), {"--defects", folder_ / "bad.png"});
  const nlohmann::json found = Json(corrected);
  EXPECT_EQ(found["correction"]["lines"].size(), 3U);
  EXPECT_EQ(found["correction"]["interpolated_pixels"], cv::countNonZero(HotPixels() > 0));
  for (const char* value : {"focus_depth_mm", "image_distance_mm", "blur_ratio"}) {
    const double sigma = clean[value]["sigma"];
    EXPECT_NEAR(found[value]["value"], clean[value]["value"], 0.5 * sigma) << value;
    EXPECT_LT(found[value]["sigma"], 1.5 * sigma) << value;
  }
  // The keys of the sweep's file mean the same, and a dry run checks the files.
  const std::string yaml = ContentOf(folder + "/sweep.yaml");
  WriteFileAtomically(folder + "/sweep.yaml",
                      yaml +
                          "dark: [../d0.png, ../d1.png, ../d2.png, ../d3.png]\n"
                          "flat: [../w0.png, ../w1.png, ../w2.png, ../w3.png]\n"
                          "defects: ../bad.png\n");
  EXPECT_EQ(Json(calibrate)["blur_ratio"], found["blur_ratio"]);
  Arguments dry = calibrate;
  dry.emplace_back("--dry-run");
  EXPECT_THAT(Start(dry).out, AllOf(HasSubstr("corrected  dark"), HasSubstr("4 frames"),
                                    HasSubstr("pixels are interpolated")));
  dry.insert(dry.end(), {"--flat", folder_ / "d0.png"});
  const ProgramResult refused = Start(dry);
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("d0.png"), HasSubstr("no light")));
}

}  // namespace
}  // namespace thicklens::tools

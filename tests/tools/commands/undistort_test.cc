// thicklens undistort, and calibrate, camera init, explain and estimate with --distortion.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "thicklens/base/output_file.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_file.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/simulate.h"
#include "tools/support/bench_simulation.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;
using Arguments = std::vector<std::string>;

constexpr int kBarWidthPx = 160, kBarHeightPx = 120;
constexpr double kLensPx = 150, kFirst = 0.15;  // pincushion: 6.7 % at the corner

class UndistortProgram : public ::testing::Test {
 protected:
  ProgramResult Start(const Arguments& arguments) const {
    return ChildProgram(arguments, scratch_.path(), 0).Wait();
  }
  nlohmann::json Json(Arguments arguments) const {
    const std::string path = folder_ / "result.json";
    arguments.insert(arguments.end(), {"--json", path});
    const ProgramResult result = Start(arguments);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return nlohmann::json::parse(ContentOf(path));
  }
  std::string PutCalibration(int width, int height, double focal_px, double k1) const {
    return folder_.Put(
        "calib.yml",
        "%YAML:1.0\n---\nimage_width: " + std::to_string(width) +
            "\nimage_height: " + std::to_string(height) +
            "\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ " +
            std::to_string(focal_px) + ", 0., " + std::to_string((width - 1) / 2.0) + ", 0., " +
            std::to_string(focal_px) + ", " + std::to_string((height - 1) / 2.0) +
            ", 0., 0., 1. ]\n"
            "distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: "
            "[ " +
            std::to_string(k1) + ", 0., 0., 0., 0. ]\n");
  }
  // A bright bar that is straight without the distortion: x = 40 + kSlope y.
  static cv::Mat Bar() {
    cv::Mat light(kBarHeightPx, kBarWidthPx, CV_32F);
    for (int y = 0; y < kBarHeightPx; ++y) {
      for (int x = 0; x < kBarWidthPx; ++x) {
        // The photograph shows at r' the place r of r' = r (1 + k r^2), by bisection.
        const double u = (x - 79.5) / kLensPx, v = (y - 59.5) / kLensPx, far = std::hypot(u, v);
        double low = 0, high = 1;
        for (int i = 0; i < 50; ++i) {
          const double r = (low + high) / 2;
          (r * (1 + kFirst * r * r) < far ? low : high) = r;
        }
        const double shrink = far > 0 ? low / far : 1;
        const double off =
            79.5 + kLensPx * u * shrink - 40 - kSlope * (59.5 + kLensPx * v * shrink);
        light.at<float>(y, x) = static_cast<float>(0.1 + 0.7 * std::exp(-off * off / 8));
      }
    }
    return light;
  }
  static double LargestBend(const cv::Mat& pixels) {
    cv::Mat values;
    pixels.convertTo(values, CV_64F);
    double floor = 0;
    cv::minMaxLoc(values(cv::Rect(70, 20, 60, 80)), nullptr, &floor);
    double largest = 0;
    for (int y = 20; y < kBarHeightPx - 20; ++y) {
      double sum = 0, moment = 0;
      for (int x = 28; x < 64; ++x) {
        const double light = std::max(0.0, values.at<double>(y, x) - 1.05 * floor);
        sum += light;
        moment += light * x;
      }
      largest = std::max(largest, std::abs(moment / sum - 40 - kSlope * y));
    }
    return largest;
  }

  static constexpr double kSlope = 0.05;
  TemporaryFolder folder_, scratch_;
};

TEST_F(UndistortProgram, StraightensImagesOfEachKind) {
  const std::string calibration = PutCalibration(kBarWidthPx, kBarHeightPx, kLensPx, kFirst);
  const cv::Mat light = Bar();
  cv::Mat bytes, words;
  light.convertTo(bytes, CV_8U, 255);
  light.convertTo(words, CV_16U, 65535);
  const auto put = [&](const std::string& name, const cv::Mat& pixels) {
    const std::string path = folder_ / name;
    io::ImageWriting writing;
    writing.is_linear = true;
    WriteFileAtomically(path, io::EncodeImageFile(pixels, io::FormatOfName(name), writing));
    return path;
  };
  EXPECT_GT(LargestBend(words), 0.5);
  const Arguments images = {put("a.png", bytes), put("b.png", words), put("c.tif", light)};
  Arguments arguments = {"undistort",     "--distortion", calibration, "-o",
                         folder_ / "out", "--transfer",   "linear"};
  arguments.insert(arguments.end(), images.begin(), images.end());
  const nlohmann::json summary = Json(arguments);
  ASSERT_EQ(summary["images"].size(), 3U);
  EXPECT_EQ(summary["distortion"]["coefficients"].size(), 5U);
  EXPECT_GT(summary["images"][0]["without_source_share"].get<double>(), 0.05);
  EXPECT_LT(summary["images"][0]["without_source_share"].get<double>(), 0.3);
  const std::vector<int> types = {CV_8U, CV_16U, CV_32F};
  for (std::size_t i = 0; i < images.size(); ++i) {
    const std::string path = (fs::path(folder_ / "out") / fs::path(images[i]).filename()).string();
    const io::DecodedImage out = io::ReadImageData(path);
    SCOPED_TRACE(path);
    EXPECT_EQ(out.pixels.type(), types[i]);
    EXPECT_LT(LargestBend(out.pixels), 0.1);
  }
  // Black where the photograph shows nothing.
  const cv::Mat corner = io::ReadImageData(folder_ / "out/b.png").pixels;
  EXPECT_EQ(corner.at<std::uint16_t>(0, 0), 0);
  // A file without a size has that of the images, which is said.
  const std::string bare = folder_.Put("bare.yml",
                                       "K: [150, 0, 79.5, 0, 150, 59.5, 0, 0, 1]\n"
                                       "D: [0.15, 0, 0, 0, 0]\n");
  const ProgramResult of_bare = Start({"undistort", images[1], "--distortion", bare, "--transfer",
                                       "linear", "-o", folder_ / "bare"});
  EXPECT_EQ(of_bare.exit_code, 0);
  EXPECT_THAT(of_bare.err, AllOf(HasSubstr("bare.yml"), HasSubstr("160 x 120 px")));
  EXPECT_EQ(ContentOf(folder_ / "bare/b.png"), ContentOf(folder_ / "out/b.png"));
  // The camera file that camera init makes gives the same result.
  const std::string camera = folder_ / "camera.yaml";
  ASSERT_EQ(Start({"camera", "init", "--focal-mm", "1.5", "--f-number", "2", "--pitch-um", "10",
                   "--size", "160x120", "--distortion", calibration, "-o", camera})
                .exit_code,
            0);
  EXPECT_EQ(model::ReadCamera(camera).distortion->coefficients[0], kFirst);
  // A distortion that is not of this lens is doubted.
  EXPECT_THAT(Start({"camera", "init", "--focal-mm", "50", "--f-number", "2", "--pitch-um", "10",
                     "--size", "160x120", "--distortion", calibration})
                  .err,
              AllOf(HasSubstr("150 px"), HasSubstr("1.5 mm"), HasSubstr("50 mm")));
  Json({"undistort", "--camera", camera, "--transfer", "linear", images[1], "-o", folder_ / "by"});
  EXPECT_EQ(ContentOf(folder_ / "by/b.png"), ContentOf(folder_ / "out/b.png"));
}

TEST_F(UndistortProgram, DepthMapsKeepTheirValues) {
  const std::string calibration = PutCalibration(kBarWidthPx, kBarHeightPx, kLensPx, kFirst);
  cv::Mat words(kBarHeightPx, kBarWidthPx, CV_16U, cv::Scalar(1000));
  words.colRange(70, 160).setTo(2000);
  const std::string png = folder_ / "depth.png";
  WriteFileAtomically(png, io::EncodeImageFile(words, io::ImageFormat::kPng));
  model::RawDepthMap map;
  map.width_px = kBarWidthPx;
  map.height_px = kBarHeightPx;
  for (int i = 0; i < kBarWidthPx * kBarHeightPx; ++i)
    map.values.push_back(i % kBarWidthPx < 70 ? 1.5F : 2.5F);
  const std::string pfm = folder_ / "float.pfm";
  WriteFileAtomically(pfm, io::EncodePfm(map));
  Json({"undistort", "--depth", "--distortion", calibration, png, pfm, "-o", folder_ / "out"});
  const cv::Mat whole = io::ReadImageData(folder_ / "out/depth.png").pixels;
  ASSERT_EQ(whole.type(), CV_16U);
  int holes = 0;
  for (int y = 0; y < kBarHeightPx; ++y) {
    for (int x = 0; x < kBarWidthPx; ++x) {
      const int value = whole.at<std::uint16_t>(y, x);
      EXPECT_TRUE(value == 0 || value == 1000 || value == 2000) << value;
      holes += value == 0 ? 1 : 0;
    }
  }
  EXPECT_GT(holes, 0.05 * kBarWidthPx * kBarHeightPx);
  int nans = 0;
  for (const float value : io::ReadDepthMap(folder_ / "out/float.pfm").values) {
    EXPECT_TRUE(std::isnan(value) || value == 1.5F || value == 2.5F) << value;
    nans += std::isnan(value) ? 1 : 0;
  }
  EXPECT_EQ(nans, holes);
}

TEST_F(UndistortProgram, RefusesWithTheFileAndTheReason) {
  const std::string calibration = PutCalibration(kBarWidthPx, kBarHeightPx, kLensPx, kFirst);
  const std::string image = folder_ / "a.png";
  WriteFileAtomically(
      image, io::EncodeImageFile(cv::Mat(100, 100, CV_8U, cv::Scalar(9)), io::ImageFormat::kPng));
  const std::string out = folder_ / "out";
  ProgramResult result = Start({"undistort", image, "-o", out});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("--distortion or --camera is needed"));
  result = Start({"undistort", image, "--distortion", calibration, "-o", out});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, AllOf(HasSubstr("a.png"), HasSubstr("160 x 120 px"),
                                HasSubstr("100 x 100 px"), HasSubstr("aspect ratio")));
  EXPECT_FALSE(fs::exists(out + "/a.png"));
  result = Start({"undistort", image, "--distortion", folder_ / "no.yml", "-o", out});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("no.yml"));
  result = Start({"undistort", image, "--distortion", calibration, "-o", folder_.path()});
  EXPECT_EQ(result.exit_code, 2) << "the output would replace its input";
  result =
      Start({"undistort", image, folder_.Put("b/a.png"), "--distortion", calibration, "-o", out});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("different folders"));
}

// A sweep is calibrated with the file, and its camera file states the distortion, which explain
// shows. With another size of the images, the error says so.
TEST_F(UndistortProgram, CalibrateWritesTheDistortionIntoTheCameraFile) {
  const std::string sweep = folder_ / "sweep";
  SimulateSweep(thicklens::testing::SmallBenchSimulation(), sweep);
  const std::string calibration = PutCalibration(144, 144, 11111, 0.001);
  const std::string camera = folder_ / "camera.yaml";
  const nlohmann::json summary = Json({"calibrate", sweep, "--distortion", calibration, "-o",
                                       camera, "--report", folder_ / "report"});
  EXPECT_EQ(summary["distortion"]["source"], calibration);
  EXPECT_THAT(ContentOf(folder_ / "report/index.html"),
              HasSubstr("taken out of the frames: OpenCV model with 5 coefficients"));
  const std::string yaml = ContentOf(camera);
  EXPECT_THAT(yaml, AllOf(HasSubstr("distortion:"), HasSubstr("undistorted: true")));
  const ProgramResult explained = Start({"explain", camera, "--depth-range", "290:310"});
  EXPECT_THAT(explained.out, HasSubstr("OpenCV model with 5 coefficients for 144 x 144 px"));
  const std::string wide = PutCalibration(1920, 1080, 2000, 0.001);
  const ProgramResult refused = Start({"calibrate", sweep, "--distortion", wide, "--dry-run"});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("--distortion"), HasSubstr("1920 x 1080 px"),
                                 HasSubstr("144 x 144 px")));
  // None: the frames are undistorted already.
  Json({"calibrate", sweep, "--camera", camera, "--distortion", "none", "-o", folder_ / "n.yaml"});
  EXPECT_THAT(ContentOf(folder_ / "n.yaml"), Not(HasSubstr("distort")));
}

}  // namespace
}  // namespace thicklens::tools

// Traces of processing on frames that were made without the project's simulator.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <utility>
#include <vector>

#include "calib/response/processing_traces.h"
#include "calib/response/weak_detail.h"
#include "tests/calib/response/response_scene.h"
#include "thicklens/calib/camera_response.h"

namespace thicklens::calib {
namespace {

using thicklens::testing::ReadFrom;
using thicklens::testing::ResponseScene;
using thicklens::testing::Rounded;

CameraResponse ResponseTo(const ResponseScene& scene, cv::Mat (*process)(const cv::Mat& bytes)) {
  std::vector<cv::Mat> light;
  ResponseFrames frames = scene.Make(&light);
  for (cv::Mat& image : light) {
    cv::Mat bytes;
    image.convertTo(bytes, CV_8U, 255);
    process(bytes).convertTo(image, CV_32F, 1.0 / 255);
  }
  ReadFrom(light, &frames);
  const cv::Size size = light.front().size();
  CameraResponse response;
  response.measured = true;
  response.weak_detail_loss = MeasureWeakDetailLoss(frames, size);
  response.noise_rise = MeasureNoiseRise(frames, size, 0.6 / 255);
  response.block_grid = MeasureBlockGrid(frames, size);
  return response;
}

cv::Mat Unchanged(const cv::Mat& bytes) { return bytes; }

// Noise reduction by coring: detail below a threshold is removed, and stronger detail is reduced by
// the threshold.
cv::Mat Denoised(const cv::Mat& bytes) {
  constexpr float kThreshold = 6;  // grey levels
  cv::Mat grey, wide, cored;
  bytes.convertTo(grey, CV_32F);
  cv::GaussianBlur(grey, wide, cv::Size(), 2);
  grey -= wide;
  for (float& detail : cv::Mat_<float>(grey))
    detail = std::copysign(std::max(0.0F, std::abs(detail) - kThreshold), detail);
  grey += wide;
  grey.convertTo(cored, CV_8U);
  return cored;
}

cv::Mat Sharpened(const cv::Mat& bytes) {
  cv::Mat wide, sharp;
  cv::GaussianBlur(bytes, wide, cv::Size(), 1);
  cv::addWeighted(bytes, 2, wide, -1, 0, sharp);
  return sharp;
}

cv::Mat Smoothed(const cv::Mat& bytes) {
  cv::Mat smooth;
  cv::GaussianBlur(bytes, smooth, cv::Size(), 0.7);
  return smooth;
}

template <int quality>
cv::Mat Compressed(const cv::Mat& bytes) {
  std::vector<unsigned char> file;
  cv::imencode(".jpg", bytes, file, {cv::IMWRITE_JPEG_QUALITY, quality});
  return cv::imdecode(file, cv::IMREAD_UNCHANGED);
}

ResponseScene Noisy() {
  ResponseScene scene;
  scene.noise = 0.012;
  scene.largest_sigma_px = 9;
  scene.frames = 21;
  scene.scale_step = 0.003;
  return scene;
}

TEST(Processing, AnUnprocessedCameraIsNotAccused) {
  const CameraResponse found = ResponseTo(Noisy(), &Unchanged);
  ASSERT_TRUE(found.weak_detail_loss && found.noise_rise && found.block_grid);
  EXPECT_NEAR(found.weak_detail_loss->value, 0, 4 * found.weak_detail_loss->sigma + 0.004);
  EXPECT_NEAR(found.noise_rise->value, 0, 0.15);
  EXPECT_NEAR(found.block_grid->value, 0, 0.1);
  EXPECT_FALSE(found.LosesWeakDetail() || found.IsSharpened() || found.IsCompressed());
}

TEST(Processing, NoiseReductionLosesWeakDetail) {
  const CameraResponse found = ResponseTo(Noisy(), &Denoised);
  EXPECT_TRUE(found.LosesWeakDetail());
  EXPECT_FALSE(found.IsSharpened() || found.IsCompressed());
}

TEST(Processing, SharpeningRaisesTheNoiseAndLosesNoDetail) {
  const CameraResponse found = ResponseTo(Noisy(), &Sharpened);
  EXPECT_TRUE(found.IsSharpened());
  EXPECT_FALSE(found.LosesWeakDetail() || found.IsCompressed());
}

// A lens, demosaicing and resampling smooth all detail alike.
TEST(Processing, SmoothingAlikeIsNoProcessing) {
  const CameraResponse found = ResponseTo(Noisy(), &Smoothed);
  if (found.noise_rise) {
    EXPECT_LT(found.noise_rise->value, 0);
  }
  EXPECT_FALSE(found.LosesWeakDetail() || found.IsSharpened() || found.IsCompressed());
}

// Frames that are clipped at these values; the clipping levels are stated or not.
CameraResponse ResponseToClipped(double darkest, double brightest, bool stated) {
  std::vector<cv::Mat> light;
  ResponseFrames frames = Noisy().Make(&light);
  for (cv::Mat& image : light)
    image = Rounded(cv::max(cv::min(image, brightest), darkest) - darkest, 255);
  for (ResponseFrame& frame : frames.frames) {
    if (!stated) continue;
    frame.darkest = 0.01;
    frame.brightest = brightest - darkest - 0.01;
  }
  ReadFrom(light, &frames);
  CameraResponse response;
  response.weak_detail_loss = MeasureWeakDetailLoss(frames, light.front().size());
  return response;
}

// Clipping removes the detail of dark or bright places. Where its levels are not stated, this looks
// like noise reduction.
TEST(Processing, ClippedPartsAreLeftOut) {
  for (const auto& [darkest, brightest] : {std::pair(0.2, 1.0), std::pair(0.0, 0.45)}) {
    SCOPED_TRACE(darkest);
    const auto not_stated = ResponseToClipped(darkest, brightest, false).weak_detail_loss;
    ASSERT_TRUE(not_stated);
    EXPECT_GT(not_stated->value, std::max(0.015, 3 * not_stated->sigma));
    const CameraResponse stated = ResponseToClipped(darkest, brightest, true);
    EXPECT_FALSE(stated.LosesWeakDetail());
    if (stated.weak_detail_loss) {
      EXPECT_LT(stated.weak_detail_loss->value, 2 * stated.weak_detail_loss->sigma);
    }
  }
}

// White noise through a separable kernel, a mean over `side` px and second differences at that
// spacing has the square of the sum of squares of the three kernels' convolution along an axis.
double PowerOfFiltered(const std::vector<double>& kernel, int side) {
  std::vector<double> taps(static_cast<std::size_t>(3 * side), 0);
  const double differences[] = {1 / std::sqrt(6.0), -2 / std::sqrt(6.0), 1 / std::sqrt(6.0)};
  for (int block = 0; block < 3; ++block) {
    for (int i = 0; i < side; ++i)
      taps[static_cast<std::size_t>(block * side + i)] = differences[block] / side;
  }
  double sum = 0;
  for (int at = 0; at < 3 * side + static_cast<int>(kernel.size()) - 1; ++at) {
    double value = 0;
    for (int k = 0; k < static_cast<int>(kernel.size()); ++k) {
      if (at - k >= 0 && at - k < 3 * side)
        value += kernel[static_cast<std::size_t>(k)] * taps[static_cast<std::size_t>(at - k)];
    }
    sum += value * value;
  }
  return side * side * sum * sum;
}

TEST(Processing, SmoothnessIsThatOfTheFilter) {
  for (const double sigma_px : {0.3, 0.6, 1.0}) {
    const cv::Mat column = cv::getGaussianKernel(9, sigma_px, CV_64F);
    const std::vector<double> kernel(column.begin<double>(), column.end<double>());
    std::vector<cv::Mat> light;
    cv::RNG random(7);
    ResponseFrames frames;
    for (std::size_t i = 0; i < 5; ++i) {
      cv::Mat image(400, 420, CV_32F);
      random.fill(image, cv::RNG::NORMAL, 0.5, 0.01);
      cv::sepFilter2D(image, image, CV_32F, column, column);
      light.push_back(image);
      frames.frames.push_back({i, {}, 100});
    }
    frames.centre = {209.5, 199.5};
    ReadFrom(light, &frames);
    const auto found = MeasureNoiseSmoothness(frames, light.front().size(), 0);
    ASSERT_TRUE(found);
    EXPECT_NEAR(found->value, PowerOfFiltered(kernel, 2) / PowerOfFiltered(kernel, 4),
                4 * found->sigma);
    EXPECT_LT(found->sigma, 0.02);
    // Rounding that hides the noise.
    EXPECT_FALSE(MeasureNoiseSmoothness(frames, light.front().size(), 0.1));
  }
}

TEST(Processing, StrongCompressionShowsItsBlocks) {
  EXPECT_TRUE(ResponseTo(Noisy(), &Compressed<15>).IsCompressed());
  EXPECT_FALSE(ResponseTo(Noisy(), &Compressed<95>).IsCompressed());
}

TEST(ProcessingSlow, NoGoodFramesAreAccused) {
  int accused = 0;
  for (std::uint64_t seed = 200; seed < 240; ++seed) {
    ResponseScene scene = Noisy();
    scene.seed = seed;
    scene.noise = 0.003 * static_cast<double>(1 + seed % 5);
    scene.smallest_disc_px = 1 + 0.5 * static_cast<double>(seed % 4);
    const CameraResponse found = ResponseTo(scene, seed % 2 == 0 ? &Unchanged : &Smoothed);
    accused += found.LosesWeakDetail() || found.IsSharpened() || found.IsCompressed() ? 1 : 0;
  }
  EXPECT_EQ(accused, 0);
}

}  // namespace
}  // namespace thicklens::calib

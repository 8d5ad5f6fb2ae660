// The exponent of the light by energy conservation, on frames that were made without the project's
// simulator.
#include "calib/response/light_exponent.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/calib/response/response_scene.h"
#include "thicklens/calib/camera_response.h"

namespace thicklens::calib {
namespace {

using thicklens::testing::ReadFrom;
using thicklens::testing::ResponseScene;
using thicklens::testing::Rounded;

// The exponent of frames whose values are light^(1/gamma) in 8 bits.
std::optional<model::Estimate> ExponentOf(const ResponseScene& scene, double gamma) {
  std::vector<cv::Mat> light;
  ResponseFrames frames = scene.Make(&light);
  for (cv::Mat& image : light) {
    cv::Mat stored;
    cv::pow(image, 1 / gamma, stored);
    image = Rounded(stored, 255);
  }
  ReadFrom(light, &frames);
  return MeasureLightExponent(frames, light.front().size());
}

TEST(LightExponent, IsOneInLinearLight) {
  const auto found = ExponentOf({}, 1);
  ASSERT_TRUE(found);
  EXPECT_LT(found->sigma, 0.05);
  EXPECT_NEAR(found->value, 1, 4 * found->sigma + 0.02);
}

TEST(LightExponent, IsThePowerOfTheValues) {
  for (const double gamma : {0.45, 0.7, 1.5, 2.2}) {
    const auto found = ExponentOf({}, gamma);
    ASSERT_TRUE(found) << gamma;
    EXPECT_NEAR(std::log(found->value / gamma), 0, 4 * found->sigma / found->value + 0.03) << gamma;
    EXPECT_LT(found->sigma / found->value, 0.06) << gamma;
  }
}

// Other changes of the mean of a window do not look like a power.
TEST(LightExponent, IsNotMovedByBlackLevelVignettingOrNoise) {
  ResponseScene scene;
  scene.black_level = 0.06;
  scene.vignetting = 0.4;
  scene.noise = 0.02;
  const auto found = ExponentOf(scene, 1);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->value, 1, 4 * found->sigma + 0.05);
}

TEST(LightExponent, OfADiscIsOne) {
  ResponseScene scene;
  scene.psf = model::Psf::kDisc;
  const auto found = ExponentOf(scene, 1);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->value, 1, 4 * found->sigma + 0.05);
}

// Clipping lowers the mean of what is sharp and bright. Stated clipping levels leave it out.
TEST(LightExponent, LeavesOutWhatIsClipped) {
  std::vector<cv::Mat> light;
  ResponseFrames frames = ResponseScene().Make(&light);
  constexpr double kClipped = 0.68;
  for (cv::Mat& image : light) image = cv::min(image, kClipped);
  for (ResponseFrame& frame : frames.frames) frame.brightest = kClipped - 0.01;
  ReadFrom(light, &frames);
  const auto found = MeasureLightExponent(frames, light.front().size());
  // So many windows may be clipped that nothing is left, but nothing wrong is found.
  if (found) {
    EXPECT_NEAR(found->value, 1, 4 * found->sigma + 0.05);
  }
}

// The part of a line sensor is wide and low: it has more windows than OpenCV maps at once.
TEST(LightExponent, AWideLowPartCanBeMeasured) {
  ResponseScene scene;
  scene.width_px = 520;
  scene.height_px = 100;
  scene.largest_sigma_px = 5;
  const auto found = ExponentOf(scene, 1);
  if (found) {
    EXPECT_NEAR(found->value, 1, 4 * found->sigma + 0.05);
  }
}

TEST(LightExponent, FlatOrFewFramesGiveNothing) {
  std::vector<cv::Mat> light;
  ResponseFrames frames = ResponseScene().Make(&light);
  for (cv::Mat& image : light) image.setTo(0.5);
  ReadFrom(light, &frames);
  EXPECT_FALSE(MeasureLightExponent(frames, light.front().size()));
  frames.frames.resize(3);
  EXPECT_FALSE(MeasureLightExponent(frames, light.front().size()));
}

// Repeats with other textures and noise: the stated sigma is the scatter, and no good sweep is
// accused.
TEST(LightExponentSlow, SigmaIsTheScatterAndNoGoodFrameIsAccused) {
  double squares = 0, stated = 0;
  int accused = 0;
  constexpr int kRepeats = 60;
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    ResponseScene scene;
    scene.seed = 100 + static_cast<std::uint64_t>(repeat);
    scene.noise = 0.002 * (1 + repeat % 5);
    scene.smallest_disc_px = 1 + 0.5 * (repeat % 4);
    const auto found = ExponentOf(scene, 1);
    ASSERT_TRUE(found) << repeat;
    squares += std::pow(found->value - 1, 2) / kRepeats;
    stated += found->sigma * found->sigma / kRepeats;
    CameraResponse response;
    response.light_exponent = found;
    accused += response.ContradictsTransfer() ? 1 : 0;
  }
  const double ratio = std::sqrt(squares / stated);
  RecordProperty("scatter_over_sigma", std::to_string(ratio));
  EXPECT_GT(ratio, 0.5);
  EXPECT_LT(ratio, 1.6);
  EXPECT_EQ(accused, 0);
}

}  // namespace
}  // namespace thicklens::calib

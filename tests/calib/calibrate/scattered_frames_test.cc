// Frames that do not show what the others show are left out, and no others: neither a frame of a
// large or a quiet sensor, in whose little noise every small error of the blur law stands out.
#include <gtest/gtest.h>

#include <cstddef>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "tests/calib/calibrated_sweep.h"
#include "tests/calib/damaged_sweep.h"
#include "thicklens/calib/calibrate.h"

namespace thicklens::calib {
namespace {

using namespace thicklens::testing;

// The sweep whose calibration is measured in time and memory, on a smaller sensor. Without noise
// and with 16 bits, the errors of the blur law are as visible as in frames of hundreds of
// megapixels.
SimulatedSweep Sweep(int width_px, bool with_noise) {
  const int height_px = width_px * 3 / 4;
  model::SweepSimulationOptions options =
      model::ReadSweepSimulation(THICKLENS_SOURCE_DIR "/configs/sweeps/twelve-megapixels.yaml");
  options.camera.sensor.width_px = width_px;
  options.camera.sensor.height_px = height_px;
  options.camera.sensor.principal_point_px = {0.5 * (width_px - 1), 0.5 * (height_px - 1)};
  if (!with_noise) {
    options.full_well_electrons = options.read_noise_electrons = 0;
    options.bits = 16;
  }
  return Simulate(options);
}

constexpr int kWidthPx = 288;

// Rendered once, by the noise.
const SimulatedSweep& Clean(bool with_noise) {
  static const SimulatedSweep noisy = Sweep(kWidthPx, true), quiet = Sweep(kWidthPx, false);
  return with_noise ? noisy : quiet;
}

void ExpectNoFrameLost(const SimulatedSweep& sweep) {
  const Calibration c = CalibrateWithoutMap(sweep);
  ASSERT_TRUE(c.summary.focus_depth_mm) << c.summary.reason;
  for (const FrameMeasurement& frame : c.frames) EXPECT_EQ(frame.rejection, "") << frame.image;
  EXPECT_EQ(c.summary.frames_used, 15);
  EXPECT_NEAR(c.summary.blur_ratio->value, sweep.truth.blur_ratio, 0.003);
}

TEST(ScatteredFrames, ACleanSweepLosesNone) { ExpectNoFrameLost(Clean(true)); }
TEST(ScatteredFrames, ACleanSweepWithoutNoiseLosesNone) { ExpectNoFrameLost(Clean(false)); }
TEST(ScatteredFrames, ALargerCleanSweepWithoutNoiseLosesNone) {
  ExpectNoFrameLost(Sweep(kWidthPx * 3 / 2, false));
}

class DamagedFrame : public ::testing::TestWithParam<bool> {
 protected:
  static constexpr std::size_t kFrame = 9;

  SimulatedSweep Copy() const { return DeepCopy(Clean(GetParam())); }

  // Expects that the damage of one frame is found, and that the result is right without it.
  static void ExpectFound(const SimulatedSweep& damaged) {
    const Calibration c = CalibrateWithoutMap(damaged);
    ASSERT_TRUE(c.summary.blur_ratio) << c.summary.reason;
    EXPECT_NE(c.frames[kFrame].rejection, "");
    EXPECT_EQ(c.summary.frames_used, 14);
    EXPECT_NEAR(c.summary.blur_ratio->value, damaged.truth.blur_ratio, 0.003);
  }
};

TEST_P(DamagedFrame, OfAnotherPartOfTheTargetIsLeftOut) {
  SimulatedSweep sweep = Copy();
  cv::flip(sweep.frame(kFrame), sweep.frame(kFrame), -1);
  ExpectFound(sweep);
}

TEST_P(DamagedFrame, WithAHandInViewIsLeftOut) {
  SimulatedSweep sweep = Copy();
  cv::Mat& frame = sweep.frame(kFrame);
  cv::Mat hand = cv::Mat::zeros(frame.size(), CV_32F), seen;
  cv::ellipse(hand, cv::Point(200, 150), cv::Size(70, 50), 30, 0, 360, cv::Scalar(1), cv::FILLED);
  cv::GaussianBlur(hand, hand, cv::Size(), 10);
  frame.convertTo(seen, CV_32F);
  seen = seen.mul(1 - hand) + 0.5 * cv::mean(seen)[0] * hand;
  seen.convertTo(frame, frame.depth());
  ExpectFound(sweep);
}

TEST_P(DamagedFrame, ThatIsSmearedIsLeftOut) {
  SimulatedSweep sweep = Copy();
  cv::blur(sweep.frame(kFrame), sweep.frame(kFrame), cv::Size(15, 1));
  ExpectFound(sweep);
}

INSTANTIATE_TEST_SUITE_P(WithAndWithoutNoise, DamagedFrame, ::testing::Bool());

}  // namespace
}  // namespace thicklens::calib

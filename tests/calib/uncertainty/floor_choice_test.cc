#include "calib/uncertainty/floor_choice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/calib/known_texture.h"
#include "tests/calib/simulated_sweep.h"
#include "thicklens/calib/calibrate.h"

namespace thicklens::calib {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

constexpr int kSize = 160;
constexpr double kNoise = 5e-5;

// A blur estimator of one frame, which shows a texture whose power decreases with frequency through
// a Gaussian of `blur_px`.
struct OneFrame {
  SpectralEstimatorSetup estimator;
  EstimatorRegion region;
};

OneFrame Photograph(double blur_px, double highest = 0.4, unsigned seed = 5) {
  const Eigen::Vector2d middle(0.5 * (kSize - 1), 0.5 * (kSize - 1));
  const testing::KnownTexture texture(seed, highest, 3000);
  const cv::Mat grey = testing::WithWhiteNoise(
      texture.Render(kSize, kSize, middle, {}, testing::GaussianOf(blur_px * blur_px)), kNoise, 8);
  OneFrame one;
  one.estimator.origin_px = middle;
  one.estimator.size_px.setConstant(kSize);
  one.estimator.frames.resize(1);
  one.estimator.frames[0].pixel_noise = kNoise;
  one.estimator.read_grey = [grey](std::size_t) { return grey; };
  one.region.window.size_px.setConstant(0.98 * (kSize - 1));
  one.region.samples.resize(1);
  return one;
}

double BoundPx(const OneFrame& one) {
  return std::sqrt(LargestBlurVariance(one.estimator, one.region).value());
}

TEST(LargestBlurVariance, IsNotBelowTheBlurOfATextureWhosePowerFalls) {
  for (const double blur_px : {0.5, 1.0, 1.6, 2.2}) {
    const double bound_px = BoundPx(Photograph(blur_px));
    EXPECT_GT(bound_px, blur_px);
    EXPECT_LT(bound_px, blur_px + 0.9) << "of " << blur_px;
  }
}

TEST(LargestBlurVariance, IsLargeWhereTheTextureHasNoFineDetail) {
  // There is no power above 0.06 cycles/px, so a lens far softer than any real one could have taken
  // the frame.
  const auto bound =
      LargestBlurVariance(Photograph(0.4, 0.06).estimator, Photograph(0.4, 0.06).region);
  ASSERT_TRUE(bound);
  EXPECT_GT(std::sqrt(*bound), 1.3);
}

TEST(LargestBlurVariance, SaysNothingOfNoiseAlone) {
  OneFrame one = Photograph(1);
  const cv::Mat flat =
      testing::WithWhiteNoise(cv::Mat(kSize, kSize, CV_32F, cv::Scalar(0.4)), kNoise, 3);
  one.estimator.read_grey = [flat](std::size_t) { return flat; };
  EXPECT_FALSE(LargestBlurVariance(one.estimator, one.region));
  one.estimator.read_grey = nullptr;
  EXPECT_FALSE(LargestBlurVariance(one.estimator, one.region));
}

TEST(ChooseFloor, TakesWhatIsStated) {
  BlurEvidence evidence;
  std::vector<std::string> warnings;
  model::FloorKnowledge known;
  known.given_px = model::Estimate{0.6, 0.05};
  FloorChoice choice = ChooseFloor(known, evidence, &warnings);
  EXPECT_DOUBLE_EQ(choice.variance_px2->value, 0.36);
  EXPECT_NEAR(choice.variance_px2->sigma, 0.0602, 1e-4);
  EXPECT_FALSE(choice.interval_px2);
  // For a floor that may be 0, the error is that of the square.
  known.given_px = model::Estimate{0, 0.3};
  EXPECT_NEAR(ChooseFloor(known, evidence, &warnings).variance_px2->sigma, 0.1273, 1e-4);
  known = {};
  known.from_px = 0.3;
  known.to_px = 0.7;
  choice = ChooseFloor(known, evidence, &warnings);
  EXPECT_NEAR((*choice.interval_px2)[0], 0.09, 1e-12);
  EXPECT_NEAR((*choice.interval_px2)[1], 0.49, 1e-12);
  EXPECT_NEAR(choice.variance_px2->value, 0.29, 1e-12);
  EXPECT_TRUE(warnings.empty());
}

// The interval that is assumed of a lens is in pixels of the sensor, of which a frame may have
// half.
TEST(ChooseFloor, AnUnstatedFloorIsInPixelsOfTheSensor) {
  const BlurEvidence evidence;
  std::vector<std::string> warnings;
  const FloorChoice whole = ChooseFloor({}, evidence, &warnings);
  const FloorChoice half = ChooseFloor({}, evidence, &warnings, 2);
  ASSERT_TRUE(whole.interval_px2 && half.interval_px2);
  EXPECT_DOUBLE_EQ((*half.interval_px2)[1], (*whole.interval_px2)[1] / 4);
  ASSERT_EQ(warnings.size(), 2U);
  EXPECT_EQ(warnings[0], warnings[1]);
}

TEST(ChooseFloor, ASofterLensThanUsualIsAllowedForWhereTheTextureDoesNotExcludeIt) {
  for (const double floor_px : {0.5, 1.7}) {
    model::SweepSimulationOptions options = testing::SweepCase("iv", 128, 32);
    options.target.kind = model::TargetKind::kDeadLeaves;
    options.camera.calibration->blur_floor_px = model::Estimate{floor_px, 0};
    const testing::SimulatedSweep simulated = testing::Simulate(options);
    CalibrationOptions how;
    how.map_field = false;
    const Calibration c = Calibrate(simulated.sweep, how);
    ASSERT_TRUE(c.summary.focus_depth_mm) << c.summary.reason;
    const Eigen::Vector2d zf = *c.summary.focus_depth_mm->systematic;
    EXPECT_LT(zf[0] - 2 * c.summary.focus_depth_mm->sigma, simulated.truth.focus_depth_mm)
        << floor_px;
    EXPECT_GT(zf[1] + 2 * c.summary.focus_depth_mm->sigma, simulated.truth.focus_depth_mm)
        << floor_px;
    EXPECT_GE((*c.summary.blur_floor_px->systematic)[1], std::max(1.0, floor_px));
    EXPECT_THAT(c.summary.warnings,
                Contains(HasSubstr("this target does not determine the blur floor")));
  }
}

}  // namespace
}  // namespace thicklens::calib

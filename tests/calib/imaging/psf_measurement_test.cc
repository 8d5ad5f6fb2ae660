#include "thicklens/calib/psf_measurement.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "calib/imaging/painted_sweep.h"
#include "support/error_message.h"

namespace thicklens::calib {
namespace {

using ::testing::HasSubstr;

using thicklens::testing::ApertureLight;
using thicklens::testing::ErrorOf;
using thicklens::testing::Paint;
using thicklens::testing::PaintedMoments;
using thicklens::testing::PaintedOptions;
using thicklens::testing::PaintedSweep;

// A disc of which a chord is cut off on the right: its light is not symmetric about its middle. The
// place of its centroid is subtracted.
constexpr double kCatEyeCentre = -0.1946;
double CatEye(double x, double y) {
  const double u = x + kCatEyeCentre;
  return u * u + y * y <= 1 && u < 0.45 ? 1 : 0;
}

double Hexagon(double x, double y) {
  const double u = std::abs(x), v = std::abs(y);
  return v <= std::sqrt(0.75) && std::sqrt(0.75) * u + v / 2 <= std::sqrt(0.75) ? 1 : 0;
}

double BlurRatioOf(const ApertureLight& light) {
  const cv::Vec2d moments = PaintedMoments(light);
  return std::sqrt((moments[0] + moments[1]) / 2);
}

PaintedOptions Sweep(double blur_ratio, unsigned seed) {
  PaintedOptions options;
  options.size_px = 220;
  options.blur_ratio = blur_ratio;
  options.seed = seed;
  options.depths_mm = {384, 388, 391.5, 400, 409, 412.5, 417};
  return options;
}

// Truth of a cell: the mean of the shape over it, by points.
Eigen::ArrayXXd TrueLight(const model::MeasuredPsf& psf, const ApertureLight& light) {
  const Eigen::Index side = psf.light.rows();
  Eigen::ArrayXXd truth = Eigen::ArrayXXd::Zero(side, side);
  constexpr int kFine = 9;
  for (Eigen::Index j = 0; j < side * kFine; ++j) {
    for (Eigen::Index i = 0; i < side * kFine; ++i) {
      const auto at = [&](Eigen::Index k) {
        return ((static_cast<double>(k) + 0.5) / kFine - static_cast<double>(side) / 2) * psf.step;
      };
      truth(j / kFine, i / kFine) += light(at(i), at(j));
    }
  }
  return truth / truth.sum();
}

double Correlation(const Eigen::ArrayXXd& a, const Eigen::ArrayXXd& b) {
  const Eigen::ArrayXXd x = a - a.mean(), y = b - b.mean();
  return (x * y).sum() / std::sqrt(x.square().sum() * y.square().sum());
}

// Its orientation is that of points beyond the plane of focus, and near and far frames agree.
TEST(PsfMeasurement, FindsACutOffAperture) {
  const cv::Vec2d moments = PaintedMoments(CatEye);
  const double kappa = BlurRatioOf(CatEye);
  const PaintedSweep painted = Paint(Sweep(kappa, 3), CatEye);
  PsfOptions options;
  options.side = 15;
  const PsfMeasurement found = MeasurePsf(painted.sweep, painted.calibration, options);
  ASSERT_TRUE(found.done) << found.message;
  EXPECT_EQ(found.nearer, 3);
  EXPECT_EQ(found.farther, 3);
  EXPECT_NEAR(found.psf.BlurRatio(), kappa, 1e-9);
  EXPECT_LT(found.psf.Centroid().norm(), 0.01);
  const Eigen::ArrayXXd truth = TrueLight(found.psf, CatEye);
  const double correlation = Correlation(found.psf.light, truth);
  EXPECT_GT(correlation, 0.93);
  EXPECT_GT(correlation, Correlation(found.psf.light.rowwise().reverse(), truth) + 0.05);
  EXPECT_NEAR(found.sigma_x_ratio / found.sigma_y_ratio, std::sqrt(moments[0] / moments[1]), 0.03);
  // A disc of the same blur describes it worse.
  const Eigen::ArrayXXd disc = TrueLight(
      found.psf, [&](double x, double y) { return std::hypot(x, y) <= 2 * kappa ? 1 : 0; });
  EXPECT_LT((found.psf.light - truth).abs().sum(), 0.7 * (disc - truth).abs().sum());
  EXPECT_LT((found.psf.light - truth).abs().sum(), 0.2);
}

TEST(PsfMeasurement, FindsAHexagon) {
  const cv::Vec2d moments = PaintedMoments(Hexagon);
  const double kappa = BlurRatioOf(Hexagon);
  const PaintedSweep painted = Paint(Sweep(kappa, 4), Hexagon);
  PsfOptions options;
  options.side = 15;
  const PsfMeasurement found = MeasurePsf(painted.sweep, painted.calibration, options);
  ASSERT_TRUE(found.done) << found.message;
  EXPECT_GT(Correlation(found.psf.light, TrueLight(found.psf, Hexagon)), 0.9);
  EXPECT_NEAR(found.sigma_x_ratio / found.sigma_y_ratio, std::sqrt(moments[0] / moments[1]), 0.03);
}

// The errors are those of the scatter of measurements whose noise differs.
TEST(PsfMeasurement, ErrorsAreTheScatterOfNoisySweeps) {
  constexpr int kRuns = 6;
  PaintedOptions sweep = Sweep(0.5, 5);
  sweep.size_px = 180;
  sweep.noise = 0;
  const auto disc = [](double x, double y) { return x * x + y * y <= 1 ? 1.0 : 0.0; };
  PaintedSweep painted = Paint(sweep, disc);
  const std::vector<cv::Mat> clean = *painted.stored;
  PsfOptions options;
  options.side = 9;
  Eigen::ArrayXXd sum = Eigen::ArrayXXd::Zero(9, 9), square = sum, predicted = sum;
  cv::RNG random(11);
  for (int run = 0; run < kRuns; ++run) {
    for (std::size_t i = 0; i < clean.size(); ++i) {
      cv::Mat noise(clean[i].size(), CV_32F), noisy;
      random.fill(noise, cv::RNG::NORMAL, 0, 0.02 * 65535);
      clean[i].convertTo(noisy, CV_32F);
      noisy += noise;
      noisy.convertTo(painted.stored->at(i), CV_16U);
    }
    const PsfMeasurement found = MeasurePsf(painted.sweep, painted.calibration, options);
    ASSERT_TRUE(found.done) << found.message;
    sum += found.psf.light / kRuns;
    square += found.psf.light.square() / kRuns;
    predicted += found.psf.sigma / kRuns;
  }
  const Eigen::ArrayXXd scatter = ((square - sum.square()) * kRuns / (kRuns - 1.0)).max(0).sqrt();
  const double ratio = std::sqrt(predicted.block(2, 2, 5, 5).square().mean() /
                                 scatter.block(2, 2, 5, 5).square().mean());
  // The noise of the one sharp frame is common to all equations, whose scatter does not show it.
  EXPECT_GT(ratio, 0.4);
  EXPECT_LT(ratio, 2.5);
}

TEST(PsfMeasurement, SaysWhyThereIsNone) {
  PaintedOptions sweep = Sweep(0.5, 6);
  sweep.size_px = 120;
  sweep.depths_mm = {399, 400, 401};
  PaintedSweep painted =
      Paint(sweep, [](double x, double y) { return x * x + y * y <= 1 ? 1.0 : 0.0; });
  const PsfMeasurement found = MeasurePsf(painted.sweep, painted.calibration, {});
  EXPECT_FALSE(found.done);
  EXPECT_THAT(found.message, HasSubstr("the sweep should reach farther from focus"));
  painted.calibration.diagnostics.blur.done = false;
  EXPECT_THAT(MeasurePsf(painted.sweep, painted.calibration, {}).message, HasSubstr("no blur law"));
  PsfOptions wrong;
  wrong.side = 8;
  EXPECT_THAT(ErrorOf([&] { MeasurePsf(painted.sweep, painted.calibration, wrong); }),
              HasSubstr("side is 8: an odd number"));
}

}  // namespace
}  // namespace thicklens::calib

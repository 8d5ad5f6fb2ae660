#include "thicklens/model/measured_aperture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "support/error_message.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;

using thicklens::testing::ErrorOf;

constexpr double kRadiusMm = 5;
constexpr int kFine = 20;  // points of a cell along each axis

// Shares of a shape, by the points of each cell that lie inside.
template <class Shape>
MeasuredPsf PsfOf(int side, double reach, const Shape& density) {
  MeasuredPsf psf;
  psf.step = 2 * reach / side;
  psf.light = Eigen::ArrayXXd::Zero(side, side);
  for (int j = 0; j < side * kFine; ++j) {
    for (int i = 0; i < side * kFine; ++i) {
      const double x = ((i + 0.5) / kFine - side / 2.0) * psf.step;
      const double y = ((j + 0.5) / kFine - side / 2.0) * psf.step;
      psf.light(j / kFine, i / kFine) += density(x, y);
    }
  }
  return Normalised(psf);
}

// Second moment of the samples about their centroid, mm^2.
double Moment(const ApertureSamples& samples, bool along_u) {
  double sum = 0, first = 0, second = 0;
  for (int l = 0; l < samples.v_count; ++l) {
    for (int k = 0; k < samples.u_count; ++k) {
      const double a = along_u ? samples.u_offset(k) * samples.u_step_mm
                               : samples.v_offset(l) * samples.v_step_mm;
      sum += samples.weights(l, k);
      first += samples.weights(l, k) * a;
      second += samples.weights(l, k) * a * a;
    }
  }
  return second / sum - std::pow(first / sum, 2);
}

// A measured disc has nearly the views of the disc: the same steps, and weights that differ at its
// rim alone, where a view's cell is partly inside.
TEST(MeasuredAperture, OfADiscAndOfAGaussianIsNearlyThatOfTheShape) {
  for (const Psf shape : {Psf::kDisc, Psf::kGaussian}) {
    const double kappa = 0.5;
    const MeasuredPsf psf = PsfOf(41, 4 * kappa, [&](double x, double y) {
      return ApertureTransmission(shape, kappa, 1, {x, y});
    });
    EXPECT_NEAR(psf.BlurRatio(), kappa, 0.005);
    for (const int views : {5, 7, 9}) {
      const ApertureSamples of_shape = SampleAperture(shape, kappa, kRadiusMm, views, views);
      const ApertureSamples measured = SampleAperture(psf, kappa, kRadiusMm, views, views);
      EXPECT_NEAR(measured.u_step_mm / of_shape.u_step_mm, 1, 0.04) << views;
      EXPECT_NEAR(measured.v_step_mm, measured.u_step_mm, 1e-9);
      const double middle = of_shape.weights(views / 2, views / 2);
      EXPECT_NEAR(measured.weights(views / 2, views / 2) / middle, 1, 0.12) << views;
      EXPECT_LT((measured.weights - of_shape.weights).abs().sum(),
                shape == Psf::kDisc ? 0.35 : 0.06)
          << views;
    }
  }
}

// The steps give exactly the calibrated blur; of a shape that is wider along one axis, the mean of
// both axes has it, and their ratio is that of the shape.
TEST(MeasuredAperture, HasTheCalibratedBlur) {
  const double kappa = 0.45;
  const MeasuredPsf psf =
      PsfOf(31, 1.6, [](double x, double y) { return x * x / 1.2 + y * y / 0.5 <= 1 ? 1.0 : 0.0; });
  const ApertureSamples samples = SampleAperture(psf, kappa, kRadiusMm, 9, 7);
  EXPECT_EQ(samples.weights.rows(), 7);
  EXPECT_EQ(samples.weights.cols(), 9);
  EXPECT_NEAR(samples.weights.sum(), 1, 1e-12);
  EXPECT_NEAR((Moment(samples, true) + Moment(samples, false)) / 2, std::pow(kappa * kRadiusMm, 2),
              1e-9);
  EXPECT_NEAR(std::sqrt(Moment(samples, true) / Moment(samples, false)), std::sqrt(1.2 / 0.5),
              0.01);
}

// The light on one side of the shape is on the same side of the views: x to the right, y down.
TEST(MeasuredAperture, HasTheOrientationOfTheScene) {
  const MeasuredPsf psf = PsfOf(31, 1.6, [](double x, double y) {
    return x * x + y * y <= 1 ? 1 + 0.6 * x * x * x + 0.3 * y * y * y - 0.36 * x - 0.18 * y : 0.0;
  });
  const ApertureSamples samples = SampleAperture(psf, 0.5, kRadiusMm, 7, 7);
  EXPECT_GT(samples.weights(3, 6), 1.05 * samples.weights(3, 0));
  EXPECT_GT(samples.weights(6, 3), 1.02 * samples.weights(0, 3));
}

TEST(MeasuredAperture, RefusesWhatIsNoShape) {
  MeasuredPsf psf;
  psf.step = 0.5;
  psf.light = Eigen::ArrayXXd::Constant(3, 3, 1.0 / 9);
  EXPECT_THAT(ErrorOf([&] { SampleAperture(psf, 0.5, 1, 0, 7); }), HasSubstr("views are 0x7"));
  EXPECT_THAT(ErrorOf([&] { SampleAperture(psf, -1, 1, 7, 7); }), HasSubstr("blur_ratio"));
  psf.light(0, 0) = -1;
  EXPECT_THAT(ErrorOf([&] { SampleAperture(psf, 0.5, 1, 7, 7); }),
              HasSubstr("measured PSF: light in row 1"));
}

}  // namespace
}  // namespace thicklens::model

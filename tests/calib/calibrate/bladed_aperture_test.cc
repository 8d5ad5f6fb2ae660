// Calibrations of sweeps through an aperture of blades.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/calib/simulated_sweep.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/psf_measurement.h"
#include "thicklens/model/light_field.h"

namespace thicklens::calib {
namespace {

// Correlation of a PSF with a hexagon of its sigma that has a corner at an angle.
double LikenessToHexagon(const model::MeasuredPsf& psf, double corner_deg) {
  constexpr double kDegree = 3.14159265358979 / 180;
  const double radius = psf.BlurRatio() / std::sqrt(5.0 / 24);
  Eigen::ArrayXXd hexagon = Eigen::ArrayXXd::Zero(psf.light.rows(), psf.light.cols());
  constexpr int kFine = 8;
  for (Eigen::Index j = 0; j < kFine * hexagon.rows(); ++j) {
    for (Eigen::Index i = 0; i < kFine * hexagon.cols(); ++i) {
      const auto place = [&](Eigen::Index k, Eigen::Index cells) {
        return ((static_cast<double>(k) + 0.5) / kFine - static_cast<double>(cells) / 2) * psf.step;
      };
      const double x = place(i, hexagon.cols()), y = place(j, hexagon.rows());
      bool is_inside = true;
      for (int side = 0; side < 6; ++side) {
        const double angle = (corner_deg + 30 + 60 * side) * kDegree;
        if (x * std::cos(angle) + y * std::sin(angle) > std::sqrt(0.75) * radius) is_inside = false;
      }
      if (is_inside) hexagon(j / kFine, i / kFine) += 1;
    }
  }
  const auto centred = [](const Eigen::ArrayXXd& of) { return (of - of.mean()).eval(); };
  const Eigen::ArrayXXd a = centred(psf.light), b = centred(hexagon);
  return (a * b).sum() / std::sqrt(a.square().sum() * b.square().sum());
}

// kappa is the sigma of the light over r: sqrt(5/24) for a hexagon in the circle of radius r. The
// measured shape is that hexagon in its own direction.
TEST(BladedAperture, AHexagonHasItsRatioInClosedFormAndItsShape) {
  model::SweepSimulationOptions options = testing::SweepCase("ii", 0, 1);
  options.camera = model::CropCamera(options.camera, {126, 126, 220, 220});
  options.bits = 16;
  options.camera.psf = model::Psf::kDisc;
  options.camera.calibration->blur_ratio = model::Estimate{std::sqrt(5.0 / 24), 0};
  options.pupil_law = model::PupilLaw::kUniform;
  options.aperture.blades = 6;
  options.aperture.rotation_deg = 10;
  testing::SimulatedSweep simulated = testing::Simulate(options);
  testing::GiveFloor(&simulated);
  CalibrationOptions how;
  how.map_field = false;
  const Calibration found = Calibrate(simulated.sweep, how);
  ASSERT_TRUE(found.summary.blur_ratio) << found.summary.reason;
  const Result& ratio = *found.summary.blur_ratio;
  EXPECT_NEAR(ratio.value, std::sqrt(5.0 / 24), 4 * ratio.sigma);
  EXPECT_LT(ratio.sigma, 0.005 * ratio.value);
  EXPECT_NEAR(found.summary.focus_depth_mm->value, simulated.truth.focus_depth_mm,
              4 * found.summary.focus_depth_mm->sigma);
  const PsfMeasurement measured = MeasurePsf(simulated.sweep, found, {});
  ASSERT_TRUE(measured.done) << measured.message;
  EXPECT_GT(LikenessToHexagon(measured.psf, 10), 0.9);
  EXPECT_GT(LikenessToHexagon(measured.psf, 10), LikenessToHexagon(measured.psf, 40) + 0.03);
}

}  // namespace
}  // namespace thicklens::calib

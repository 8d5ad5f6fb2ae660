// The astigmatism over the field: its law against simulated foci of tiles, and the whole
// measurement against sweeps of lenses whose aberrations are known.
#include "calib/uncertainty/field_astigmatism.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "tests/calib/simulated_sweep.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/model/lens_aberrations.h"
#include "thicklens/model/light_field.h"

namespace thicklens::calib {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using thicklens::testing::GiveFloor;
using thicklens::testing::Simulate;
using thicklens::testing::SimulatedSweep;
using thicklens::testing::SweepCase;

constexpr double kCornerPx = 200;

// Foci of 5 x 5 tiles by the displacement matrix of the lens, along the radius and along the
// tangent.
std::vector<TileFoci> TilesOf(const model::LensAberrations& aberrations, double sigma_mm,
                              std::mt19937* random) {
  std::normal_distribution<double> normal;
  std::vector<TileFoci> tiles;
  for (const double x_px : {-110.0, -50.0, 0.0, 60.0, 120.0}) {
    for (const double y_px : {-80.0, -35.0, 0.0, 40.0, 85.0}) {
      TileFoci tile;
      tile.from_axis_px = {x_px, y_px};
      const Eigen::Matrix2d delta =
          model::FocusDisplacement(aberrations, 300, tile.from_axis_px, kCornerPx);
      const double azimuth = std::atan2(y_px, x_px);
      const Eigen::Vector2d radius(std::cos(azimuth), std::sin(azimuth));
      const Eigen::Vector2d tangent(-radius.y(), radius.x());
      const auto focus_mm = [&](const Eigen::Vector2d& n) {
        return 1 / (1.0 / 300 + n.dot(delta * n));
      };
      tile.difference_mm = {focus_mm(tangent) - focus_mm(radius) + sigma_mm * normal(*random),
                            std::max(sigma_mm, 1e-3)};
      tiles.push_back(tile);
    }
  }
  return tiles;
}

TEST(FieldAstigmatism, SeparatesTheFieldFromAConstantPart) {
  model::LensAberrations aberrations;
  aberrations.field_astigmatism_mm = 4;
  aberrations.astigmatism_mm = -2.5;
  aberrations.field_curvature_mm = 1;  // displaces both foci alike
  std::mt19937 random(1);
  const auto found = FitFieldAstigmatism(TilesOf(aberrations, 0, &random), kCornerPx, {0, 0});
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->at_corner_mm.value, 4, 0.05);
  EXPECT_NEAR(found->along_x_mm.value, -2.5, 0.05);
}

// The covariance is the scatter of 400 noisy fields.
TEST(FieldAstigmatism, SigmaIsTheScatter) {
  model::LensAberrations aberrations;
  aberrations.field_astigmatism_mm = 2;
  std::mt19937 random(2);
  constexpr int kRuns = 400;
  double corner = 0, constant = 0;
  for (int run = 0; run < kRuns; ++run) {
    const auto found = FitFieldAstigmatism(TilesOf(aberrations, 0.3, &random), kCornerPx, {0, 0});
    ASSERT_TRUE(found);
    corner += std::pow((found->at_corner_mm.value - 2) / found->at_corner_mm.sigma, 2) / kRuns;
    constant += std::pow(found->along_x_mm.value / found->along_x_mm.sigma, 2) / kRuns;
  }
  // chi^2 per degree of freedom below 1 does not narrow the errors, above 1 it widens them.
  EXPECT_NEAR(corner, 0.87, 0.2);
  EXPECT_NEAR(constant, 0.87, 0.2);
}

// The displacements of a lens are averaged over each tile's window in the axes of its middle. The
// middle tile, too, sees that average, because its window is wider than high.
TEST(FieldAstigmatism, CountsTheWindowOfATile) {
  model::LensAberrations aberrations;
  aberrations.field_astigmatism_mm = 3;
  std::mt19937 random(3);
  std::vector<TileFoci> tiles = TilesOf({}, 0, &random);
  const Eigen::Vector2d half_px(60, 30);  // of a window with equal weights
  for (TileFoci& tile : tiles) {
    const double azimuth = tile.from_axis_px.norm() == 0
                               ? 0
                               : std::atan2(tile.from_axis_px.y(), tile.from_axis_px.x());
    const Eigen::Vector2d radius(std::cos(azimuth), std::sin(azimuth));
    const Eigen::Vector2d tangent(-radius.y(), radius.x());
    Eigen::Matrix2d mean = Eigen::Matrix2d::Zero();
    constexpr int kSteps = 40;
    for (int a = 0; a < kSteps; ++a) {
      for (int b = 0; b < kSteps; ++b) {
        const Eigen::Vector2d off = half_px.cwiseProduct(
            Eigen::Vector2d((2 * a + 1.0) / kSteps - 1, (2 * b + 1.0) / kSteps - 1));
        mean += model::FocusDisplacement(aberrations, 300, tile.from_axis_px + off, kCornerPx) /
                (kSteps * kSteps);
      }
    }
    tile.difference_mm.value =
        1 / (1.0 / 300 + tangent.dot(mean * tangent)) - 1 / (1.0 / 300 + radius.dot(mean * radius));
  }
  const auto found = FitFieldAstigmatism(tiles, kCornerPx, half_px.cwiseAbs2() / 3);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->at_corner_mm.value, 3, 0.02);
  EXPECT_NEAR(found->along_x_mm.value, 0, 0.02);
  EXPECT_FALSE(FitFieldAstigmatism({tiles.begin(), tiles.begin() + 4}, kCornerPx, {0, 0}));
}

Calibration Calibrated(const model::LensAberrations& aberrations, double tilt_deg,
                       std::uint64_t seed) {
  model::SweepSimulationOptions options = SweepCase("ii", 0, seed);
  options.camera = model::CropCamera(options.camera, {96, 136, 320, 240});
  options.bits = 16;
  options.aberrations = aberrations;
  options.target.tilt_deg = tilt_deg;
  SimulatedSweep simulated = Simulate(options);
  GiveFloor(&simulated);
  return Calibrate(simulated.sweep, {});
}

double SigmasBeyond(const Result& result, double truth) {
  const double low = std::min(result.value, result.systematic ? result.systematic->x() : 1e9);
  const double high = std::max(result.value, result.systematic ? result.systematic->y() : -1e9);
  return std::max({0.0, low - truth, truth - high}) / result.sigma;
}

void ExpectMeasured(double field_mm, double tilt_deg) {
  SCOPED_TRACE(field_mm);
  model::LensAberrations aberrations;
  aberrations.field_astigmatism_mm = field_mm;
  const Calibration found = Calibrated(aberrations, tilt_deg, 3);
  const FieldMap& field = found.diagnostics.field;
  ASSERT_TRUE(field.field_astigmatism_mm) << found.summary.reason;
  const model::Estimate& corner = *field.field_astigmatism_mm;
  EXPECT_NEAR(corner.value, field_mm, 3 * corner.sigma + 0.1 * std::abs(field_mm));
  EXPECT_LT(corner.sigma, 0.15 * std::abs(field_mm));
  ASSERT_TRUE(field.tilt_right_deg);
  EXPECT_NEAR(field.tilt_right_deg->value, tilt_deg, 4 * field.tilt_right_deg->sigma + 0.5);
  EXPECT_THAT(found.summary.warnings, Contains(HasSubstr("has field astigmatism")));
  EXPECT_TRUE(field.tiles.front().sagittal);
  ASSERT_TRUE(found.summary.focus_depth_mm && found.summary.blur_ratio);
  EXPECT_LE(SigmasBeyond(*found.summary.focus_depth_mm, 300), 2);
  EXPECT_LE(SigmasBeyond(*found.summary.blur_ratio, 0.45), 2);
}

TEST(FieldAstigmatism, IsMeasured) { ExpectMeasured(4, 0); }
// The other sign, and a tilted target, which is found with its own angle.
TEST(FieldAstigmatism, SlowIsMeasuredBesideATilt) { ExpectMeasured(-6, 4); }

// Neither a curved field, nor a tilted target, nor an astigmatism that is the same everywhere is
// taken for it.
TEST(FieldAstigmatism, SlowIsNotSeenInOtherLenses) {
  model::LensAberrations curved, constant;
  curved.field_curvature_mm = 3;
  constant.astigmatism_mm = -4;
  for (const auto& [aberrations, tilt_deg] : {std::pair(model::LensAberrations(), 3.0),
                                              std::pair(curved, 0.0), std::pair(constant, 0.0)}) {
    const Calibration found = Calibrated(aberrations, tilt_deg, 4);
    EXPECT_THAT(found.summary.warnings, Not(Contains(HasSubstr("field astigmatism"))));
    const auto& corner = found.diagnostics.field.field_astigmatism_mm;
    if (corner) {
      EXPECT_NEAR(corner->value, 0, 4 * corner->sigma);
    }
  }
}

}  // namespace
}  // namespace thicklens::calib

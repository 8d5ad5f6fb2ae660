#include "calib/uncertainty/field_astigmatism.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/fit/misfit_causes.h"
#include "calib/uncertainty/astigmatism.h"
#include "calib/uncertainty/systematic_advice.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinTilesOfLaw = 5;
constexpr double kOnAxisPx = 1;  // nearer to the axis, a tile has no radius

double AzimuthOf(const Eigen::Vector2d& from_axis_px) {
  return from_axis_px.norm() < kOnAxisPx ? 0 : std::atan2(from_axis_px.y(), from_axis_px.x());
}

}  // namespace

std::optional<TileFoci> FociOfTile(const SpectralEstimatorSetup& setup,
                                   const EstimatorRegion& region, const BlurFitSetup& readings,
                                   const RelativeBlurOptions& options) {
  TileFoci foci;
  foci.from_axis_px = region.window.centre_px;
  RelativeBlurOptions turned = options;
  turned.axis_angle_rad = AzimuthOf(foci.from_axis_px);
  double least = std::numeric_limits<double>::infinity(), most = -least;
  for (const SpectrumSample& sample : region.samples) {
    least = std::min(least, sample.start_variance_px2);
    most = std::max(most, sample.start_variance_px2);
  }
  // Along one axis the blur may have twice the variance of the mean of both.
  const AxisLeakage leakage =
      MeasureAxisLeakage(setup, region, 2 * (most - least), turned.axis_angle_rad);
  const FittedAxes fitted = FitRegionAlongAxes(region, leakage, turned);
  if (!fitted.blur.done) return std::nullopt;
  BlurFitSetup law = readings;
  law.estimators.clear();
  law.half_astigmatism_per_mm = 0;  // each axis follows the law alone
  const AxialFocus focus = FitAxialFocus(law, fitted.region.frames, fitted.blur);
  if (!focus.done) return std::nullopt;
  foci.tangential = {focus.focus_depth_mm[0], focus.blur_ratio[0]};
  foci.sagittal = {focus.focus_depth_mm[1], focus.blur_ratio[1]};
  foci.difference_mm = {-focus.difference_mm.value, focus.difference_mm.sigma};
  return foci;
}

std::optional<FieldAstigmatism> FitFieldAstigmatism(const std::vector<TileFoci>& tiles,
                                                    double corner_px,
                                                    const Eigen::Vector2d& moments_px2) {
  if (tiles.size() < kMinTilesOfLaw) return std::nullopt;
  const auto n = static_cast<Eigen::Index>(tiles.size());
  constexpr Eigen::Index kTerms = 3;
  Eigen::MatrixXd design(n, kTerms);
  Eigen::VectorXd value(n), root_weight(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const TileFoci& tile = tiles[static_cast<std::size_t>(i)];
    const double azimuth = AzimuthOf(tile.from_axis_px);
    design(i, 0) = (tile.from_axis_px.squaredNorm() +
                    (moments_px2.x() - moments_px2.y()) * std::cos(2 * azimuth)) /
                   (corner_px * corner_px);
    design(i, 1) = -std::cos(2 * azimuth);
    design(i, 2) = -std::sin(2 * azimuth);
    value[i] = tile.difference_mm.value;
    root_weight[i] = 1 / std::max(tile.difference_mm.sigma, 1e-9);
  }
  const Eigen::MatrixXd white = root_weight.asDiagonal() * design;
  const Eigen::LDLT<Eigen::MatrixXd> normal(white.transpose() * white);
  if (normal.info() != Eigen::Success || !(normal.rcond() > 1e-12)) return std::nullopt;
  const Eigen::VectorXd target = root_weight.asDiagonal() * value;
  const Eigen::VectorXd terms = normal.solve(white.transpose() * target);
  FieldAstigmatism found;
  found.chi2_per_dof = (target - white * terms).squaredNorm() / static_cast<double>(n - kTerms);
  const Eigen::MatrixXd covariance =
      std::max(1.0, found.chi2_per_dof) * normal.solve(Eigen::MatrixXd::Identity(kTerms, kTerms));
  found.at_corner_mm = {terms[0], std::sqrt(covariance(0, 0))};
  found.along_x_mm = {terms[1], std::sqrt(covariance(1, 1))};
  return found;
}

void WidenByFieldAstigmatism(const model::ThickLens& lens, Calibration* calibration) {
  const std::string warning = FieldAstigmatismInWords(*calibration);
  if (warning.empty()) return;
  calibration->summary.warnings.push_back(warning);
  double focus_move_mm = 0, ratio_move = 0, tiles = 0;
  for (const FieldTile& tile : calibration->diagnostics.field.tiles) {
    if (!tile.done || !tile.sagittal || !tile.tangential) continue;
    const AxisFocus &s = *tile.sagittal, &t = *tile.tangential;
    focus_move_mm +=
        0.5 * (s.focus_depth_mm.value + t.focus_depth_mm.value) - tile.focus_depth_mm.value;
    ratio_move += 0.5 * (s.blur_ratio.value + t.blur_ratio.value) - tile.blur_ratio.value;
    ++tiles;
  }
  const auto from_0 = [tiles](double sum) {
    return Eigen::Vector2d(std::min(0.0, sum / tiles), std::max(0.0, sum / tiles));
  };
  WidenFocusAndRatio("field astigmatism", from_0(focus_move_mm), from_0(ratio_move),
                     "restrict roi_px to the middle of the field, or use a smaller aperture or "
                     "another lens",
                     lens, calibration);
}

}  // namespace thicklens::calib

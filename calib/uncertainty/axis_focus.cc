#include "calib/uncertainty/axis_focus.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/model/conjugates.h"

namespace thicklens::calib {
namespace {

// A result whose interval is moved with it and stretched by `factor` about it.
void MoveResult(double value, double sigma, double factor, std::optional<Result>* result) {
  if (!*result) return;
  Result& moved = **result;
  if (moved.systematic)
    *moved.systematic = ((moved.systematic->array() - moved.value) * factor + value).matrix();
  moved.value = value;
  moved.sigma = sigma;
}

// Row and column of a quantity of the covariance; -1 if it has none.
Eigen::Index RowOf(const char* name, const CalibrationDiagnostics& found) {
  const std::vector<std::string>& names = found.covariance_order;
  const auto at = std::find(names.begin(), names.end(), name);
  const auto row = static_cast<Eigen::Index>(at - names.begin());
  return at == names.end() || row >= found.covariance.rows() ? -1 : row;
}

}  // namespace

void MoveFocus(const model::Estimate& move_mm, double reading_sign, const model::ThickLens& lens,
               Calibration* calibration) {
  CalibrationSummary& summary = calibration->summary;
  CalibrationDiagnostics& found = calibration->diagnostics;
  const double before_mm = summary.focus_depth_mm->value, zf = before_mm + move_mm.value;
  const double f1_mm = lens.front_focal_length_mm;
  const double d1_mm = model::ImageDistanceMm(lens, zf);
  const double slope = model::ImageDistanceSlope(lens, zf);
  const double stretch = slope / model::ImageDistanceSlope(lens, before_mm);
  const double ratio_factor = model::DefocusScaleMm(lens, model::ImageDistanceMm(lens, before_mm)) /
                              model::DefocusScaleMm(lens, d1_mm);
  // d kappa/d zf of the move: K falls by f1/(zf (zf - f1)) of itself per mm.
  double ratio_slope = 0;
  if (summary.blur_ratio) {
    ratio_slope = ratio_factor * summary.blur_ratio->value * f1_mm / (zf * (zf - f1_mm));
    MoveResult(ratio_factor * summary.blur_ratio->value,
               std::hypot(ratio_factor * summary.blur_ratio->sigma, ratio_slope * move_mm.sigma),
               ratio_factor, &summary.blur_ratio);
  }
  const double zf_sigma = std::hypot(summary.focus_depth_mm->sigma, move_mm.sigma);
  MoveResult(zf, zf_sigma, 1, &summary.focus_depth_mm);
  MoveResult(d1_mm, std::abs(slope) * zf_sigma, stretch, &summary.image_distance_mm);
  if (found.focus_reading_mm) {
    found.focus_reading_mm->value += reading_sign * move_mm.value;
    found.focus_reading_mm->sigma = std::hypot(found.focus_reading_mm->sigma, move_mm.sigma);
  }
  if (found.magnification_at_focus) {
    found.magnification_at_focus = model::Estimate{model::MagnificationAtFocus(lens, zf),
                                                   f1_mm * zf_sigma / std::pow(zf - f1_mm, 2)};
  }
  for (SystematicPart& part : found.systematic_parts) {
    part.image_distance_mm *= stretch;
    part.blur_ratio *= ratio_factor;
  }
  const Eigen::Index distance = RowOf("image_distance_mm", found);
  const Eigen::Index ratio = RowOf("blur_ratio", found);
  Eigen::VectorXd move = Eigen::VectorXd::Zero(found.covariance.rows());
  const auto follow = [&](Eigen::Index row, double factor, double per_mm) {
    if (row < 0) return;
    found.covariance.row(row) *= factor;
    found.covariance.col(row) *= factor;
    move[row] = per_mm * move_mm.sigma;
  };
  follow(distance, stretch, slope);
  follow(ratio, ratio_factor, ratio_slope);
  found.covariance += move * move.transpose();
}

}  // namespace thicklens::calib

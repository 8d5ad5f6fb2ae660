#include "calib/fit/known_focus.h"

#include <algorithm>
#include <cmath>

#include "thicklens/base/error.h"

namespace thicklens::calib {
namespace {

constexpr int kMaxMoves = 12;
// The search ends where the fitted zf differs from the known one by less than this part of its own
// error, or of zf.
constexpr double kPartOfError = 1e-3, kPartOfDepth = 1e-9;
constexpr double kSlopeStep = 1e-3;  // step of the slope by the offset, relative to zf - f1

const double kEvenSpread = 1 / std::sqrt(3.0);  // standard deviation of an even distribution on +-1

// The fit at another bench offset. The focus moves with the zero, so that the search starts there.
BlurFitResult MovedBy(double move_mm, const BlurFitSetup& setup, const BlurFitResult& from) {
  BlurFitSetup moved = setup;
  moved.offset_mm.value += move_mm;
  BlurFitResult start = from;
  start.values[kFocusDepth] =
      std::max(from.values[kFocusDepth] + move_mm, 1.001 * setup.lens.front_focal_length_mm);
  return FitBlur(moved, &start);
}

}  // namespace

model::ThickLens Stretched(const model::ThickLens& lens, double factor) {
  model::ThickLens stretched = lens;
  stretched.front_focal_length_mm *= factor;
  stretched.rear_focal_length_mm *= factor;
  return stretched;
}

double ToleranceOfStatement(const model::Camera& camera, const model::StatedConjugate& stated) {
  if (!camera.objective || stated.name != kFromObjective) return 0;
  const auto found = camera.statements.find(kFromObjective);
  return found != camera.statements.end() && found->second.tolerance > 0
             ? found->second.tolerance
             : kIso8039 * stated.value.value;
}

bool HasOneFocalLength(const model::ThickLens& lens) {
  constexpr double kRounding = 1e-9;
  return std::abs(lens.front_focal_length_mm - lens.rear_focal_length_mm) <=
         kRounding * lens.front_focal_length_mm;
}

std::string FieldOfFocalLengthTolerance(const model::Camera& camera) {
  const auto states = [&](const char* field) {
    const auto stated = camera.statements.find(field);
    return stated != camera.statements.end() && stated->second.tolerance > 0;
  };
  if (states(kFrontFocalLength)) return kFrontFocalLength;
  return HasOneFocalLength(camera.lens) && states(kRearFocalLength) ? kRearFocalLength : "";
}

bool StatesFocalLength(const model::Camera& camera) {
  return !FieldOfFocalLengthTolerance(camera).empty();
}

double FocalLengthTolerance(const model::Camera& camera) {
  if (camera.objective) return 0;
  const std::string field = FieldOfFocalLengthTolerance(camera);
  return field.empty() ? kFocalLengthTolerance
                       : camera.statements.at(field).tolerance / camera.lens.front_focal_length_mm;
}

model::Estimate FocusDepthWithTolerance(const model::Camera& camera,
                                        const model::StatedConjugate& stated) {
  model::StatedConjugate with_tolerance = stated;
  with_tolerance.value.sigma =
      std::hypot(stated.value.sigma, kEvenSpread * ToleranceOfStatement(camera, stated));
  model::Estimate focus_mm = model::FocusDepthOf(camera.lens, with_tolerance);
  if (stated.kind == model::ConjugateKind::kFocusDepth) return focus_mm;
  // A part of the tolerance is enough for the slope, and a sensor at a stated distance stays behind
  // the focal point.
  constexpr double kStep = -1e-4;
  const double change_mm =
      (model::FocusDepthOf(Stretched(camera.lens, 1 + kStep), stated).value - focus_mm.value) /
      kStep;
  focus_mm.sigma =
      std::hypot(focus_mm.sigma, kEvenSpread * FocalLengthTolerance(camera) * change_mm);
  return focus_mm;
}

BlurFitResult FitBlurAtKnownFocus(const BlurFitSetup& setup, const model::StatedConjugate& known,
                                  const BlurFitResult* start) {
  model::Estimate focus_mm;
  try {
    focus_mm = model::FocusDepthOf(setup.lens, known);
  } catch (const Error& impossible) {
    BlurFitResult none;
    none.message = impossible.what();
    return none;
  }
  BlurFitSetup held = setup;
  held.offset_mm.sigma = 0;
  BlurFitResult fit = FitBlur(held, start);
  for (int move = 0; fit.done; ++move) {
    const double gap_mm = focus_mm.value - fit.values[kFocusDepth];
    const double own_mm = std::sqrt(std::max(0.0, fit.covariance(kFocusDepth, kFocusDepth)));
    if (std::abs(gap_mm) < std::max(kPartOfError * own_mm, kPartOfDepth * focus_mm.value)) break;
    if (move == kMaxMoves) {
      fit.done = false;
      fit.message = "no bench offset was found at which the blur is smallest at the known depth";
      break;
    }
    const BlurFitResult next = MovedBy(gap_mm, held, fit);
    held.offset_mm.value += gap_mm;
    fit = next;
  }
  if (!fit.done) return fit;
  const double step_mm = kSlopeStep * (fit.values[kFocusDepth] - setup.lens.front_focal_length_mm);
  const BlurFitResult above = MovedBy(step_mm, held, fit), below = MovedBy(-step_mm, held, fit);
  if (!above.done || !below.done) {
    fit.done = false;
    fit.message = "the fit of the blur does not converge beside the known plane of focus";
    return fit;
  }
  Eigen::Vector4d slope = (above.values - below.values) / (2 * step_mm);
  slope[kBenchOffset] = 1;
  slope /= slope[kFocusDepth];
  Eigen::Matrix4d projection = Eigen::Matrix4d::Identity();
  projection.col(kFocusDepth) -= slope;
  fit.covariance = projection * fit.covariance * projection.transpose() +
                   slope * slope.transpose() * focus_mm.sigma * focus_mm.sigma;
  return fit;
}

BlurFitResult FitBlurWith(const BlurFitSetup& setup,
                          const std::optional<model::StatedConjugate>& known,
                          const BlurFitResult* start) {
  return known ? FitBlurAtKnownFocus(setup, *known, start) : FitBlur(setup, start);
}

}  // namespace thicklens::calib

#include "calib/uncertainty/systematic_advice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "thicklens/calib/error_budget.h"

namespace thicklens::calib {

void SortAndAdvise(Calibration* calibration) {
  const std::vector<ErrorTerm> terms = ErrorTerms(*calibration);
  if (terms.empty()) return;
  const auto rank = [&terms](const SystematicPart& part) {
    return std::find_if(terms.begin(), terms.end(),
                        [&part](const ErrorTerm& term) {
                          return !term.is_statistical && term.name == part.name;
                        }) -
           terms.begin();
  };
  std::vector<SystematicPart>& parts = calibration->diagnostics.systematic_parts;
  std::stable_sort(
      parts.begin(), parts.end(),
      [&rank](const SystematicPart& a, const SystematicPart& b) { return rank(a) < rank(b); });
  calibration->diagnostics.advice = LargestErrorInWords(terms);
}

void WidenFocus(const std::string& name, double move_mm, const std::string& remedy,
                const model::ThickLens& lens, Calibration* calibration) {
  WidenFocusAndRatio(name, {-move_mm, move_mm}, {0, 0}, remedy, lens, calibration);
}

void WidenFocusAndRatio(const std::string& name, const Eigen::Vector2d& focus_moves_mm,
                        const Eigen::Vector2d& ratio_moves, const std::string& remedy,
                        const model::ThickLens& lens, Calibration* calibration) {
  const double zf = calibration->summary.focus_depth_mm->value;
  const double d1_mm = model::ImageDistanceMm(lens, zf);
  SystematicPart part;
  part.name = name;
  part.remedy = remedy;
  // d1 falls as zf grows; nearer than the focal point nothing comes into focus.
  const double nearest_mm =
      std::max(zf + focus_moves_mm.x(), std::min(zf, 1.01 * lens.front_focal_length_mm));
  const double farthest_mm = zf + focus_moves_mm.y();
  part.focus_depth_mm = {nearest_mm - zf, focus_moves_mm.y()};
  part.image_distance_mm = {model::ImageDistanceMm(lens, farthest_mm) - d1_mm,
                            model::ImageDistanceMm(lens, nearest_mm) - d1_mm};
  part.blur_ratio = ratio_moves;
  AddPart(std::move(part), calibration);
}

void AddPart(SystematicPart part, Calibration* calibration) {
  CalibrationSummary& summary = calibration->summary;
  const auto add = [](std::optional<Result>* result, const Eigen::Vector2d& moves) {
    if (*result && (*result)->systematic) *(*result)->systematic += moves;
  };
  add(&summary.focus_depth_mm, part.focus_depth_mm);
  add(&summary.image_distance_mm, part.image_distance_mm);
  add(&summary.blur_ratio, part.blur_ratio);
  calibration->diagnostics.systematic_parts.push_back(std::move(part));
  SortAndAdvise(calibration);
}

void WidenByTrials(const std::string& name, const std::string& remedy,
                   const std::vector<BlurFitSetup>& setups, const BlurFitResult& fit,
                   Calibration* calibration,
                   const std::optional<model::StatedConjugate>& known_focus) {
  SystematicPart part;
  part.name = name;
  part.remedy = remedy;
  std::optional<Result>& zero = calibration->summary.bench_offset_mm;
  Eigen::Vector2d zero_mm(0, 0);
  if (zero) zero_mm = zero->systematic.value_or(Eigen::Vector2d(zero->value, zero->value));
  for (const BlurFitSetup& setup : setups) {
    // The focus moves with the zero. From the old one, the fit of a sweep that is short against
    // that move would start outside the sweep.
    BlurFitResult start = fit;
    start.values[kFocusDepth] =
        std::max(fit.values[kFocusDepth] + setup.offset_mm.value - fit.values[kBenchOffset],
                 1.001 * setup.lens.front_focal_length_mm);
    const BlurFitResult trial = FitBlurWith(setup, known_focus, &start);
    if (!trial.done) {
      calibration->summary.warnings.push_back(
          fmt::format("{}: the fit of its effect on the results failed, and the intervals do not "
                      "include it ({})",
                      name, trial.message));
      continue;
    }
    const double d1_mm = model::ImageDistanceMm(setup.lens, fit.values[kFocusDepth]);
    const auto widen = [](double move, Eigen::Vector2d* interval) {
      *interval = {std::min(interval->x(), move), std::max(interval->y(), move)};
    };
    widen(trial.values[kFocusDepth] - fit.values[kFocusDepth], &part.focus_depth_mm);
    widen(model::ImageDistanceMm(setup.lens, trial.values[kFocusDepth]) - d1_mm,
          &part.image_distance_mm);
    widen(trial.values[kBlurRatio] - fit.values[kBlurRatio], &part.blur_ratio);
    widen(trial.values[kBenchOffset], &zero_mm);
  }
  if (zero) zero->systematic = zero_mm;
  AddPart(std::move(part), calibration);
}

void WidenRatio(const std::string& name, const Eigen::Vector2d& moves, const std::string& remedy,
                Calibration* calibration) {
  SystematicPart part;
  part.name = name;
  part.remedy = remedy;
  part.blur_ratio = moves;
  AddPart(std::move(part), calibration);
}

}  // namespace thicklens::calib

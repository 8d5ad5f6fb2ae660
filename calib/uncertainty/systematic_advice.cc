#include "calib/uncertainty/systematic_advice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace thicklens::calib {
namespace {

double Width(const Eigen::Vector2d& interval) { return interval.y() - interval.x(); }

// A part's name in a sentence: "the blur floor", but "lens.front_focal_length_mm".
std::string WithArticle(const std::string& name) {
  return name.find('.') == std::string::npos ? "the " + name : name;
}

constexpr char kNoRemedy[] = "no remedy";  // begins the remedy of a part that has none

// A clearly wrong shape changes kappa, whatever the shares of d1 are.
std::optional<std::string> WrongShape(const Calibration& calibration) {
  for (const SystematicPart& part : calibration.diagnostics.systematic_parts) {
    if (part.name == kShapePart && Width(part.blur_ratio) > 0 &&
        part.remedy.rfind(kNoRemedy, 0) != 0)
      return part.remedy;
  }
  return std::nullopt;
}

// Returns the action that makes the bench offset more precise. A statement can only be made more
// exactly.
std::string RemedyOfOffset(const std::string& origin) {
  if (!origin.empty() && origin != kFromScale) return fmt::format("state {} more exactly", origin);
  return "state the magnification (by target_period_mm with a grid or ruler in view), "
         "image_distance_mm, focus_depth_mm or offset_mm; or sweep over a longer range, so that "
         "the image scale determines it better";
}

}  // namespace

void SortAndAdvise(Calibration* calibration) {
  std::vector<SystematicPart>& parts = calibration->diagnostics.systematic_parts;
  std::stable_sort(parts.begin(), parts.end(),
                   [](const SystematicPart& a, const SystematicPart& b) {
                     return Width(a.image_distance_mm) > Width(b.image_distance_mm);
                   });
  const double zf_sigma_mm = calibration->summary.focus_depth_mm->sigma;
  const double zero_sigma_mm =
      calibration->summary.bench_offset_mm
          ? std::min(calibration->summary.bench_offset_mm->sigma, zf_sigma_mm)
          : 0;
  const double d1_per_zf =
      zf_sigma_mm > 0 ? calibration->summary.image_distance_mm->sigma / zf_sigma_mm : 0;
  const double zero_mm = 2 * 1.96 * d1_per_zf * zero_sigma_mm;
  const double noise_mm =
      2 * 1.96 * d1_per_zf * std::sqrt(zf_sigma_mm * zf_sigma_mm - zero_sigma_mm * zero_sigma_mm);
  double all_mm = noise_mm + zero_mm;
  for (const SystematicPart& part : parts) all_mm += Width(part.image_distance_mm);
  if (!(all_mm > 0)) return;
  const double worst_mm = parts.empty() ? 0 : Width(parts.front().image_distance_mm);
  if (const auto wrong = WrongShape(*calibration)) {
    calibration->diagnostics.advice = *wrong;
    return;
  }
  const auto due_to = [&](double part_mm, const std::string& cause) {
    return fmt::format("{:.0f} % of the error of d1 is due to {}: ", 100 * part_mm / all_mm, cause);
  };
  if (worst_mm > noise_mm && worst_mm > zero_mm) {
    calibration->diagnostics.advice =
        due_to(worst_mm, WithArticle(parts.front().name)) + parts.front().remedy;
  } else if (zero_mm > noise_mm) {
    calibration->diagnostics.advice = due_to(zero_mm, "the bench offset") +
                                      RemedyOfOffset(calibration->diagnostics.bench_offset_from);
  } else {
    calibration->diagnostics.advice =
        due_to(noise_mm, "noise and readings") + "take more frames, or use a finer bench scale";
  }
}

void WidenFocus(const std::string& name, double move_mm, const std::string& remedy,
                const model::ThickLens& lens, Calibration* calibration) {
  WidenFocusAndRatio(name, {-move_mm, move_mm}, {0, 0}, remedy, lens, calibration);
}

void WidenFocusAndRatio(const std::string& name, const Eigen::Vector2d& focus_moves_mm,
                        const Eigen::Vector2d& ratio_moves, const std::string& remedy,
                        const model::ThickLens& lens, Calibration* calibration) {
  CalibrationSummary& summary = calibration->summary;
  const double zf = summary.focus_depth_mm->value;
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
  const auto add = [](std::optional<Result>* result, const Eigen::Vector2d& moves) {
    if (*result && (*result)->systematic) *(*result)->systematic += moves;
  };
  add(&summary.focus_depth_mm, part.focus_depth_mm);
  add(&summary.image_distance_mm, part.image_distance_mm);
  add(&summary.blur_ratio, part.blur_ratio);
  calibration->diagnostics.systematic_parts.push_back(part);
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
  const auto add = [](std::optional<Result>* result, const Eigen::Vector2d& moves) {
    if (*result && (*result)->systematic) *(*result)->systematic += moves;
  };
  add(&calibration->summary.focus_depth_mm, part.focus_depth_mm);
  add(&calibration->summary.image_distance_mm, part.image_distance_mm);
  add(&calibration->summary.blur_ratio, part.blur_ratio);
  calibration->diagnostics.systematic_parts.push_back(part);
  SortAndAdvise(calibration);
}

void WidenRatio(const std::string& name, const Eigen::Vector2d& moves, const std::string& remedy,
                Calibration* calibration) {
  SystematicPart part;
  part.name = name;
  part.remedy = remedy;
  part.blur_ratio = moves;
  std::optional<Result>& ratio = calibration->summary.blur_ratio;
  if (ratio && ratio->systematic) *ratio->systematic += moves;
  calibration->diagnostics.systematic_parts.push_back(part);
  SortAndAdvise(calibration);
}

}  // namespace thicklens::calib

#include "thicklens/calib/next_measurement.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>
#include <vector>

#include "calib/calibrate/plan_texture.h"
#include "calib/calibrate/sweep_conditions.h"
#include "thicklens/calib/error_budget.h"
#include "thicklens/calib/sweep_plan.h"

namespace thicklens::calib {
namespace {

constexpr double kHalf = 0.5;
constexpr double kAgrees = 0.05;    // part by which parts may miss the interval that they make
constexpr double kNormal95 = 1.96;  // standard deviations
// Ratio of the errors with twice as many frames where nothing better is known.
const double kTwiceAsMany = std::sqrt(0.5);
constexpr int kMaxFrames = 400;
constexpr int kMinFramesPlanned = 5;

double RatioOf(double after, double before) { return before > 0 ? after / before : 1; }

// A change of the sweep, and what it leaves of the standard deviations of zf and kappa.
struct Change {
  std::string action;
  double focus = 1, ratio = 1;
};

class Proposal {
 public:
  Proposal(const FocusSweep& sweep, const Calibration& calibration)
      : sweep_(sweep), calibration_(calibration), terms_(ErrorTerms(calibration)) {}

  NextMeasurement Run() {
    double all = 0;
    for (const ErrorTerm& term : terms_) all += term.effect;
    if (!(all > 0)) return Without("no error of the results is known");
    const auto chosen = std::find_if(terms_.begin(), terms_.end(), [](const ErrorTerm& term) {
      return term.effect > 0 && !HasNoRemedy(term);
    });
    if (chosen == terms_.end())
      return Without(fmt::format("no measurement makes the error of {} smaller",
                                 TermInWords(terms_.front().name)));
    next_.done = true;
    next_.message = "proposed";
    next_.term = chosen->name;
    if (chosen != terms_.begin()) next_.larger_term = terms_.front().name;
    next_.share = chosen->effect / all;
    if (chosen->is_statistical) {
      Take(BestChange(*chosen));
    } else {
      next_.action = chosen->remedy;
      TakeWithout(chosen->name);
    }
    return std::move(next_);
  }

 private:
  NextMeasurement Without(const std::string& reason) {
    next_.message = reason;
    return std::move(next_);
  }

  // ---- a systematic term ----

  // AddSystematicParts adds these in quadrature, the blur floor and all later parts linearly.
  static bool IsInQuadrature(const std::string& name) {
    static const std::set<std::string> names = {
        "side of focus",     "frequency band",       "contrast of the blur's halo",
        "shape of the blur", "tails of the blur",    "edges against texture",
        "blur estimator",    "sensor.pixel_pitch_mm"};
    return names.count(name) > 0 || name.rfind("lens.", 0) == 0;
  }

  // The side of an interval that parts of these sizes make.
  static double SideOf(const std::vector<std::pair<std::string, double>>& parts) {
    double linear = 0, squares = 0;
    for (const auto& [name, size] : parts)
      (IsInQuadrature(name) ? squares : linear) += IsInQuadrature(name) ? size * size : size;
    return linear + std::sqrt(squares);
  }

  // Returns the rest of one side of an interval without one of its parts. Where the parts do not
  // make the side as they are known to be added, hypot(part, rest) = whole leaves the most [D165].
  static double Left(double whole, const std::string& without,
                     std::vector<std::pair<std::string, double>> parts) {
    const double made = SideOf(parts);
    const auto at = std::find_if(parts.begin(), parts.end(),
                                 [&without](const auto& part) { return part.first == without; });
    const double size = at == parts.end() ? 0 : at->second;
    if (at != parts.end()) parts.erase(at);
    if (std::abs(made - whole) <= kAgrees * whole) return SideOf(parts);
    return std::sqrt(std::max(0.0, whole * whole - size * size));
  }

  std::optional<ExpectedChange> WithoutPart(const std::optional<Result>& result,
                                            const std::string& name,
                                            Eigen::Vector2d SystematicPart::*moves) const {
    if (!result || !std::isfinite(result->value)) return std::nullopt;
    Result left = *result;
    if (left.systematic && left.systematic->allFinite()) {
      std::vector<std::pair<std::string, double>> below, above;
      for (const SystematicPart& part : calibration_.diagnostics.systematic_parts) {
        below.emplace_back(part.name, std::abs((part.*moves).x()));
        above.emplace_back(part.name, std::abs((part.*moves).y()));
      }
      left.systematic =
          Eigen::Vector2d(left.value - Left(left.value - left.systematic->x(), name, below),
                          left.value + Left(left.systematic->y() - left.value, name, above));
    }
    return ExpectedChange{HalfWidth(*result), HalfWidth(left)};
  }

  void TakeWithout(const std::string& name) {
    next_.focus_depth_mm =
        WithoutPart(calibration_.summary.focus_depth_mm, name, &SystematicPart::focus_depth_mm);
    next_.blur_ratio =
        WithoutPart(calibration_.summary.blur_ratio, name, &SystematicPart::blur_ratio);
  }

  // ---- a statistical term ----

  static std::optional<ExpectedChange> Scaled(const std::optional<Result>& result, double factor) {
    if (!result || !std::isfinite(result->value)) return std::nullopt;
    Result after = *result;
    after.sigma *= factor;
    return ExpectedChange{HalfWidth(*result), HalfWidth(after)};
  }

  void Take(const Change& change) {
    next_.action = change.action;
    next_.focus_depth_mm = Scaled(calibration_.summary.focus_depth_mm, change.focus);
    next_.blur_ratio = Scaled(calibration_.summary.blur_ratio, change.ratio);
  }

  // The change with the smallest error that is left. Each of them is against the term.
  Change BestChange(const ErrorTerm& term) {
    const bool is_offset = term.name == kOffsetTerm;
    std::vector<Change> changes;
    if (Plan()) changes = is_offset ? ChangesOfOffset() : ChangesOfNoise();
    if (changes.empty()) return UsualChange(term);
    return *std::min_element(
        changes.begin(), changes.end(),
        [this](const Change& a, const Change& b) { return Effect(a) < Effect(b); });
  }

  // The errors of a change in the measure of ErrorTerms: those of zf count by the term's share.
  double Effect(const Change& change) const {
    const auto relative = [](const std::optional<Result>& result) {
      return result && result->value > 0 ? result->sigma / result->value : 0;
    };
    return std::hypot(change.focus * relative(calibration_.summary.focus_depth_mm) / reach_,
                      change.ratio * relative(calibration_.summary.blur_ratio));
  }

  // Without a prediction: twice as many frames have 1/sqrt(2) of the noise, and an offset that is
  // known twice as well half of its error.
  Change UsualChange(const ErrorTerm& term) const {
    const bool is_offset = term.name == kOffsetTerm;
    const auto left = [is_offset](const std::optional<Result>& result, double half_width) {
      if (!result || !(result->sigma > 0)) return 1.0;
      const double part = std::min(1.0, half_width / (kNormal95 * result->sigma));
      const double rest = (is_offset ? kHalf : kTwiceAsMany) * part;
      return std::sqrt(1 - part * part + rest * rest);
    };
    Change change;
    change.action = is_offset ? term.remedy
                              : fmt::format("take {} frames in place of {} over the same range",
                                            2 * calibration_.summary.frames_used,
                                            calibration_.summary.frames_used);
    change.focus = left(calibration_.summary.focus_depth_mm, term.focus_depth_mm);
    change.ratio = left(calibration_.summary.blur_ratio, term.blur_ratio);
    return change;
  }

  // The conditions of this sweep, and equal steps over the depths of its fit. Returns false where
  // they cannot be planned.
  bool Plan() {
    const CalibrationSummary& found = calibration_.summary;
    if (!found.focus_depth_mm || !found.blur_ratio || !found.bench_offset_mm ||
        model::MovesFocus(calibration_.diagnostics.moves) || !(found.blur_ratio->value > 0))
      return false;
    double nearest = std::numeric_limits<double>::infinity(), farthest = 0, squares = 0;
    std::vector<const FrameMeasurement*> frames;
    const double zf = found.focus_depth_mm->value;
    for (const FrameMeasurement& frame : calibration_.frames) {
      if (!frame.in_blur_fit || !IsDepthOfSweep(frame.depth_mm)) continue;
      nearest = std::min(nearest, frame.depth_mm);
      farthest = std::max(farthest, frame.depth_mm);
      squares += std::pow(zf / frame.depth_mm - 1, 2);
      frames.push_back(&frame);
    }
    const auto count = static_cast<int>(frames.size());
    if (count < kMinFramesPlanned || !(farthest > nearest)) return false;
    reach_ = std::sqrt(squares / count);
    conditions_ = ConditionsOfFrames(sweep_, frames, zf, found.blur_ratio->value);
    if (found.blur_floor_px && std::isfinite(found.blur_floor_px->value))
      conditions_.blur_floor_px = found.blur_floor_px->value;
    conditions_.reading_sigma_mm = sweep_.reading_sigma_mm > 0
                                       ? sweep_.reading_sigma_mm
                                       : calibration_.diagnostics.scale.reading_rms_mm;
    conditions_.offset_sigma_mm = found.bench_offset_mm->sigma;
    design_.nearest_mm = nearest;
    design_.frames = count;
    design_.step_mm = (farthest - nearest) / (count - 1);
    if (!conditions_.IsValid(nullptr) || !(nearest > conditions_.camera.lens.front_focal_length_mm))
      return false;
    design_.feature_size_mm = UsualTextureMm(conditions_);
    texture_.emplace(TextureOf(conditions_, design_.feature_size_mm));
    now_ = Expect(conditions_, design_);
    return now_.done;
  }

  static bool IsDepthOfSweep(double depth_mm) { return depth_mm > 0 && std::isfinite(depth_mm); }

  ExpectedSweep Expect(const PlanConditions& conditions, const SweepDesign& design) const {
    return ExpectSweepOf(conditions, design, *texture_, false);
  }

  void AddChange(const std::string& action, const PlanConditions& conditions,
                 const SweepDesign& design, std::vector<Change>* changes) const {
    const ExpectedSweep after = Expect(conditions, design);
    if (!after.done) return;
    Change change;
    change.action = action;
    change.focus = RatioOf(after.sigma.focus_depth_mm, now_.sigma.focus_depth_mm);
    change.ratio = RatioOf(after.sigma.blur_ratio, now_.sigma.blur_ratio);
    if (change.focus < 1 || change.ratio < 1) changes->push_back(std::move(change));
  }

  double ReadingAt(double depth_mm) const {
    return model::DirectionSign(sweep_.direction) *
           (depth_mm - calibration_.summary.bench_offset_mm->value);
  }

  // More frames in the same steps beyond one end, half as many as there are.
  void AddLonger(bool at_far_side, std::vector<Change>* changes) const {
    const double room_mm = at_far_side
                               ? kFarthestDepth * conditions_.focus_depth_mm - design_.farthest_mm()
                               : design_.nearest_mm - NearestDepthMm(conditions_);
    const int more = std::min({std::max(2, design_.frames / 2),
                               static_cast<int>(std::floor(room_mm / design_.step_mm)),
                               kMaxFrames - design_.frames});
    if (more < 1) return;
    SweepDesign longer = design_;
    longer.frames += more;
    if (!at_far_side) longer.nearest_mm -= more * design_.step_mm;
    const double end_mm = at_far_side ? longer.farthest_mm() : longer.nearest_mm;
    AddChange(fmt::format("take {} more frames on the {} side, in steps of {:.3g} mm up to reading "
                          "{:.5g} mm",
                          more, at_far_side ? "far" : "near", design_.step_mm, ReadingAt(end_mm)),
              conditions_, longer, changes);
  }

  std::vector<Change> ChangesOfNoise() const {
    std::vector<Change> changes;
    SweepDesign denser = design_;
    denser.frames = std::min(2 * design_.frames, kMaxFrames);
    denser.step_mm = (design_.farthest_mm() - design_.nearest_mm) / (denser.frames - 1);
    if (denser.frames > design_.frames) {
      AddChange(fmt::format("take {} frames in place of {} over the same range", denser.frames,
                            design_.frames),
                conditions_, denser, &changes);
    }
    AddLonger(false, &changes);
    AddLonger(true, &changes);
    PlanConditions changed = conditions_;
    *changed.noise_sigma *= kHalf;
    AddChange("average 4 exposures for each frame", changed, design_, &changes);
    if (conditions_.reading_sigma_mm > 0) {
      changed = conditions_;
      changed.reading_sigma_mm *= kHalf;
      AddChange(fmt::format("read the position to {:.2g} mm in place of {:.2g} mm",
                            changed.reading_sigma_mm, conditions_.reading_sigma_mm),
                changed, design_, &changes);
    }
    return changes;
  }

  std::vector<Change> ChangesOfOffset() const {
    std::vector<Change> changes;
    PlanConditions changed = conditions_;
    changed.offset_sigma_mm = kHalf * *conditions_.offset_sigma_mm;
    const std::string& origin = calibration_.diagnostics.bench_offset_from;
    const bool is_from_scale = origin.empty() || origin == "the image scale";
    AddChange(is_from_scale
                  ? fmt::format("state offset_mm, or by target_period_mm (a grid or ruler in view) "
                                "the magnification, so that the bench offset is known to {:.2g} mm "
                                "in place of {:.2g} mm",
                                *changed.offset_sigma_mm, *conditions_.offset_sigma_mm)
                  : fmt::format("state {} more exactly, so that the bench offset is known to "
                                "{:.2g} mm in place of {:.2g} mm",
                                origin, *changed.offset_sigma_mm, *conditions_.offset_sigma_mm),
              changed, design_, &changes);
    return changes;
  }

  const FocusSweep& sweep_;
  const Calibration& calibration_;
  const std::vector<ErrorTerm> terms_;
  NextMeasurement next_;
  PlanConditions conditions_;
  SweepDesign design_;
  std::optional<TextureSpectrum> texture_;
  ExpectedSweep now_;
  double reach_ = 1;
};

}  // namespace

NextMeasurement ProposeNext(const FocusSweep& sweep, const Calibration& calibration) {
  return Proposal(sweep, calibration).Run();
}

}  // namespace thicklens::calib

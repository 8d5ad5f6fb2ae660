#include "thicklens/calib/sweep_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <utility>

#include "calib/calibrate/plan_texture.h"
#include "calib/fit/blur_fit.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/pi.h"
#include "thicklens/base/validity.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::calib {
namespace {

constexpr int kMinPlannedFrames = 9;  // below, one bad frame may leave too few
constexpr int kUsualFrames = 31;
constexpr int kMaxPlannedFrames = 400;
// Ends of the search for the defocus at the ends of the sweep, px of sigma.
constexpr double kMinEndBlurPx = 0.4, kMaxEndBlurPx = 16;
constexpr int kEndBlurs = 10;  // steps of the search, before it is refined
constexpr int kRefinements = 8;
// The nearest frame is beyond the focal length by this part of zf - f1, and the farthest is at most
// so many times as far as the plane of focus.
constexpr double kBeyondFocalPoint = 0.1, kFarthest = 3;
// Sizes of the texture that are tried, none finer than a px in the nearest frame, which neither a
// camera nor the simulator resolves: radius of the smallest leaf, or half of a period, px at
// focus.
constexpr double kFeaturesPx[] = {1.2, 1.6, 2, 2.8, 4, 5.6, 8, 11, 16};
constexpr double kUsualFeaturePx = 2;
constexpr double kMuchWorse = 1.25;  // ratio of errors that is worth a warning
constexpr double kMargin = 1.1;      // of the target's size
constexpr double kInfinite = std::numeric_limits<double>::infinity();

bool IsPositive(double value) { return value > 0 && std::isfinite(value); }
bool IsAmount(double value) { return value >= 0 && std::isfinite(value); }

// Two significant digits, by which a step can be set on a bench.
double Rounded(double value) { return std::stod(fmt::format("{:.1e}", value)); }

// One of the wishes, by its name.
struct Wish {
  const char* name;
  const char* unit;
  double PlannedErrors::*error;
  std::optional<double> PlanWishes::*wanted;
};
constexpr Wish kWishes[] = {
    {"the in-focus object distance zf", " mm", &PlannedErrors::focus_depth_mm,
     &PlanWishes::focus_depth_mm},
    {"the image distance d1", " mm", &PlannedErrors::image_distance_mm,
     &PlanWishes::image_distance_mm},
    {"the blur ratio kappa", "", &PlannedErrors::blur_ratio, &PlanWishes::blur_ratio}};

// A change of the conditions that would make an error smaller, and that error.
struct Remedy {
  std::string text;
  double error = kInfinite;
};

class Search {
 public:
  Search(const PlanConditions& conditions, const PlanWishes& wishes)
      : conditions_(conditions), wishes_(wishes) {}

  SweepPlan Run() {
    const double feature_mm = wishes_.feature_size_mm.value_or(BestFeature());
    SweepDesign design = BestRange(wishes_.frames.value_or(kUsualFrames), feature_mm);
    if (!wishes_.frames && IsWishful()) design = FewestFrames(design);
    design = Settable(design);
    plan_.expected = Expect(design, conditions_, true);
    if (!plan_.expected.done) throw Error("plan: no sweep has a result: " + plan_.expected.message);
    plan_.reached = !(Merit(plan_.expected) > 1) || !IsWishful();
    plan_.reason.clear();
    if (!plan_.reached) plan_.reason = ReasonOfMiss();
    FillTarget();
    Warn();
    plan_.advice = Advice();
    return std::move(plan_);
  }

 private:
  bool IsWishful() const {
    return std::any_of(std::begin(kWishes), std::end(kWishes),
                       [&](const Wish& wish) { return (wishes_.*wish.wanted).has_value(); });
  }

  const TextureSpectrum& SpectrumOf(double feature_mm) {
    const auto found = textures_.find(feature_mm);
    if (found != textures_.end()) return found->second;
    return textures_.emplace(feature_mm, TextureSpectrum(TextureOf(conditions_, feature_mm)))
        .first->second;
  }

  ExpectedSweep Expect(const SweepDesign& design, const PlanConditions& conditions,
                       bool with_parts) {
    ThrowIfCancelled();
    if (conditions.contrast == conditions_.contrast)
      return ExpectSweepOf(conditions, design, SpectrumOf(design.feature_size_mm), with_parts);
    const TextureSpectrum texture(TextureOf(conditions, design.feature_size_mm));
    return ExpectSweepOf(conditions, design, texture, with_parts);
  }

  // The errors over what is wanted, the largest of them; without wishes the product of the relative
  // errors of zf and kappa. Infinite where there is no result.
  double Merit(const ExpectedSweep& expected) const {
    if (!expected.done) return kInfinite;
    if (!IsWishful()) {
      return expected.sigma.focus_depth_mm / conditions_.focus_depth_mm *
             expected.sigma.blur_ratio / conditions_.blur_ratio;
    }
    double worst = 0;
    for (const Wish& wish : kWishes) {
      const auto& wanted = wishes_.*wish.wanted;
      if (wanted) worst = std::max(worst, expected.sigma.*wish.error / *wanted);
    }
    return worst;
  }
  double MeritOf(const SweepDesign& design, const PlanConditions& conditions) {
    return Merit(Expect(design, conditions, false));
  }
  double MeritOf(const SweepDesign& design) { return MeritOf(design, conditions_); }

  // The wish that is the farthest from being reached; zf without wishes.
  const Wish& WorstWish(const ExpectedSweep& expected) const {
    const Wish* worst = &kWishes[0];
    double most = 0;
    for (const Wish& wish : kWishes) {
      const auto& wanted = wishes_.*wish.wanted;
      if (!wanted || !(expected.sigma.*wish.error / *wanted > most)) continue;
      most = expected.sigma.*wish.error / *wanted;
      worst = &wish;
    }
    return *worst;
  }

  SweepDesign Between(double nearest_mm, double farthest_mm, int frames, double feature_mm) const {
    SweepDesign design;
    design.nearest_mm = nearest_mm;
    design.frames = frames;
    design.step_mm = (farthest_mm - nearest_mm) / (frames - 1);
    design.feature_size_mm = feature_mm;
    return design;
  }

  // Ends at which the defocus has a sigma, [S25] with 1/z = 1/zf +- sigma p/(kappa r K).
  std::pair<double, double> EndsOf(double end_blur_px) const {
    const double zf = conditions_.focus_depth_mm;
    const model::ThickLens& lens = conditions_.camera.lens;
    const double f1 = lens.front_focal_length_mm;
    const double scale_mm = model::DefocusScaleMm(lens, model::ImageDistanceMm(lens, zf));
    const double change = end_blur_px * conditions_.camera.sensor.pixel_pitch_mm /
                          (conditions_.blur_ratio * lens.aperture_radius_mm * scale_mm);
    const double nearest = std::max(1 / (1 / zf + change), NearestMm());
    const double inverse = 1 / zf - change;
    const double farthest = inverse > 1 / (kFarthest * zf) ? 1 / inverse : kFarthest * zf;
    return {std::max(nearest, f1), farthest};
  }
  double NearestMm() const {
    const double f1 = conditions_.camera.lens.front_focal_length_mm;
    return f1 + kBeyondFocalPoint * (conditions_.focus_depth_mm - f1);
  }

  SweepDesign BestRange(int frames, double feature_mm) {
    if (wishes_.nearest_mm)
      return Between(*wishes_.nearest_mm, *wishes_.farthest_mm, frames, feature_mm);
    const auto design_of = [&](double log_blur) {
      const auto [near, far] = EndsOf(std::exp(log_blur));
      return Between(near, far, frames, feature_mm);
    };
    const auto merit_of = [&](double log_blur) { return MeritOf(design_of(log_blur)); };
    const double first = std::log(kMinEndBlurPx);
    const double step = (std::log(kMaxEndBlurPx) - first) / (kEndBlurs - 1);
    double best = first, least = kInfinite;
    for (int i = 0; i < kEndBlurs; ++i) {
      const double merit = merit_of(first + i * step);
      if (!(merit < least)) continue;
      least = merit;
      best = first + i * step;
    }
    // Golden sections between its neighbours.
    const double golden = 0.5 * (std::sqrt(5.0) - 1);
    double low = best - step, high = best + step;
    double a = high - golden * (high - low), b = low + golden * (high - low);
    double merit_a = merit_of(a), merit_b = merit_of(b);
    for (int i = 0; i < kRefinements; ++i) {
      const bool left = merit_a <= merit_b;
      (left ? high : low) = left ? b : a;
      if (left) {
        b = std::exchange(a, high - golden * (high - low));
        merit_b = std::exchange(merit_a, merit_of(a));
      } else {
        a = std::exchange(b, low + golden * (high - low));
        merit_a = std::exchange(merit_b, merit_of(b));
      }
    }
    return design_of(std::min(merit_a, merit_b) < least ? (merit_a < merit_b ? a : b) : best);
  }

  double FeatureMm(double px) const {
    const double per_px = conditions_.texture == model::TargetKind::kDeadLeaves ? 1 : 2;
    return px * per_px * PixelAtFocusMm(conditions_);
  }

  // The size of the texture with the smallest errors in the usual range of a usual number of
  // frames.
  double BestFeature() {
    if (best_feature_mm_) return *best_feature_mm_;
    const double usual_mm = FeatureMm(kUsualFeaturePx);
    SweepDesign design = BestRange(wishes_.frames.value_or(kUsualFrames), usual_mm);
    double least = kInfinite, best = usual_mm;
    for (const double px : kFeaturesPx) {
      design.feature_size_mm = FeatureMm(px);
      const double merit = MeritOf(design);
      if (!(merit < least)) continue;
      least = merit;
      best = design.feature_size_mm;
    }
    best_feature_mm_ = Rounded(best);
    return *best_feature_mm_;
  }

  // The fewest frames between the same ends that reach the wishes, or the most.
  SweepDesign FewestFrames(const SweepDesign& usual) {
    const auto with = [&](int frames) {
      return Between(usual.nearest_mm, usual.farthest_mm(), frames, usual.feature_size_mm);
    };
    int low = kMinPlannedFrames, high = std::max(wishes_.most_frames, kMinPlannedFrames);
    if (MeritOf(with(high)) > 1) return with(high);
    while (low < high) {
      const int middle = (low + high) / 2;
      const bool misses = MeritOf(with(middle)) > 1;
      (misses ? low : high) = misses ? middle + 1 : middle;
    }
    return with(high);
  }

  // The design with a step and a first depth that can be set. Rounding must not miss the wishes.
  SweepDesign Settable(const SweepDesign& exact) {
    if (wishes_.nearest_mm) return exact;
    SweepDesign design = exact;
    for (int more = 0; more < 3; ++more) {
      design.frames = std::min(exact.frames + more, std::max(exact.frames, wishes_.most_frames));
      design.step_mm = Rounded((exact.farthest_mm() - exact.nearest_mm) / (design.frames - 1));
      const double middle_mm = 0.5 * (exact.nearest_mm + exact.farthest_mm());
      const double first_mm = middle_mm - 0.5 * design.step_mm * (design.frames - 1);
      const int decimals =
          std::max(0, 1 - static_cast<int>(std::floor(std::log10(design.step_mm))));
      const double rounded_mm = std::stod(fmt::format("{:.{}f}", first_mm, decimals));
      design.nearest_mm = std::max(rounded_mm, NearestMm());
      if (wishes_.frames || !IsWishful() || !(MeritOf(design) > 1) || MeritOf(exact) > 1) break;
    }
    return design;
  }

  double LargestPart(const ExpectedSweep& expected, const Wish& wish, std::string* name) const {
    double most = 0;
    for (const PlannedErrorPart& part : expected.parts) {
      if (!(part.sigma.*wish.error > most)) continue;
      most = part.sigma.*wish.error;
      *name = part.name;
    }
    return most;
  }

  // The effect of each change alone on one of the errors.
  std::vector<Remedy> Remedies(const Wish& wish) {
    const ExpectedSweep& now = plan_.expected;
    std::vector<Remedy> remedies;
    const auto add = [&](const std::string& text, const PlanConditions& changed,
                         const SweepDesign& design) {
      const ExpectedSweep expected = Expect(design, changed, false);
      if (expected.done) remedies.push_back({text, expected.sigma.*wish.error});
    };
    PlanConditions changed = conditions_;
    changed.offset_sigma_mm = 0.5 * now.offset_sigma_mm;
    if (now.offset_sigma_mm > 0) {
      add(now.offset_from_scale
              ? fmt::format("stating a bench offset that is known to {:.2g} mm",
                            *changed.offset_sigma_mm)
              : fmt::format("a bench offset that is known to {:.2g} mm in place of {:.2g} mm",
                            *changed.offset_sigma_mm, now.offset_sigma_mm),
          changed, now.design);
    }
    if (conditions_.blur_floor_sigma_px && *conditions_.blur_floor_sigma_px > 0) {
      changed = conditions_;
      changed.blur_floor_sigma_px = 0.5 * *conditions_.blur_floor_sigma_px;
      add(fmt::format("a blur floor that is known to {:.2g} px in place of {:.2g} px (from a knife "
                      "edge)",
                      *changed.blur_floor_sigma_px, *conditions_.blur_floor_sigma_px),
          changed, now.design);
    }
    if (conditions_.reading_sigma_mm > 0) {
      changed = conditions_;
      changed.reading_sigma_mm *= 0.5;
      add(fmt::format("readings that are good to {:.2g} mm in place of {:.2g} mm",
                      changed.reading_sigma_mm, conditions_.reading_sigma_mm),
          changed, now.design);
    }
    changed = conditions_;
    if (changed.noise_sigma) {
      *changed.noise_sigma *= 0.5;
    } else {
      changed.full_well_electrons *= 4;
      changed.read_noise_electrons *= 2;
    }
    if (changed.noise_sigma || changed.full_well_electrons > 0)
      add("half of the noise (the mean of 4 exposures of each frame)", changed, now.design);
    if (conditions_.contrast < 1) {
      changed = conditions_;
      changed.contrast = std::min(1.0, 1.5 * conditions_.contrast);
      add(fmt::format("a target of contrast {:.2g} in place of {:.2g}", changed.contrast,
                      conditions_.contrast),
          changed, now.design);
    }
    const int twice = std::min(2 * now.design.frames, kMaxPlannedFrames);
    add(fmt::format("{} frames in place of {}", twice, now.design.frames), conditions_,
        Between(now.design.nearest_mm, now.design.farthest_mm(), twice,
                now.design.feature_size_mm));
    return remedies;
  }

  std::string Advice() {
    const Wish& wish = WorstWish(plan_.expected);
    const double whole = plan_.expected.sigma.*wish.error;
    std::string name;
    const double most = LargestPart(plan_.expected, wish, &name);
    const std::vector<Remedy> remedies = Remedies(wish);
    const auto best =
        std::min_element(remedies.begin(), remedies.end(),
                         [](const auto& a, const auto& b) { return a.error < b.error; });
    const double interval = plan_.expected.floor_interval.*wish.error;
    if (interval > whole) {
      return fmt::format(
          "The largest error of {} is not statistical: the blur floor is not known, which leaves "
          "+-{:.2g}{} beside a standard deviation of {:.2g}{}; measuring the floor on a knife edge "
          "would help most.",
          wish.name, interval, wish.unit, whole, wish.unit);
    }
    std::string text =
        fmt::format("The largest part of the error of {} is that of the {} ({:.2g} of {:.2g}{})",
                    wish.name, name, most, whole, wish.unit);
    if (best != remedies.end() && best->error < whole) {
      text += fmt::format(", and {} would help most: it would leave {:.0f} % of the error",
                          best->text, 100 * best->error / whole);
    }
    return text + ".";
  }

  // The least change of one source that reaches the wishes, by bisection of its factor.
  std::optional<double> Needed(const std::function<PlanConditions(double factor)>& with) {
    const SweepDesign& design = plan_.expected.design;
    if (MeritOf(design, with(0)) > 1) return std::nullopt;
    double low = 0, high = 1;
    constexpr int kHalvings = 7;
    for (int i = 0; i < kHalvings; ++i) {
      const double middle = 0.5 * (low + high);
      (MeritOf(design, with(middle)) > 1 ? high : low) = middle;
    }
    return low;
  }

  std::string ReasonOfMiss() {
    const ExpectedSweep& best = plan_.expected;
    const Wish& wish = WorstWish(best);
    const double wanted = *(wishes_.*wish.wanted);
    std::string reason =
        fmt::format("{} frames{} reach a standard deviation of {:.3g}{} for {}, not {:.3g}{}",
                    best.design.frames, wishes_.nearest_mm ? " in this range" : "",
                    best.sigma.*wish.error, wish.unit, wish.name, wanted, wish.unit);
    std::vector<std::string> ways;
    const double offset_mm = best.offset_sigma_mm;
    if (const auto factor = Needed([&](double part) {
          PlanConditions changed = conditions_;
          changed.offset_sigma_mm = part * offset_mm;
          return changed;
        });
        factor && *factor > 0) {
      ways.push_back(
          fmt::format("a stated bench offset that is known to {:.2g} mm", *factor * offset_mm));
    }
    if (conditions_.blur_floor_sigma_px) {
      const double floor_px = *conditions_.blur_floor_sigma_px;
      if (const auto factor = Needed([&](double part) {
            PlanConditions changed = conditions_;
            changed.blur_floor_sigma_px = part * floor_px;
            return changed;
          });
          factor && *factor > 0)
        ways.push_back(fmt::format("a blur floor that is known to {:.2g} px", *factor * floor_px));
    }
    // The errors of frames and readings fall with the root of the number of frames.
    double fixed2 = 0, falling2 = 0;
    for (const PlannedErrorPart& part : best.parts) {
      const bool falls = part.name == "noise" || part.name == "readings";
      (falls ? falling2 : fixed2) += std::pow(part.sigma.*wish.error, 2);
    }
    const double room2 = wanted * wanted - fixed2;
    if (room2 > 0) {
      ways.push_back(
          fmt::format("about {:.0f} frames", std::ceil(best.design.frames * falling2 / room2)));
    }
    if (ways.empty()) {
      ways.push_back(fmt::format(
          "a smaller error of the bench offset and of the blur floor together ({:.2g}{} now)",
          std::sqrt(fixed2), wish.unit));
    }
    reason += "; needed would be ";
    for (std::size_t i = 0; i < ways.size(); ++i) reason += (i == 0 ? "" : ", or ") + ways[i];
    return reason;
  }

  void FillTarget() {
    const model::Sensor& sensor = conditions_.camera.sensor;
    const double px_mm = PixelAtFocusMm(conditions_) * plan_.expected.design.farthest_mm() /
                         conditions_.focus_depth_mm;
    plan_.target_width_mm = kMargin * sensor.width_px * px_mm;
    plan_.target_height_mm = kMargin * sensor.height_px * px_mm;
  }

  void Warn() {
    WarnOfTexture();
    WarnOfSampling();
    WarnOfRange();
    const ExpectedSweep& expected = plan_.expected;
    const double brightest =
        conditions_.light_level * (1 + conditions_.contrast) *
        (conditions_.lamp_falloff
             ? std::pow(conditions_.focus_depth_mm / expected.design.nearest_mm, 2)
             : 1);
    if (brightest > 1) {
      plan_.warnings.push_back(fmt::format(
          "the brightest detail of the nearest frame would have {:.0f} % of full scale: a light "
          "level of at most {:.2g} in the plane of focus keeps it from clipping",
          100 * brightest, conditions_.light_level / brightest));
    }
    if (expected.frames_in_fit < expected.design.frames) {
      plan_.warnings.push_back(fmt::format(
          "{} of {} frames would be blurred too strongly, or differ too much in scale, for their "
          "blur to be measured",
          expected.design.frames - expected.frames_in_fit, expected.design.frames));
    }
    if (expected.offset_from_scale) {
      plan_.warnings.emplace_back(
          "the bench offset is that of the image scale, with which the errors are predicted less "
          "exactly: simulated sweeps scattered by up to 1.2 times their prediction");
    }
    if (expected.offset_from_scale && conditions_.offset_sigma_mm) {
      plan_.warnings.push_back(
          fmt::format("the image scale would determine the bench offset to {:.2g} mm, better than "
                      "the {:.2g} mm "
                      "that are stated, and takes its place",
                      expected.offset_sigma_mm, *conditions_.offset_sigma_mm));
    }
  }

  void WarnOfTexture() {
    if (!wishes_.feature_size_mm) return;
    const double best_mm = BestFeature();
    SweepDesign design = plan_.expected.design;
    design.feature_size_mm = best_mm;
    double gain = Merit(plan_.expected) / MeritOf(design);
    if (!IsWishful()) gain = std::sqrt(gain);
    if (!(gain > kMuchWorse)) return;
    plan_.warnings.push_back(fmt::format(
        "the texture is too {} for the blur of this sweep: with {} of {:.3g} mm in place of {:.3g} "
        "mm the errors would be {:.0f} % of these",
        *wishes_.feature_size_mm > best_mm ? "coarse" : "fine",
        conditions_.texture == model::TargetKind::kDeadLeaves ? "smallest discs of a radius"
                                                              : "a shortest period",
        best_mm, *wishes_.feature_size_mm, 100 / gain));
  }

  void WarnOfSampling() {
    // Detail above this frequency is folded into the band that is measured (0.38 cycles per px).
    constexpr double kFolded = 0.62;
    constexpr double kVisible = 0.2;
    const double floor = conditions_.blur_floor_px;
    const double passed = std::exp(-2 * kPi * kPi * floor * floor * kFolded * kFolded) *
                          std::sin(kPi * kFolded) / (kPi * kFolded);
    if (passed > kVisible) {
      plan_.warnings.push_back(fmt::format(
          "the pixel pitch undersamples a lens with a blur floor of {:.2g} px: {:.0f} % of the "
          "detail at {:.2f} cycles per px is left and folded into what is measured; a smaller "
          "aperture or a texture without such fine detail avoids it",
          floor, 100 * passed, kFolded));
    }
    if (conditions_.texture == model::TargetKind::kDeadLeaves) return;
    const SweepDesign& design = plan_.expected.design;
    const double period_px = design.feature_size_mm * conditions_.focus_depth_mm /
                             (PixelAtFocusMm(conditions_) * design.farthest_mm());
    if (period_px < 2) {
      plan_.warnings.push_back(
          fmt::format("the shortest period of the texture has {:.2g} px in the farthest frame, "
                      "below the 2 px that sampling needs",
                      period_px));
    }
  }

  void WarnOfRange() {
    const SweepDesign& design = plan_.expected.design;
    const double zf = conditions_.focus_depth_mm;
    if (wishes_.nearest_mm) {
      if (!(design.nearest_mm < zf && zf < design.farthest_mm())) {
        plan_.warnings.push_back(fmt::format(
            "the plane of focus at {:.5g} mm is outside of the sweep from {:.5g} to {:.5g} mm", zf,
            design.nearest_mm, design.farthest_mm()));
      }
      return;
    }
    const double f1 = conditions_.camera.lens.front_focal_length_mm;
    if (design.nearest_mm < NearestMm() * 1.0001) {
      plan_.warnings.push_back(fmt::format(
          "more blur on the near side would reach inside the focal length of {:.4g} mm, where "
          "calibrate leaves frames out: the sweep begins at {:.5g} mm",
          f1, design.nearest_mm));
    }
    if (design.farthest_mm() > 0.95 * kFarthest * zf) {
      plan_.warnings.push_back(fmt::format(
          "the depth of field is so large that the sweep ends at {:.2g} times the in-focus "
          "distance "
          "before its blur is large: a larger aperture or a nearer focus gives smaller errors",
          kFarthest));
    }
  }

  const PlanConditions& conditions_;
  const PlanWishes& wishes_;
  SweepPlan plan_;
  std::map<double, TextureSpectrum> textures_;
  std::optional<double> best_feature_mm_;
};

}  // namespace

bool PlanConditions::IsValid(std::string* why) const {
  std::string inner;
  if (!camera.IsValid(&inner)) return Fail(why, inner);
  const double f1 = camera.lens.front_focal_length_mm;
  if (!(focus_depth_mm > f1) || !std::isfinite(focus_depth_mm)) {
    return Fail(why,
                fmt::format("focus_depth_mm is {}: it must be beyond the focal length of {:.4g} "
                            "mm",
                            focus_depth_mm, f1));
  }
  const std::pair<const char*, double> positive[] = {
      {"blur_ratio", blur_ratio}, {"contrast", contrast}, {"light_level", light_level}};
  for (const auto& [field, value] : positive) {
    if (!(value > 0 && value <= 1))
      return Fail(why, fmt::format("{} is {}: it must be above 0 and at most 1", field, value));
  }
  const std::pair<const char*, double> amounts[] = {
      {"blur_floor_px", blur_floor_px},
      {"blur_floor_sigma_px", blur_floor_sigma_px.value_or(0)},
      {"full_well_electrons", full_well_electrons},
      {"read_noise_electrons", read_noise_electrons},
      {"noise_sigma", noise_sigma.value_or(0)},
      {"reading_sigma_mm", reading_sigma_mm},
      {"offset_sigma_mm", offset_sigma_mm.value_or(0)}};
  for (const auto& [field, value] : amounts) {
    if (!IsAmount(value))
      return Fail(why, fmt::format("{} is {}: it must be finite and >= 0", field, value));
  }
  if (bits != 8 && bits != 16)
    return Fail(why, fmt::format("bits is {}: it must be 8 or 16", bits));
  return HasSpectrum(texture) ||
         Fail(why, fmt::format("texture is {}: only dead-leaves, white-noise and pink-noise can be "
                               "planned",
                               model::TargetKindName(texture)));
}

bool PlanWishes::IsValid(std::string* why) const {
  const std::pair<const char*, const std::optional<double>*> sizes[] = {
      {"focus_depth_mm", &focus_depth_mm}, {"image_distance_mm", &image_distance_mm},
      {"blur_ratio", &blur_ratio},         {"nearest_mm", &nearest_mm},
      {"farthest_mm", &farthest_mm},       {"feature_size_mm", &feature_size_mm}};
  for (const auto& [field, value] : sizes) {
    if (*value && !IsPositive(**value))
      return Fail(why, fmt::format("{} is {}: it must be finite and > 0", field, **value));
  }
  if (nearest_mm.has_value() != farthest_mm.has_value())
    return Fail(why, "nearest_mm and farthest_mm must be given together");
  if (nearest_mm && !(*nearest_mm < *farthest_mm)) {
    return Fail(why, fmt::format("nearest_mm is {}: it must be below farthest_mm, {}", *nearest_mm,
                                 *farthest_mm));
  }
  if (frames && !(*frames >= kMinPlannedFrames && *frames <= kMaxPlannedFrames)) {
    return Fail(why, fmt::format("frames is {}: it must be from {} to {}", *frames,
                                 kMinPlannedFrames, kMaxPlannedFrames));
  }
  return (most_frames >= kMinPlannedFrames && most_frames <= kMaxPlannedFrames) ||
         Fail(why, fmt::format("most_frames is {}: it must be from {} to {}", most_frames,
                               kMinPlannedFrames, kMaxPlannedFrames));
}

SweepPlan PlanSweep(const PlanConditions& conditions, const PlanWishes& wishes) {
  std::string why;
  if (!conditions.IsValid(&why) || !wishes.IsValid(&why)) throw Error("plan: " + why);
  const double f1 = conditions.camera.lens.front_focal_length_mm;
  if (wishes.nearest_mm && !(*wishes.nearest_mm > f1)) {
    throw Error(fmt::format(
        "plan: the sweep would begin at {:.5g} mm, inside the focal length of {:.5g} mm, where "
        "calibrate leaves frames out: a nearest depth beyond it is needed",
        *wishes.nearest_mm, f1));
  }
  return Search(conditions, wishes).Run();
}

}  // namespace thicklens::calib

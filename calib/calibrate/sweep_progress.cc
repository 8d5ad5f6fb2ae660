#include "thicklens/calib/sweep_progress.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "calib/calibrate/plan_texture.h"
#include "calib/calibrate/recognised_target.h"
#include "calib/calibrate/sweep_conditions.h"
#include "calib/calibrate/zero_choice.h"
#include "calib/edges/edge_blur.h"
#include "calib/fit/blur_measurement.h"
#include "calib/fit/known_focus.h"
#include "calib/sharpness/sharpest_reading.h"
#include "calib/sharpness/sharpness.h"
#include "calib/sweep/frame_selection.h"
#include "thicklens/base/error.h"
#include "thicklens/base/statistics.h"
#include "thicklens/base/validity.h"
#include "thicklens/model/conjugates.h"

namespace thicklens::calib {
namespace {

// Thresholds of the sharpness are powers of this ratio, so that frames that were measured at
// different times have thresholds in common.
constexpr double kThresholdRatio = 1.25;
// A later frame may be sharper than all before by this factor.
constexpr double kMaxSharper = 64;
constexpr int kMinFramesOfSide = 4;  // usable frames on each side of focus
constexpr int kMaxMoreFrames = 64;   // the most that are proposed at one end
constexpr int kMinFramesOfPrediction = 7;
constexpr double kSeenGrowthPx2 = 0.5;  // growth of the blur's variance that is beyond its error

int StepOf(double threshold) {
  return static_cast<int>(std::floor(std::log(threshold) / std::log(kThresholdRatio)));
}

// A frame with its sharpness at each threshold from that of its own gradients upwards.
struct MeasuredFrame {
  FrameMeasurement measurement;
  int first_step = 0;             // of the first threshold, gradient over mean light, per px
  std::vector<double> sharpness;  // mean edge slope over mean light, per px, by threshold
  std::vector<int> edges;         // number of edge pixels, likewise
};

double RelativeGradient(const FrameMeasurement& frame) {
  const FrameStatistics& s = frame.statistics;
  return s.mean_linear > 0 ? s.top_gradient / s.mean_linear : 0;
}

}  // namespace

bool SweepProgressOptions::IsValid(std::string* why) const {
  if (!(wanted_blur_ratio_error > 0 && wanted_blur_ratio_error < 1)) {
    return Fail(why, fmt::format("wanted_blur_ratio_error is {}: it must be above 0 and below 1",
                                 wanted_blur_ratio_error));
  }
  std::string inner;
  return checks.IsValid(&inner) || Fail(why, "checks." + inner);
}

struct SweepProgress::Impl {
  Impl(const FocusSweep& conditions, const SweepProgressOptions& with)
      : sweep(conditions), options(with) {
    sweep.frames.clear();
  }

  void Add(const model::SweepFrame& frame, const cv::Mat& stored);
  SweepProgressReport Report() const;

  // Compares the measurements as Calibrate does.
  std::vector<FrameMeasurement> Compared(std::vector<std::size_t>* used) const;

  FocusSweep sweep;
  SweepProgressOptions options;
  std::vector<MeasuredFrame> frames;
};

void SweepProgress::Impl::Add(const model::SweepFrame& frame, const cv::Mat& stored) {
  sweep.frames.push_back(frame);
  MeasuredFrame measured;
  try {
    const std::size_t index = sweep.frames.size() - 1;
    const cv::Mat grey = LinearGrey(stored, sweep, index);
    FrameMeasurement& m = measured.measurement;
    m.image = frame.Name();
    m.reading_mm = frame.reading_mm;
    m.statistics = MeasureFrame(RegionOf(stored, sweep, index), grey);
    const double own = kEdgeThreshold * RelativeGradient(m);
    if (own > 0) {
      measured.first_step = StepOf(own);
      std::vector<double> thresholds;
      for (double part = 1; part <= kMaxSharper * kThresholdRatio; part *= kThresholdRatio)
        thresholds.push_back(std::pow(kThresholdRatio, measured.first_step) * part *
                             m.statistics.mean_linear);
      for (const SharpnessIndex& at : MeanEdgeSlopes(grey, {}, thresholds)) {
        measured.sharpness.push_back(at.mean_edge_slope / m.statistics.mean_linear);
        measured.edges.push_back(at.edge_count);
      }
    }
    if (const auto blur = MeasureSourceEdgeBlur(grey)) m.source_blur_sigma_px = blur->sigma_px;
  } catch (...) {
    sweep.frames.pop_back();
    throw;
  }
  frames.push_back(std::move(measured));
}

std::vector<FrameMeasurement> SweepProgress::Impl::Compared(std::vector<std::size_t>* used) const {
  std::vector<FrameMeasurement> compared;
  for (const MeasuredFrame& frame : frames) compared.push_back(frame.measurement);
  FrameSelection selection(&compared);
  selection.KeepMeasurable(ChecksFor(sweep.target, options.checks));
  double steepest = 0;
  for (const std::size_t i : selection.used())
    steepest = std::max(steepest, RelativeGradient(compared[i]));
  const int step = steepest > 0 ? StepOf(kEdgeThreshold * steepest) : 0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const int at = step - frames[i].first_step;
    if (at < 0 || at >= static_cast<int>(frames[i].sharpness.size())) continue;
    compared[i].normalised_edge_slope = frames[i].sharpness[static_cast<std::size_t>(at)];
    compared[i].edge_count = frames[i].edges[static_cast<std::size_t>(at)];
  }
  if (sweep.target != model::SweepTarget::kPoints) selection.KeepThoseWithEdges();
  *used = selection.used();
  return compared;
}

namespace {

// Finds what is missing in a sweep, by its usable frames.
class MissingFrames {
 public:
  MissingFrames(const FocusSweep& sweep, const SweepProgressOptions& options,
                const std::vector<FrameMeasurement>& frames, const std::vector<std::size_t>& used,
                SweepProgressReport* report)
      : sweep_(sweep), options_(options), report_(*report) {
    for (const std::size_t i : used) frames_.push_back(&frames[i]);
    std::stable_sort(frames_.begin(), frames_.end(),
                     [](const auto* a, const auto* b) { return a->reading_mm < b->reading_mm; });
  }

  void Run() {
    std::set<double> readings;
    for (const FrameMeasurement* frame : frames_) readings.insert(frame->reading_mm);
    if (readings.size() < kMinFrames) {
      Say(fmt::format("{} usable frame{} with different readings, but at least {} are needed",
                      readings.size(), readings.size() == 1 ? "" : "s", kMinFrames));
      return;
    }
    if (!report_.sharpest.done) {
      SayWhereFocusIs();
      return;
    }
    focus_mm_ = report_.sharpest.reading_mm.value;
    for (const FrameMeasurement* frame : frames_) {
      report_.below_focus += frame->reading_mm < focus_mm_ ? 1 : 0;
      report_.above_focus += frame->reading_mm > focus_mm_ ? 1 : 0;
    }
    if (Predict()) {
      if (report_.blur_ratio_error && *report_.blur_ratio_error <= Wanted()) {
        SayShortSides();
      } else {
        ProposeFrames();
      }
    } else {
      SayShortSides();
    }
    report_.is_enough = report_.missing.empty();
  }

 private:
  void Say(const std::string& text) { report_.missing.push_back(text); }
  // A prediction is of kConditionsPx at most, and a larger region has the smaller error.
  const char* AtMost() const { return report_.is_error_at_most ? "at most " : ""; }
  std::string Reading(double reading_mm) const {
    return sweep_.readings_are_counts ? fmt::format("{:.6g} steps", reading_mm)
                                      : ReadingInWords(sweep_, reading_mm);
  }
  double Wanted() const { return options_.wanted_blur_ratio_error; }
  double Sign() const { return model::DirectionSign(sweep_.direction); }

  std::string SideInWords(bool above) const {
    if (sweep_.moves && model::MovesFocus(*sweep_.moves))
      return above ? "side of the larger readings" : "side of the smaller readings";
    return above == (Sign() > 0) ? "far side" : "near side";
  }
  int CountOf(bool above) const { return above ? report_.above_focus : report_.below_focus; }
  double EndMm(bool above) const {
    return above ? frames_.back()->reading_mm : frames_.front()->reading_mm;
  }
  std::string HasFrames(bool above) const {
    return fmt::format("the {} of the focus has {} frame{}", SideInWords(above), CountOf(above),
                       CountOf(above) == 1 ? "" : "s");
  }

  void SayWhereFocusIs() {
    const auto sharpest = std::max_element(frames_.begin(), frames_.end(), [](auto* a, auto* b) {
      return a->normalised_edge_slope < b->normalised_edge_slope;
    });
    const bool at_first = sharpest == frames_.begin();
    if (at_first || sharpest + 1 == frames_.end()) {
      Say(fmt::format(
          "no frame is beyond the focus yet: the sharpness rises up to reading {}; take "
          "frames beyond it",
          Reading((*sharpest)->reading_mm)));
    } else {
      Say(fmt::format("the focus is near reading {}; more frames around it determine it",
                      Reading((*sharpest)->reading_mm)));
    }
  }

  void SayShortSides() {
    for (const bool above : {false, true}) {
      if (CountOf(above) >= kMinFramesOfSide) continue;
      Say(fmt::format("{}; at least {} are needed to compare the two sides", HasFrames(above),
                      kMinFramesOfSide));
    }
  }

  // zf by what is stated, or by the growth of the blur with a usual blur ratio [D131].
  double FocusDepthMm(std::optional<double>* offset_sigma_mm) const {
    const double f1 = sweep_.camera.lens.front_focal_length_mm;
    if (sweep_.offset_mm) {
      *offset_sigma_mm = sweep_.offset_mm->sigma;
      return sweep_.offset_mm->value + Sign() * focus_mm_;
    }
    if (const auto stated = MostPrecise(sweep_.camera, sweep_.stated_focus)) {
      const model::Estimate zf = FocusDepthWithTolerance(sweep_.camera, *stated);
      *offset_sigma_mm = zf.sigma;
      return zf.value;
    }
    double least_px2 = std::numeric_limits<double>::infinity();
    for (const FrameMeasurement* frame : frames_) {
      if (frame->source_blur_sigma_px > 0)
        least_px2 = std::min(least_px2, std::pow(frame->source_blur_sigma_px, 2));
    }
    std::vector<double> slopes;  // px per mm
    for (const FrameMeasurement* frame : frames_) {
      const double added_px2 = std::pow(frame->source_blur_sigma_px, 2) - least_px2;
      if (!(frame->source_blur_sigma_px > 0) || !(added_px2 > kSeenGrowthPx2)) continue;
      slopes.push_back(std::sqrt(added_px2) / std::abs(frame->reading_mm - focus_mm_));
    }
    if (slopes.empty()) return 0;
    const double slope = Median(slopes);
    if (!(slope > 0) || !std::isfinite(slope)) return 0;
    const double product_mm2 = kDefaultRatio * sweep_.camera.lens.aperture_radius_mm /
                               sweep_.camera.sensor.pixel_pitch_mm * f1 / slope;
    return 0.5 * (f1 + std::sqrt(f1 * f1 + 4 * product_mm2));
  }

  // Predicts the error of kappa. Returns false where this is not possible.
  bool Predict() {
    if (frames_.size() < kMinFramesOfPrediction || sweep_.readings_are_counts ||
        (sweep_.moves && model::MovesFocus(*sweep_.moves)))
      return false;
    std::optional<double> offset_sigma_mm;
    const double zf = FocusDepthMm(&offset_sigma_mm);
    if (!(zf > sweep_.camera.lens.front_focal_length_mm)) return false;
    conditions_ = ConditionsOfFrames(sweep_, frames_, zf, kDefaultRatio);
    conditions_.reading_sigma_mm = sweep_.reading_sigma_mm;
    conditions_.offset_sigma_mm = offset_sigma_mm;
    const double a_mm = zf + Sign() * (frames_.front()->reading_mm - focus_mm_);
    const double b_mm = zf + Sign() * (frames_.back()->reading_mm - focus_mm_);
    design_.frames = static_cast<int>(frames_.size());
    design_.nearest_mm = std::min(a_mm, b_mm);
    design_.step_mm = std::abs(b_mm - a_mm) / (design_.frames - 1);
    if (!conditions_.IsValid(nullptr) || !(design_.step_mm > 0)) return false;
    design_.feature_size_mm = UsualTextureMm(conditions_);
    texture_.emplace(TextureOf(conditions_, design_.feature_size_mm));
    report_.blur_ratio_error = ErrorOf(conditions_, design_);
    const cv::Size region = RegionSize(sweep_);
    report_.is_error_at_most = region.width > kConditionsPx || region.height > kConditionsPx;
    return true;
  }

  std::optional<double> ErrorOf(const PlanConditions& conditions, const SweepDesign& design) {
    if (!(design.nearest_mm > conditions.camera.lens.front_focal_length_mm)) return std::nullopt;
    const ExpectedSweep expected = ExpectSweepOf(conditions, design, *texture_, false);
    message_ = expected.message;
    if (!expected.done) return std::nullopt;
    return expected.sigma.blur_ratio / conditions.blur_ratio;
  }

  SweepDesign Longer(bool above, int more) const {
    SweepDesign design = design_;
    design.frames += more;
    if (above != (Sign() > 0)) design.nearest_mm -= more * design.step_mm;
    return design;
  }

  // The fewest frames beyond one end that reach the wanted error; absent if none do.
  std::optional<int> FewestBeyond(bool above) {
    const bool is_far = above == (Sign() > 0);
    const double room_mm = is_far
                               ? kFarthestDepth * conditions_.focus_depth_mm - design_.farthest_mm()
                               : design_.nearest_mm - NearestDepthMm(conditions_);
    const int most =
        std::min(kMaxMoreFrames, static_cast<int>(std::floor(room_mm / design_.step_mm)));
    const auto reaches = [&](int more) {
      const std::optional<double> error = ErrorOf(conditions_, Longer(above, more));
      return error && *error <= Wanted();
    };
    if (most < 1 || !reaches(most)) return std::nullopt;
    int low = 1, high = most;
    while (low < high) {
      const int middle = (low + high) / 2;
      const bool is_enough = reaches(middle);
      (is_enough ? high : low) = is_enough ? middle : middle + 1;
    }
    return high;
  }

  void ProposeFrames() {
    const std::string now = message_;
    // The end with less defocus first: it has more to gain.
    const auto reach = [this](bool above) { return std::abs(EndMm(above) - focus_mm_); };
    const bool shorter_above = reach(true) < reach(false);
    std::optional<int> more = FewestBeyond(shorter_above);
    bool above = shorter_above;
    if (const auto other = FewestBeyond(!shorter_above); other && (!more || *other < *more)) {
      more = other;
      above = !shorter_above;
    }
    if (more) {
      Say(fmt::format("{}; {}{} more beyond reading {} fix kappa to {:.2g} %", HasFrames(above),
                      AtMost(), *more, Reading(EndMm(above)), 100 * Wanted()));
      return;
    }
    SayShortSides();
    if (!report_.blur_ratio_error) {
      Say("kappa cannot be predicted: " + now);
      return;
    }
    // Neither end suffices: what the bench offset alone does decides what to say.
    PlanConditions exact = conditions_;
    exact.offset_sigma_mm = 0;
    const std::optional<double> with_exact = ErrorOf(exact, design_);
    if (with_exact && *with_exact <= Wanted()) {
      Say(
          fmt::format("kappa is expected to {}{:.2g} %, mostly by the error of the bench offset: "
                      "state offset_mm or the magnification more exactly",
                      AtMost(), 100 * *report_.blur_ratio_error));
      return;
    }
    Say(
        fmt::format("kappa is expected to {}{:.2g} %, not {:.2g} %: {}{:.0f} frames in place of "
                    "{} over the same range would be needed",
                    AtMost(), 100 * *report_.blur_ratio_error, 100 * Wanted(),
                    report_.is_error_at_most ? "at most " : "about ",
                    std::ceil(design_.frames * std::pow(*report_.blur_ratio_error / Wanted(), 2)),
                    design_.frames));
  }

  const FocusSweep& sweep_;
  const SweepProgressOptions& options_;
  SweepProgressReport& report_;
  std::vector<const FrameMeasurement*> frames_;  // usable, by rising reading
  double focus_mm_ = 0;                          // reading
  PlanConditions conditions_;
  SweepDesign design_;
  std::optional<TextureSpectrum> texture_;
  std::string message_;  // of the last prediction
};

}  // namespace

SweepProgressReport SweepProgress::Impl::Report() const {
  SweepProgressReport report;
  report.readings_are_counts = sweep.readings_are_counts;
  std::vector<std::size_t> used;
  const std::vector<FrameMeasurement> compared = Compared(&used);
  for (const FrameMeasurement& frame : compared) {
    report.frames.push_back(
        {frame.image, frame.reading_mm, frame.normalised_edge_slope, frame.rejection});
    ++(frame.rejection.empty() ? report.usable : report.rejected);
  }
  report.sharpest = FindSharpestReading(compared, used);
  MissingFrames(sweep, options, compared, used, &report).Run();
  return report;
}

SweepProgress::SweepProgress(const FocusSweep& conditions, const SweepProgressOptions& options) {
  std::string why;
  if (!options.IsValid(&why)) throw Error("sweep progress: " + why);
  impl_ = std::make_unique<Impl>(conditions, options);
}
SweepProgress::~SweepProgress() = default;
SweepProgress::SweepProgress(SweepProgress&&) noexcept = default;
SweepProgress& SweepProgress::operator=(SweepProgress&&) noexcept = default;

void SweepProgress::Add(const model::SweepFrame& frame, const cv::Mat& stored) {
  impl_->Add(frame, stored);
}
void SweepProgress::SetReading(std::size_t index, double reading_mm) {
  if (index >= impl_->frames.size()) {
    throw Error(
        fmt::format("sweep progress: frame {} of {} does not exist", index, impl_->frames.size()));
  }
  impl_->frames[index].measurement.reading_mm = reading_mm;
  impl_->sweep.frames[index].reading_mm = reading_mm;
}
std::size_t SweepProgress::size() const { return impl_->frames.size(); }
SweepProgressReport SweepProgress::Report() const { return impl_->Report(); }

}  // namespace thicklens::calib

#include "thicklens/calib/calibrate.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <mutex>
#include <numeric>
#include <set>

#include "blur_measurement.h"
#include "edge_pixels.h"
#include "field_map.h"
#include "focus_solution.h"
#include "frame_store.h"
#include "reading_gates.h"
#include "scale_tracking.h"
#include "sharpness_peak.h"
#include "source_recipe.h"
#include "systematic_parts.h"
#include "target_period.h"
#include "thicklens/calib/edge_blur.h"
#include "thicklens/calib/sharpness.h"
#include "thicklens/error.h"
#include "thicklens/model/parallel.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kFewestFrames = 5;
// Edge pixels of the sharpness index: gradients above this part of the sweep's steepest.
constexpr double kEdgeThreshold = 0.25;
// Fewer edges than this and a contrast below this part of the median: the target is not to be seen.
constexpr int kFewestEdges = 12;
constexpr double kFaintContrast = 0.5;
// Unless it still shows where the noise is averaged out.
constexpr double kClearTexture = 3;
// Files are named as the table of readings names them, not by where they lie on this machine.
std::string FileName(const std::string& image) {
  return std::filesystem::path(image).filename().string();
}

class Calibrator {
 public:
  Calibrator(const FocusSweep& sweep, const CalibrationOptions& options)
      : sweep_(sweep), options_(options), store_(sweep) {
    total_steps_ = 4 * static_cast<int>(sweep.frames.size());
    for (const model::SweepFrame& frame : sweep.frames) {
      FrameMeasurement measurement;
      measurement.image = frame.image;
      measurement.reading_mm = frame.reading_mm;
      result_.frames.push_back(measurement);
    }
  }

  Calibration Run() {
    const auto begin = std::chrono::steady_clock::now();
    if (MeasureAndGate() && MeasureSharpness() && FindDepths()) {
      result_.source = RunSourceRecipe(sweep_.camera, result_.frames, used_);
      FitPeak();
      MeasureAndSolve();
    }
    result_.frames_used =
        result_.blur.done ? result_.blur.frames_used : static_cast<int>(used_.size());
    result_.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    return std::move(result_);
  }

 private:
  bool Refuse(const std::string& reason) {
    result_.outcome = Outcome::kRefused;
    result_.reason = reason;
    return false;
  }

  void Tick() {
    if (!options_.progress) return;
    const std::lock_guard<std::mutex> lock(progress_mutex_);
    if (!options_.progress(std::min(++steps_done_, total_steps_), total_steps_))
      throw Interrupted();
  }

  template <typename Work>
  void ForEachUsed(const Work& work) {
    model::ParallelFor(static_cast<int>(used_.size()), options_.threads, [&](int i) {
      work(used_[static_cast<std::size_t>(i)]);
      Tick();
    });
  }

  cv::Mat Grey(std::size_t frame) { return store_.Grey(frame); }

  // Absolute gates on every frame, then the blank gate against the median of those that passed.
  bool MeasureAndGate() {
    std::string why;
    if (!HasEnoughFrames(sweep_, &why)) return Refuse(why);
    model::ParallelFor(static_cast<int>(sweep_.frames.size()), options_.threads, [&](int i) {
      const auto index = static_cast<std::size_t>(i);
      result_.frames[index].statistics =
          MeasureFrame(RegionOf(store_.Stored(index), sweep_, index), store_.Grey(index));
      Tick();
    });
    GateOptions gates = options_.gates;
    gates.edge_target |= sweep_.target == model::SweepTarget::kKnifeEdge;
    std::vector<double> contrasts;
    for (const FrameMeasurement& frame : result_.frames) {
      if (!RejectionReason(frame.statistics, 0, gates))
        contrasts.push_back(frame.statistics.contrast);
    }
    const double median_contrast = Median(contrasts);
    used_.resize(sweep_.frames.size());
    std::iota(used_.begin(), used_.end(), std::size_t{0});
    const auto reason = [&](std::size_t i) {
      return RejectionReason(result_.frames[i].statistics, median_contrast, gates);
    };
    return KeepOnly([&](std::size_t i) { return !reason(i); },
                    [&](std::size_t i) { return *reason(i); });
  }

  bool MeasureSharpness() {
    double steepest = 0, steepest_relative = 0;
    for (const std::size_t i : used_) {
      const FrameStatistics& s = result_.frames[i].statistics;
      steepest = std::max(steepest, s.top_gradient);
      steepest_relative = std::max(steepest_relative, s.top_gradient / s.mean_linear);
    }
    ForEachUsed([&](std::size_t i) {
      FrameMeasurement& frame = result_.frames[i];
      const cv::Mat grey = Grey(i);
      const double mean = frame.statistics.mean_linear;
      const std::vector<SharpnessIndex> indices = MeanEdgeSlopes(
          grey, {}, {kEdgeThreshold * steepest, kEdgeThreshold * steepest_relative * mean});
      frame.mean_edge_slope = indices[0].mean_edge_slope;
      frame.normalised_edge_slope = indices[1].mean_edge_slope / mean;
      frame.edge_count = indices[1].edge_count;
      if (const auto blur = MeasureSourceEdgeBlur(grey))
        frame.source_blur_sigma_px = blur->sigma_px;
    });
    reference_ = *std::max_element(used_.begin(), used_.end(), [&](std::size_t a, std::size_t b) {
      return result_.frames[a].normalised_edge_slope < result_.frames[b].normalised_edge_slope;
    });
    return RejectFramesWithoutEdges();
  }

  // Shading alone passes the gates of contrast and gradient. What has no edge worth the name and
  // little contrast besides does not show the target any more.
  bool RejectFramesWithoutEdges() {
    std::vector<double> contrasts;
    for (const std::size_t i : used_) contrasts.push_back(result_.frames[i].statistics.contrast);
    const double median_contrast = Median(contrasts);
    const auto shows_target = [&](std::size_t i) {
      const FrameMeasurement& frame = result_.frames[i];
      return frame.edge_count >= kFewestEdges ||
             frame.statistics.contrast >= kFaintContrast * median_contrast ||
             frame.statistics.coarse_texture >= kClearTexture;
    };
    return KeepOnly(shows_target, [&](std::size_t i) {
      return fmt::format(
          "no edges: {} above {:.0f} % of the sweep's steepest, contrast {:.3f} against a median "
          "of {:.3f}",
          result_.frames[i].edge_count, 100 * kEdgeThreshold, result_.frames[i].statistics.contrast,
          median_contrast);
    });
  }

  // Rejects the used frames that fail; refuses if too few are left.
  template <typename Passes, typename Reason>
  bool KeepOnly(const Passes& passes, const Reason& reason) {
    std::set<double> distinct;
    std::vector<std::size_t> kept;
    for (const std::size_t i : used_) {
      if (passes(i)) {
        kept.push_back(i);
        distinct.insert(result_.frames[i].reading_mm);
      } else {
        result_.frames[i].rejection = reason(i);
      }
    }
    used_ = kept;
    if (distinct.size() >= kFewestFrames) return true;
    return Refuse(TooFewUsable(distinct.size()));
  }

  // "3 of 35 frames are usable, 5 at different readings are needed: 30 dark, 2 blank
  // (frame_000.png: ...)".
  std::string TooFewUsable(std::size_t distinct_readings) const {
    std::map<std::string, int> counts;
    std::string first;
    for (const FrameMeasurement& frame : result_.frames) {
      if (frame.rejection.empty()) continue;
      ++counts[frame.rejection.substr(0, frame.rejection.find_first_of(":,0123456789"))];
      if (first.empty()) first = FileName(frame.image) + ": " + frame.rejection;
    }
    std::string reasons;
    for (const auto& [name, count] : counts) {
      reasons += fmt::format("{}{} {}", reasons.empty() ? "" : ", ", count, name);
    }
    return fmt::format(
        "{} of {} frames are usable, at {} different readings; {} are needed: {} ({})",
        used_.size(), sweep_.frames.size(), distinct_readings, kFewestFrames, reasons, first);
  }

  // The bench zero, given or from the image scale; then every frame's depth.
  bool FindDepths() {
    std::optional<double> known_mm;
    if (sweep_.offset_mm) known_mm = sweep_.offset_mm->value;
    const std::vector<ScaleSample> samples = TrackScale(
        sweep_, [this](std::size_t frame) { return Grey(frame); }, used_, reference_, known_mm,
        options_.threads, [this] { Tick(); });
    for (const ScaleSample& sample : samples) {
      result_.frames[sample.frame].image_scale = sample.scale;
      result_.frames[sample.frame].image_scale_sigma = sample.registration.scale_sigma;
    }
    result_.scale = FitScaleLaw(samples, static_cast<int>(reference_), sweep_.reading_sigma_mm,
                                sweep_.direction, RegionCornerRadiusPx(sweep_));
    if (const auto reason = ReasonAgainstScales(sweep_, result_.frames, used_, result_.scale))
      return Refuse(*reason);
    RejectUnregistered(samples);
    RejectWrongReadings(sweep_, samples, result_.scale, &result_.frames);
    if (!KeepOnly([&](std::size_t i) { return result_.frames[i].rejection.empty(); },
                  [&](std::size_t i) { return result_.frames[i].rejection; }))
      return false;
    for (const ScaleSample& sample : samples) {
      if (!result_.frames[sample.frame].rejection.empty()) continue;
      scales_.push_back(sample);
      result_.frames[sample.frame].in_scale_fit = result_.scale.done;
    }
    ReplaceReference();
    if (sweep_.offset_mm) {
      result_.bench_offset_mm =
          Result{sweep_.offset_mm->value, sweep_.offset_mm->sigma, std::nullopt};
      WarnOfScale();
    } else if (result_.scale.done) {
      result_.bench_offset_mm = result_.scale.offset_mm;
    } else {
      return Refuse("offset_mm is unknown and was not found: " + result_.scale.message);
    }
    WarnOfDistortion();
    slip_ = FindSlip(scales_, result_.scale);
    const double sign = model::DirectionSign(sweep_.direction);
    for (FrameMeasurement& frame : result_.frames) {
      frame.depth_mm = result_.bench_offset_mm->value + sign * frame.reading_mm;
    }
    return RejectImpossibleDepths();
  }

  // The sharpest frame may be the one whose reading is wrong: the next sharpest takes its place,
  // and what was registered to the one is said of the other.
  //   p = c + t_i + s_i R_i (p_0 - c) for the frame and for the new reference r gives
  //   scale s_i/s_r, rotation R_i R_r^-1, shift t_i - (s_i/s_r) R_i R_r^-1 t_r.
  void ReplaceReference() {
    if (result_.frames[reference_].rejection.empty()) return;
    const ScaleSample* next = nullptr;
    for (const ScaleSample& sample : scales_) {
      if (next == nullptr || result_.frames[sample.frame].normalised_edge_slope >
                                 result_.frames[next->frame].normalised_edge_slope)
        next = &sample;
    }
    if (next == nullptr) {
      reference_ = used_.front();
      return;
    }
    const Registration base = next->registration;
    reference_ = next->frame;
    for (ScaleSample& sample : scales_) {
      Registration& r = sample.registration;
      const double ratio = r.scale / base.scale;
      const double angle = r.rotation_rad - base.rotation_rad;
      const double c = std::cos(angle), s = std::sin(angle);
      const Eigen::Vector2d turned(c * base.shift_px.x() - s * base.shift_px.y(),
                                   s * base.shift_px.x() + c * base.shift_px.y());
      r.shift_px -= ratio * turned;
      r.scale = ratio;
      r.scale_x /= base.scale_x;
      r.scale_y /= base.scale_y;
      r.rotation_rad = angle;
      sample.scale = ratio;
    }
  }

  // Where the others follow a law, a frame that does not register shows something else.
  void RejectUnregistered(const std::vector<ScaleSample>& samples) {
    if (!result_.scale.done) return;
    std::set<std::size_t> registered;
    for (const ScaleSample& sample : samples) registered.insert(sample.frame);
    for (const std::size_t i : used_) {
      if (registered.count(i) > 0) continue;
      result_.frames[i].rejection =
          fmt::format("does not show the target of {}: the two cannot be registered",
                      FileName(result_.frames[reference_].image));
    }
  }

  void WarnOfDistortion() {
    const auto& distortion = result_.scale.distortion_at_corner;
    if (!distortion || !(std::abs(distortion->value) > std::max(0.005, 4 * distortion->sigma)))
      return;
    result_.warnings.push_back(
        fmt::format("the pictures are distorted: {:+.1f} +- {:.1f} % at the corner ({}); undistort "
                    "them first, depth and blur are those of an undistorted camera",
                    100 * distortion->value, 100 * distortion->sigma,
                    distortion->value > 0 ? "pincushion" : "barrel"));
  }

  // Nearer than the front focal point no image forms: such a frame shows something else, such as
  // the lens resting on the target.
  bool RejectImpossibleDepths() {
    const double nearest_mm = sweep_.camera.lens.front_focal_length_mm;
    return KeepOnly(
        [&](std::size_t i) { return result_.frames[i].depth_mm > nearest_mm; },
        [&](std::size_t i) {
          return fmt::format(
              "depth {:.3f} mm with the bench zero at {:.3f} mm, nearer than the front focal "
              "point ({} mm): check offset_mm, direction and units",
              result_.frames[i].depth_mm, result_.bench_offset_mm->value, nearest_mm);
        });
  }

  void WarnOfScale() {
    const ScaleLaw& law = result_.scale;
    if (!law.done) {
      result_.warnings.push_back("the given offset_mm could not be checked: " + law.message);
      return;
    }
    const double apart_mm = law.offset_mm.value - sweep_.offset_mm->value;
    const double sigma_mm = std::hypot(law.offset_mm.sigma, sweep_.offset_mm->sigma);
    if (std::abs(apart_mm) > 3 * sigma_mm + 1e-3 * law.reference_depth_mm) {
      result_.warnings.push_back(
          fmt::format("the image scale puts the bench zero at {:.2f} +- {:.2f} mm, {:+.2f} mm from "
                      "the given one",
                      law.offset_mm.value, law.offset_mm.sigma, apart_mm));
    }
  }

  void FitPeak() {
    std::vector<SharpnessSample> samples;
    for (const std::size_t i : used_) {
      samples.push_back({result_.frames[i].depth_mm, result_.frames[i].normalised_edge_slope});
    }
    result_.sharpness = FitSharpnessPeak(samples);
  }

  // Flat and defocused frames show the noise alone; a fine texture in focus passes for noise.
  double SweepNoise() const {
    std::vector<double> noises;
    for (const std::size_t i : used_) noises.push_back(result_.frames[i].statistics.noise_sigma);
    std::sort(noises.begin(), noises.end());
    return noises[noises.size() / 10];
  }

  void MeasureAndSolve() {
    const double start_mm = result_.sharpness.done ? result_.sharpness.focus_depth_mm
                                                   : result_.frames[reference_].depth_mm;
    BlurTask task(sweep_, store_);
    task.frames = used_;
    task.reference = reference_;
    task.scales = scales_;
    task.law =
        result_.scale.kind == ScaleKind::kConstant ? BlurLaw::kTelecentric : BlurLaw::kPerspective;
    task.scale_follows_readings = result_.scale.done;
    task.offset_mm = {result_.bench_offset_mm->value, result_.bench_offset_mm->sigma};
    task.reading_sigma_mm = sweep_.reading_sigma_mm;
    task.reading_sigma_is_known = sweep_.reading_sigma_mm > 0;
    if (!task.reading_sigma_is_known && result_.scale.done) {
      // Nobody stated it, but the scale law has measured it.
      task.reading_sigma_mm = result_.scale.reading_rms_mm;
    }
    const auto [nearest, farthest] = DepthRange();
    task.start_focus_depth_mm = std::clamp(start_mm, nearest, farthest);
    task.pixel_noise = SweepNoise();
    task.threads = options_.threads;
    task.tick = [this] { Tick(); };
    BlurEvidence evidence = MeasureBlur(task);
    BlurFitResult fit;
    SolveFocus(sweep_, &evidence, &fit, &result_);
    CheckMagnification();
    if (slip_ && result_.outcome != Outcome::kRefused) {
      const FrameMeasurement& frame = result_.frames[slip_->frame];
      result_.warnings.push_back(fmt::format(
          "the readings jump by {:+.2f} +- {:.2f} mm against the image scale from {} (reading {} "
          "mm) "
          "on: check the clamp and the table of readings there",
          slip_->jump_mm.value, slip_->jump_mm.sigma, FileName(frame.image), frame.reading_mm));
      WidenFocus("jump of the readings", std::abs(slip_->jump_mm.value),
                 "find what slipped, or take the sweep again", sweep_.camera.lens, &result_);
    }
    if (options_.map_field && result_.outcome != Outcome::kRefused)
      MapField(sweep_, evidence, fit, &store_, &result_);
  }

  // m = f1 D/(f2 z) on the sensor over the target, so D = m z f2/f1.
  void CheckMagnification() {
    if (!sweep_.target_period_mm || !result_.image_distance_mm) return;
    const std::optional<PeriodEstimate> period = MeasurePeriodPx(Grey(reference_));
    if (!period) {
      result_.warnings.push_back(
          "target_period_mm is stated, but the sharpest frame shows no period to compare with");
      return;
    }
    const model::ThickLens& lens = sweep_.camera.lens;
    const double depth_mm = result_.frames[reference_].depth_mm;
    const double rear_mm = period->period_px * sweep_.camera.sensor.pixel_pitch_mm /
                           *sweep_.target_period_mm * depth_mm * lens.rear_focal_length_mm /
                           lens.front_focal_length_mm;
    MagnificationCheck check;
    check.period_px = period->period_px;
    check.period_mm = *sweep_.target_period_mm;
    check.image_distance_mm = {lens.lens_thickness_mm + rear_mm,
                               rear_mm * std::hypot(period->sigma_px / period->period_px,
                                                    result_.bench_offset_mm->sigma / depth_mm)};
    result_.magnification = check;
    const double apart_mm = check.image_distance_mm.value - result_.image_distance_mm->value;
    const double sigma_mm =
        std::hypot(check.image_distance_mm.sigma, result_.image_distance_mm->sigma);
    if (std::abs(apart_mm) > 3 * sigma_mm) {
      result_.warnings.push_back(fmt::format(
          "the image scale of the target puts d1 at {:.4g} +- {:.2g} mm, {:+.1f} % from the focus: "
          "focal length, pixel pitch, target_period_mm or the readings are off by as much",
          check.image_distance_mm.value, check.image_distance_mm.sigma,
          100 * apart_mm / result_.image_distance_mm->value));
    }
  }

  std::pair<double, double> DepthRange() const {
    const auto [low, high] =
        std::minmax_element(used_.begin(), used_.end(), [&](std::size_t a, std::size_t b) {
          return result_.frames[a].depth_mm < result_.frames[b].depth_mm;
        });
    return {result_.frames[*low].depth_mm, result_.frames[*high].depth_mm};
  }

  const FocusSweep& sweep_;
  const CalibrationOptions& options_;
  FrameStore store_;
  Calibration result_;
  std::vector<std::size_t> used_;    // frames that passed the gates
  std::size_t reference_ = 0;        // the sharpest of them, normalised
  std::vector<ScaleSample> scales_;  // registered frames
  std::optional<Slip> slip_;
  std::mutex progress_mutex_;
  int steps_done_ = 0;
  int total_steps_ = 0;
};

}  // namespace

bool HasEnoughFrames(const FocusSweep& sweep, std::string* why) {
  std::set<double> distinct;
  for (const model::SweepFrame& frame : sweep.frames) distinct.insert(frame.reading_mm);
  if (sweep.frames.size() < kFewestFrames) {
    *why = fmt::format("a sweep needs at least {} frames, this one has {}", kFewestFrames,
                       sweep.frames.size());
    return false;
  }
  if (distinct.size() < kFewestFrames) {
    *why =
        fmt::format("a sweep needs at least {} different readings, this one has {}{}",
                    kFewestFrames, distinct.size(),
                    distinct.size() == 1 ? fmt::format(" (all are {} mm)", *distinct.begin()) : "");
    return false;
  }
  return true;
}

bool CalibrationOptions::IsValid(std::string* why) const {
  const auto fail = [why](const std::string& message) {
    if (why != nullptr) *why = message;
    return false;
  };
  if (threads < 0) return fail(fmt::format("threads must be >= 0, found {}", threads));
  if (!(gates.max_saturated_fraction >= 0)) {
    return fail(fmt::format("gates.max_saturated_fraction must be >= 0, found {}",
                            gates.max_saturated_fraction));
  }
  return true;
}

std::string OutcomeName(Outcome outcome) {
  switch (outcome) {
    case Outcome::kOk:
      return "ok";
    case Outcome::kPartial:
      return "partial";
    default:
      return "refused";
  }
}

Calibration Calibrate(const FocusSweep& sweep, const CalibrationOptions& options) {
  std::string why;
  if (!options.IsValid(&why)) throw Error("calibration options: " + why);
  if (!sweep.IsValid(&why)) throw Error("sweep: " + why);
  return Calibrator(sweep, options).Run();
}

}  // namespace thicklens::calib

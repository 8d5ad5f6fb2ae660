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

#include "blur_fit.h"
#include "edge_pixels.h"
#include "focus_solution.h"
#include "scale_tracking.h"
#include "sharpness_peak.h"
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
// |d reading/d variance - 1| below this: the target's edges stand alone, readings are absolute.
constexpr double kIsolatedEdges = 0.08;
constexpr double kStatedEdges = 0.2;  // the same where the target is stated to be an edge
// What the meter itself is good for, relative to the variance it measures.
constexpr double kAbsoluteMeterError = 0.01;
constexpr double kRelativeMeterError = 0.03;

// Files are named as the table of readings names them, not by where they lie on this machine.
std::string FileName(const std::string& image) {
  return std::filesystem::path(image).filename().string();
}

class Calibrator {
 public:
  Calibrator(const FocusSweep& sweep, const CalibrationOptions& options)
      : sweep_(sweep), options_(options) {
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
      RunSourceRecipe();
      FitPeak();
      MeasureBlur();
      SolveFocus(sweep_, blur_samples_, absolute_, reference_, &result_);
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

  cv::Mat Grey(std::size_t frame) const {
    return LinearGrey(sweep_.read_frame(frame), sweep_, frame);
  }

  // Absolute gates on every frame, then the blank gate against the median of those that passed.
  bool MeasureAndGate() {
    std::string why;
    if (!HasEnoughFrames(sweep_, &why)) return Refuse(why);
    model::ParallelFor(static_cast<int>(sweep_.frames.size()), options_.threads, [&](int i) {
      const auto index = static_cast<std::size_t>(i);
      const cv::Mat stored = sweep_.read_frame(index);
      result_.frames[index].statistics =
          MeasureFrame(RegionOf(stored, sweep_, index), LinearGrey(stored, sweep_, index));
      Tick();
    });
    std::vector<double> contrasts;
    for (const FrameMeasurement& frame : result_.frames) {
      if (!RejectionReason(frame.statistics, 0, options_.gates))
        contrasts.push_back(frame.statistics.contrast);
    }
    const double median_contrast = Median(contrasts);
    used_.resize(sweep_.frames.size());
    std::iota(used_.begin(), used_.end(), std::size_t{0});
    const auto reason = [&](std::size_t i) {
      return RejectionReason(result_.frames[i].statistics, median_contrast, options_.gates);
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
      SharpnessOptions raw;
      raw.edge_threshold = kEdgeThreshold * steepest;
      frame.mean_edge_slope = MeanEdgeSlope(grey, raw).mean_edge_slope;
      SharpnessOptions normalised;
      normalised.edge_threshold = kEdgeThreshold * steepest_relative;
      const SharpnessIndex index = MeanEdgeSlope(grey / frame.statistics.mean_linear, normalised);
      frame.normalised_edge_slope = index.mean_edge_slope;
      frame.edge_count = index.edge_count;
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
             frame.statistics.contrast >= kFaintContrast * median_contrast;
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
    const auto samples =
        TrackScale(sweep_, used_, reference_, known_mm, options_.threads, [this] { Tick(); });
    for (const ScaleSample& sample : samples)
      result_.frames[sample.frame].image_scale = sample.scale;
    result_.scale = FitScaleLaw(samples, static_cast<int>(reference_), sweep_.reading_sigma_mm,
                                sweep_.direction);
    for (const ScaleSample& sample : samples)
      result_.frames[sample.frame].in_scale_fit = result_.scale.done;
    if (sweep_.offset_mm) {
      result_.bench_offset_mm =
          Result{sweep_.offset_mm->value, sweep_.offset_mm->sigma, std::nullopt};
      WarnOfScale();
    } else if (result_.scale.done) {
      result_.bench_offset_mm = result_.scale.offset_mm;
    } else {
      return Refuse("offset_mm is unknown and was not found: " + result_.scale.message);
    }
    const double sign = model::DirectionSign(sweep_.direction);
    for (FrameMeasurement& frame : result_.frames) {
      frame.depth_mm = result_.bench_offset_mm->value + sign * frame.reading_mm;
    }
    return RejectImpossibleDepths();
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

  // Supplement, section 5: the sharpest raw frame is taken for the plane of focus, kappa is the
  // mean of sigma/r_defocus. Erratum of the source: the sharpest raw frame is not the plane of
  // focus (lamp, magnification and floor pull it), and the mean of ratios is dominated by frames
  // near focus.
  void RunSourceRecipe() {
    SourceRecipe& recipe = result_.source;
    const std::size_t sharpest =
        *std::max_element(used_.begin(), used_.end(), [&](std::size_t a, std::size_t b) {
          return result_.frames[a].mean_edge_slope < result_.frames[b].mean_edge_slope;
        });
    const model::ThickLens& lens = sweep_.camera.lens;
    recipe.sharpest_frame = static_cast<int>(sharpest);
    recipe.focus_depth_mm = result_.frames[sharpest].depth_mm;
    recipe.image_distance_mm = model::ImageDistanceMm(lens, recipe.focus_depth_mm);
    double sum = 0;
    for (const std::size_t i : used_) {
      const FrameMeasurement& frame = result_.frames[i];
      const double radius_px = model::BlurRadiusMm(lens, recipe.image_distance_mm, frame.depth_mm) /
                               sweep_.camera.sensor.pixel_pitch_mm;
      // The sharpest frame itself has r_defocus = 0 by construction (up to rounding).
      if (frame.depth_mm == recipe.focus_depth_mm || !(frame.source_blur_sigma_px > 0)) continue;
      sum += frame.source_blur_sigma_px / radius_px;
      ++recipe.ratio_frames;
    }
    if (recipe.ratio_frames > 0) recipe.blur_ratio = sum / recipe.ratio_frames;
    recipe.done = recipe.ratio_frames > 0;
    recipe.message = recipe.done ? "done" : "no frame away from focus has measurable edges";
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

  // A stated target decides; what the meter says of it may contradict, and is told.
  bool ReadingsAreAbsolute(const std::optional<double>& slope) {
    const double off = slope ? std::abs(*slope - 1) : 1;
    switch (sweep_.target) {
      case model::SweepTarget::kTexture:
        return false;
      case model::SweepTarget::kPrintedEdge:
      case model::SweepTarget::kKnifeEdge:
        if (off < kStatedEdges) return true;
        result_.warnings.push_back(
            fmt::format("the target is stated as {}, but the blur meter does not find isolated "
                        "edges with a Gaussian blur in the sharpest "
                        "frame: it is treated as a texture",
                        model::SweepTargetName(sweep_.target)));
        return false;
      default:
        return off < kIsolatedEdges;
    }
  }

  void MeasureBlur() {
    const cv::Mat reference = Grey(reference_);
    const double noise = SweepNoise();
    const std::optional<double> slope = EdgeMeterSlope(reference, noise, sweep_.camera.psf);
    absolute_ = ReadingsAreAbsolute(slope);
    const cv::Point2d centre(sweep_.camera.sensor.principal_point_px.x() - sweep_.roi.x,
                             sweep_.camera.sensor.principal_point_px.y() - sweep_.roi.y);
    std::mutex mutex;
    ForEachUsed([&](std::size_t i) {
      const FrameMeasurement& frame = result_.frames[i];
      BlurSample sample;
      sample.frame = i;
      sample.reading_mm = frame.reading_mm;
      std::optional<EdgeVariance> blur;
      if (absolute_) {
        blur = MeasureEdgeVariance(Grey(i));
      } else {
        if (i == reference_) return;  // relative to itself it says nothing
        sample.relative_scale = result_.frames[reference_].depth_mm / frame.depth_mm;
        blur = MeasureAddedVariance(reference, Grey(i), sample.relative_scale, centre, noise,
                                    sweep_.camera.psf);
      }
      if (!blur) return;
      sample.variance_px2 = blur->variance_px2;
      sample.error_px2 =
          std::hypot(blur->error_px2, (absolute_ ? kAbsoluteMeterError : kRelativeMeterError) *
                                          std::abs(blur->variance_px2));
      const std::lock_guard<std::mutex> lock(mutex);
      blur_samples_.push_back(sample);
    });
    std::sort(blur_samples_.begin(), blur_samples_.end(),
              [](const BlurSample& a, const BlurSample& b) { return a.frame < b.frame; });
  }

  const FocusSweep& sweep_;
  const CalibrationOptions& options_;
  Calibration result_;
  std::vector<std::size_t> used_;  // frames that passed the gates
  std::size_t reference_ = 0;      // the sharpest of them, normalised
  bool absolute_ = false;          // the target's edges stand alone
  std::vector<BlurSample> blur_samples_;
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

model::Camera CalibratedCamera(const model::Camera& camera, const Calibration& calibration,
                               bool use_source_recipe) {
  model::Camera result = camera;
  model::CameraCalibration found;
  found.evidence.frames_used = calibration.frames_used;
  for (const FrameMeasurement& frame : calibration.frames) {
    if (!frame.rejection.empty())
      found.evidence.frames_rejected.push_back({FileName(frame.image), frame.rejection});
  }
  const auto estimate = [](const std::optional<Result>& r) -> std::optional<model::Estimate> {
    if (!r) return std::nullopt;
    return model::Estimate{r->value, r->sigma};
  };
  found.bench_offset_mm = estimate(calibration.bench_offset_mm);
  if (use_source_recipe) {
    found.evidence.method = "source-recipe";
    found.image_distance_mm = model::Estimate{calibration.source.image_distance_mm, 0};
    found.blur_ratio = model::Estimate{calibration.source.blur_ratio, 0};
    found.evidence.focus_depth_mm = model::Estimate{calibration.source.focus_depth_mm, 0};
  } else {
    found.evidence.method = "joint-blur-fit";
    const auto& left_open = calibration.blur.undetermined;
    const auto is_fixed = [&](const char* name) {
      return std::find(left_open.begin(), left_open.end(), name) == left_open.end();
    };
    if (is_fixed("image_distance_mm"))
      found.image_distance_mm = estimate(calibration.image_distance_mm);
    if (is_fixed("blur_ratio")) found.blur_ratio = estimate(calibration.blur_ratio);
    if (is_fixed("blur_floor_px")) found.blur_floor_px = estimate(calibration.blur_floor_px);
    found.covariance_order = calibration.covariance_order;
    found.covariance = calibration.covariance;
    found.evidence.focus_depth_mm = estimate(calibration.focus_depth_mm);
    found.evidence.chi2_per_dof = calibration.blur.chi2_per_dof;
  }
  result.calibration = found;
  return result;
}

}  // namespace thicklens::calib

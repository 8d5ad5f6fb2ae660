#include "thicklens/calib/calibrate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "calib/calibrate/counted_focus.h"
#include "calib/calibrate/focus_solution.h"
#include "calib/calibrate/moving_focus.h"
#include "calib/calibrate/relief_region.h"
#include "calib/calibrate/size_statements.h"
#include "calib/calibrate/target_calibration.h"
#include "calib/fit/known_focus.h"
#include "calib/grid/grid_geometry.h"
#include "calib/registration/scale_causes.h"
#include "calib/sweep/frame_selection.h"
#include "calib/sweep/kept_frames.h"
#include "calib/uncertainty/systematic_advice.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/validity.h"
#include "thicklens/calib/error_budget.h"

namespace thicklens::calib {
namespace {

constexpr int kMaxThreads = 1024;
// A motor whose steps are no millimetres would seem to be at a larger one.
constexpr double kMaxRecognisedMagnification = 5;
// Blur ratios of lenses, by which a sensor that moves is recognised.
constexpr double kMinRecognisedRatio = 0.3, kMaxRecognisedRatio = 0.7;

Calibration CalibrateWithMotion(const FocusSweep& sweep, model::SweepMotion moves,
                                const CalibrationOptions& options) {
  TargetCalibration target;
  target.preview = [&](const FocusSweep& of) { return PreviewTarget(of, options); };
  target.run = [&](const FocusSweep& equivalent, const FocusMotion& motion) {
    return CalibrateTarget(equivalent, options, &motion);
  };
  return sweep.readings_are_counts ? CalibrateCountedFocus(sweep, moves, target)
                                   : CalibrateMovingFocus(sweep, moves, target);
}

// Counts say nothing about a target that moves.
Calibration RefuseCounts(const FocusSweep& sweep) {
  Calibration refused;
  for (const model::SweepFrame& frame : sweep.frames) {
    FrameMeasurement measurement;
    measurement.image = frame.Name();
    measurement.reading_mm = frame.reading_mm;
    refused.frames.push_back(measurement);
  }
  refused.summary.reason =
      "the readings are in steps of a length that is not stated: state their length in mm by "
      "--reading-scale (readings_scale_mm) or, if they are those of a focus drive, moves: lens or "
      "moves: sensor (--moves)";
  return refused;
}

// Whether the image scale says that something else than the target moved, and nothing else
// explains it.
bool ShowsMovingFocus(const Calibration& calibration) {
  return calibration.summary.outcome == Outcome::kRefused &&
         std::any_of(calibration.diagnostics.diagnoses.begin(),
                     calibration.diagnostics.diagnoses.end(),
                     [](const Diagnosis& diagnosis) { return diagnosis.NamesOnly(kLensMoves); });
}

// Tries the sensor as the part that moves where the scale refutes a target. A lens that moves
// changes the scale by 1/f per mm: where that is possible, too, only the user knows.
Calibration Recognised(const FocusSweep& sweep, const CalibrationOptions& options,
                       Calibration as_target) {
  FocusSweep moving = sweep;
  moving.offset_mm.reset();  // it was stated for the depth of a target
  const auto& change = as_target.diagnostics.scale.change_over_sweep;
  if (change && change->value != 0)
    moving.direction =
        change->value < 0 ? model::BenchDirection::kAway : model::BenchDirection::kToward;
  Calibration found = CalibrateWithMotion(moving, model::SweepMotion::kSensor, options);
  if (found.summary.outcome == Outcome::kRefused || !found.summary.blur_ratio ||
      !found.summary.image_distance_mm)
    return as_target;
  const double kappa = found.summary.blur_ratio->value;
  const model::ThickLens& lens = sweep.camera.lens;
  const double distance_mm = found.summary.image_distance_mm->value - lens.lens_thickness_mm;
  const double sigma_mm = std::hypot(found.summary.image_distance_mm->sigma,
                                     kFocalLengthTolerance * lens.rear_focal_length_mm);
  const bool may_be_lens =
      std::abs(distance_mm - lens.rear_focal_length_mm) < kKnownSigmas * sigma_mm;
  const auto& magnification = found.diagnostics.magnification_at_focus;
  if (may_be_lens || !magnification || magnification->value > kMaxRecognisedMagnification ||
      !(kappa > kMinRecognisedRatio && kappa < kMaxRecognisedRatio))
    return as_target;
  found.diagnostics.moves_is_recognised = true;
  found.summary.warnings.insert(
      found.summary.warnings.begin(),
      fmt::format("the image scale does not follow the target but the focus: the sweep is taken as "
                  "moves: sensor, direction: {}, with which the frames follow the laws of scale "
                  "and blur (chi2/dof {:.2g}, blur ratio {:.3f}); state moves and direction to "
                  "confirm or to correct it",
                  model::BenchDirectionName(moving.direction), found.summary.chi2_per_dof, kappa));
  return found;
}

// Calibrates frames as they are, or as the camera's distortion says, by the part that moves, stated
// or recognised.
Calibration CalibrateFrames(const FocusSweep& sweep, const CalibrationOptions& options) {
  if (sweep.moves && model::MovesFocus(*sweep.moves))
    return CalibrateWithMotion(sweep, *sweep.moves, options);
  if (sweep.readings_are_counts) return RefuseCounts(sweep);
  if (!sweep.moves && sweep.readings_are_focus_distances) {
    Calibration found = CalibrateWithMotion(sweep, model::SweepMotion::kLens, options);
    found.diagnostics.moves_is_recognised = true;
    found.summary.warnings.insert(
        found.summary.warnings.begin(),
        "the readings are in dioptres, which is the unit of a focus drive: the sweep is taken as "
        "moves: lens; state moves to confirm or to correct it");
    return found;
  }
  Calibration found =
      WithoutRelief(sweep, options, CalibrateTarget(sweep, options),
                    [&](const FocusSweep& part) { return CalibrateTarget(part, options); });
  if (!sweep.moves && options.fit_blur && ShowsMovingFocus(found))
    found = Recognised(sweep, options, std::move(found));
  if (sweep.moves) found.diagnostics.moves = *sweep.moves;
  return found;
}

// Measures the grid first: its size states the magnification, and a distortion that it shows is
// taken out of the frames.
Calibration CalibrateOnGrid(const FocusSweep& sweep, const CalibrationOptions& options) {
  GridGeometry grid = MeasureGrid(sweep, options.threads, [] { ThrowIfCancelled(); });
  FocusSweep used = sweep;
  if (grid.follows_readings) used.grid_scales = grid.scales;
  if (grid.distortion_is_used) used = WithDistortion(std::move(used), *grid.lens, sweep.roi);
  Calibration found = CalibrateFrames(used, options);
  if (!grid.message.empty() && !(grid.done && grid.follows_readings))
    found.summary.warnings.push_back(grid.message);
  CompareWithGrid(grid, &found.summary);
  found.diagnostics.grid = std::move(grid);
  return found;
}

}  // namespace

bool HasEnoughFrames(const FocusSweep& sweep, std::string* why) {
  std::set<double> distinct;
  for (const model::SweepFrame& frame : sweep.frames) distinct.insert(frame.reading_mm);
  if (sweep.frames.size() < kMinFrames) {
    *why = fmt::format("a sweep needs at least {} frames, this one has {}", kMinFrames,
                       sweep.frames.size());
    return false;
  }
  if (distinct.size() < kMinFrames) {
    *why =
        fmt::format("a sweep needs at least {} different readings, this one has {}{}", kMinFrames,
                    distinct.size(),
                    distinct.size() == 1 ? fmt::format(" (all are {} mm)", *distinct.begin()) : "");
    return false;
  }
  return true;
}

bool CalibrationOptions::IsValid(std::string* why) const {
  if (!(threads >= 0 && threads <= kMaxThreads)) {
    return Fail(why, fmt::format("threads is {}: it must be from 0 to {}", threads, kMaxThreads));
  }
  std::string inner;
  return checks.IsValid(&inner) || Fail(why, "checks." + inner);
}

Calibration Calibrate(const FocusSweep& given, const CalibrationOptions& options) {
  std::string why;
  if (!options.IsValid(&why)) throw Error("calibration options: " + why);
  if (!given.IsValid(&why)) throw Error("sweep: " + why);
  FocusSweep sweep = given;
  sweep.read_frame = KeptFrames::Of(given.read_frame);
  Calibration found =
      sweep.target_grid ? CalibrateOnGrid(sweep, options) : CalibrateFrames(sweep, options);
  // The results may have been converted to a lens or a sensor that moves.
  CountFrames(&found);
  SortAndAdvise(&found);
  return found;
}

}  // namespace thicklens::calib

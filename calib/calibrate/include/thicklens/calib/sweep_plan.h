#ifndef THICKLENS_CALIB_SWEEP_PLAN_H_
#define THICKLENS_CALIB_SWEEP_PLAN_H_

#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::calib {

// The camera, the target, the light and the bench of a sweep that is planned. Only a target that
// moves (or the whole camera) is planned.
struct PlanConditions {
  model::Camera camera;        // lens and sensor; d1, kappa and floor are the members below
  double focus_depth_mm = 0;   // zf at which the lens is to be focused, from Ap
  double blur_ratio = 0.45;    // expected kappa
  double blur_floor_px = 0.5;  // expected sigma of the blur floor
  // Standard deviation with which the floor is known; absent: it is not, and calibrate allows for
  // an interval.
  std::optional<double> blur_floor_sigma_px;

  model::TargetKind texture = model::TargetKind::kDeadLeaves;  // dead leaves or noise
  double contrast = 0.6;  // of the target, as in model::TargetOptions

  double light_level = 0.5;            // mean linear grey in the plane of focus, of full scale
  bool lamp_falloff = true;            // the lamp stands at the camera: light as (zf/z)^2
  double full_well_electrons = 10000;  // electrons at full scale; 0: no shot noise
  double read_noise_electrons = 5;     // standard deviation of the read noise
  // Standard deviation of the noise of a pixel, in units of full scale in linear light. It takes
  // the place of shot and read noise.
  std::optional<double> noise_sigma;
  int bits = 8;  // 8 or 16, of the files

  double reading_sigma_mm = 0.05;  // standard deviation of the error of a reading
  // Standard deviation of the bench offset that is stated to calibrate, mm; absent: calibrate finds
  // the offset from the image scale.
  std::optional<double> offset_sigma_mm;

  // Returns whether all members are valid. Otherwise `why`, if not null, gets the field, the value
  // and the constraint.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// The frames of a sweep in equal steps, and the texture of its target.
struct SweepDesign {
  double nearest_mm = 0;       // depth of the first frame, from Ap
  double step_mm = 0;          // > 0, mm of depth from frame to frame
  int frames = 0;              // number of frames
  double feature_size_mm = 0;  // as in model::TargetOptions: radius of the smallest leaf, or period

  // Depth of the last frame, from Ap.
  double farthest_mm() const { return nearest_mm + step_mm * (frames - 1); }
};

// Standard deviations of the three results.
struct PlannedErrors {
  double focus_depth_mm = 0;     // of zf, mm
  double image_distance_mm = 0;  // of d1, mm
  double blur_ratio = 0;         // of kappa, dimensionless
};

// The part of the errors that has one source. The squares of the parts add up to those of the
// whole.
struct PlannedErrorPart {
  std::string name;     // "noise", "readings", "bench offset" or "blur floor"
  PlannedErrors sigma;  // what it adds
};

// The values that are expected of one frame.
struct PlannedFrame {
  double depth_mm = 0;             // from Ap
  double blur_sigma_px = 0;        // sigma of floor and defocus, px
  double blur_sigma_error_px = 0;  // standard deviation of its measurement; 0: not in the fit
  double image_scale = 1;          // relative to the sharpest frame
  int modes = 0;                   // spatial frequencies that show its blur; 0: not in the fit
};

// The errors that a sweep is expected to have, by the Fisher information of its frames.
struct ExpectedSweep {
  bool done = false;                // true if the sweep would determine its results
  std::string message = "not run";  // how it ended; without a result, the reason
  SweepDesign design;               // what was asked for
  PlannedErrors sigma;              // that calibrate is expected to state
  // The scatter of repeated sweeps. It is smaller than `sigma` where the bench offset comes from
  // the image scale, because calibrate allows for what repeats have in common: the errors of the
  // method and the distortion of the lens.
  PlannedErrors scatter;
  std::vector<PlannedErrorPart> parts;  // of `sigma`
  // Half of the intervals that calibrate gives besides, because the floor is not known; 0: it is.
  PlannedErrors floor_interval;
  double offset_sigma_mm = 0;        // of the bench offset
  bool offset_from_scale = false;    // the offset is that of the image scale
  std::vector<PlannedFrame> frames;  // nearest first
  int frames_in_fit = 0;             // whose blur is measured
};

// Returns what is expected of a sweep, by the same steps as Calibrate: the largest window that the
// frames share, the modes of the texture above the noise, the information of the spectra about each
// frame's blur [D152], the registrations' about its scale [D154], and the joint fit with its
// Jacobian. Throws Error for conditions or a design that are not valid.
THICKLENS_EXPORT ExpectedSweep ExpectSweep(const PlanConditions& conditions,
                                           const SweepDesign& design);

// The errors that a plan shall reach, and the parts of the sweep that are given.
struct PlanWishes {
  // Standard deviations that are to be reached; absent: any.
  std::optional<double> focus_depth_mm, image_distance_mm, blur_ratio;
  std::optional<int> frames;                      // number of frames; absent: as few as possible
  std::optional<double> nearest_mm, farthest_mm;  // depths of the ends, both or neither
  std::optional<double> feature_size_mm;          // of the texture
  int most_frames = 120;                          // the largest number that is proposed

  // Returns whether all members are valid. Otherwise `why`, if not null, gets the field, the value
  // and the constraint.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// A proposed sweep.
struct SweepPlan {
  bool reached = false;               // whether the wishes are reached (true without any)
  std::string reason = "not run";     // why they are not, with what would be needed
  ExpectedSweep expected;             // the proposal, or the best that can be reached
  double target_width_mm = 0;         // size that fills every frame, with a margin
  double target_height_mm = 0;        // likewise
  std::vector<std::string> warnings;  // one line each
  std::string advice;  // one sentence: the largest part of the error, and what would help most
};

// Searches range, step, number of frames and size of the texture for the fewest frames that reach
// the wishes; without wishes, for the smallest errors of the given number (31 by default). Throws
// Error for conditions or wishes that are not valid, or if no sweep would have a result.
THICKLENS_EXPORT SweepPlan PlanSweep(const PlanConditions& conditions, const PlanWishes& wishes);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SWEEP_PLAN_H_

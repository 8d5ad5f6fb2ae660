#ifndef THICKLENS_CALIB_SWEEP_PROGRESS_H_
#define THICKLENS_CALIB_SWEEP_PROGRESS_H_

#include <cstddef>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/frame_checks.h"

namespace thicklens::calib {

// The limits that a sweep which is being taken is compared with.
struct SweepProgressOptions {
  QualityCheckOptions checks;             // limits of the quality checks
  double wanted_blur_ratio_error = 0.01;  // standard deviation of kappa to reach, as part of kappa

  // Returns whether all members are in their range. Otherwise `why`, if not null, gets the reason.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// A frame of a sweep that is being taken.
struct ProgressFrame {
  std::string image;      // name of the file
  double reading_mm = 0;  // what the scale of the bench shows
  // Mean edge slope over mean light, per px, at the threshold of the sharpest frame so far; 0:
  // there are no edges.
  double sharpness = 0;
  std::string rejection;  // empty if the frame can be used; a later frame may change it
};

// The findings in the frames so far, and what is missing.
struct SweepProgressReport {
  std::vector<ProgressFrame> frames;  // in the order in which they were added
  int usable = 0;                     // frames that passed the quality checks
  int rejected = 0;                   // the others
  SharpestReading sharpest;           // the position of focus so far
  int below_focus = 0;                // usable frames with a smaller reading than that of focus
  int above_focus = 0;                // usable frames with a larger one
  // Expected standard deviation of kappa as a part of kappa, by the Fisher information of equal
  // steps over the usable readings (ExpectSweep); absent: it cannot be predicted yet.
  std::optional<double> blur_ratio_error;
  // True: the region is larger than the 480 x 480 px that the prediction uses at most, and the
  // error is at most `blur_ratio_error`.
  bool is_error_at_most = false;
  bool readings_are_counts = false;  // the readings are in steps, not in mm (FocusSweep)
  bool is_enough = false;            // nothing is missing
  std::vector<std::string> missing;  // one sentence each, without its stop
};

// A sweep whose frames arrive one after the other, in any order. Each frame is measured once, when
// it is added; a report compares the measurements.
class SweepProgress {
 public:
  // `conditions` has camera, region, target and what is stated of offset and focus; its frames and
  // its reader are not used. Throws Error if the options are not valid.
  THICKLENS_EXPORT SweepProgress(const FocusSweep& conditions, const SweepProgressOptions& options);
  THICKLENS_EXPORT ~SweepProgress();
  THICKLENS_EXPORT SweepProgress(SweepProgress&&) noexcept;
  THICKLENS_EXPORT SweepProgress& operator=(SweepProgress&&) noexcept;

  // Measures a frame as its file stores it (FrameReader). Throws Error that names the frame if it
  // does not fit the camera; the frame is then not added.
  THICKLENS_EXPORT void Add(const model::SweepFrame& frame, const cv::Mat& stored);
  // Gives the frame of an index, in the order in which they were added, another reading.
  THICKLENS_EXPORT void SetReading(std::size_t index, double reading_mm);
  // The number of frames that were added.
  THICKLENS_EXPORT std::size_t size() const;
  // Compares the frames so far.
  THICKLENS_EXPORT SweepProgressReport Report() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SWEEP_PROGRESS_H_

#ifndef THICKLENS_CALIB_FRAME_MERGE_H_
#define THICKLENS_CALIB_FRAME_MERGE_H_

#include <functional>
#include <opencv2/core/mat.hpp>
#include <string>

#include "thicklens/base/export.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// Options of an all-in-focus image.
struct MergeOptions {
  // Standard deviation of the neighbourhood in which sharpness is measured, px, from 0.5 to 20.
  double sharpness_sigma_px = 2;
  // Sharpness to this power is the weight of a frame, 1 to 20: larger values choose one frame.
  double selectivity = 6;
  // Called after each frame, (done, total); may be empty.
  std::function<void(int, int)> progress;

  // Returns true if the numbers are in their ranges. Otherwise `why`, if not null, gets the reason.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// The frames of a sweep as one image.
struct MergedFrames {
  bool done = false;                // true if there is an image
  std::string message = "not run";  // how it ended; without a result, the reason
  cv::Mat light;                    // linear light, CV_32F with 1 or 3 channels (RGB)
  // For each pixel the reading at which it is sharpest, CV_32F, mm; NaN where no frame shows
  // detail. On a sweep whose target moves, a point of the target that is nearer to the camera by x
  // than the target's zero is in focus at a reading that is farther by x.
  cv::Mat focus_reading_mm;
  // The height of the target toward the camera, from the plane to which zf belongs, CV_32F, mm;
  // empty where the sweep has no bench offset.
  cv::Mat height_mm;
  int frames = 0;      // number of merged frames
  int reference = -1;  // index of the frame whose view the image has
  int left_out = 0;    // frames that could not be aligned
};

// Merges the frames that were not rejected into one image in which each part is as sharp as in its
// sharpest frame. Each frame is brought to the scale of the reference frame by the calibrated image
// scale (the fitted law where a frame was not registered), about the principal point, and its
// remaining shift and turn are measured by registration. The weight of a frame at a pixel is a
// power of its local sharpness (the energy of the Laplacian, smoothed) relative to the largest of
// all frames; noise, which has the same energy in all frames, is subtracted. Two frames are in
// memory at any time, beside images of sums and of the sharpest frames. Throws Interrupted after a
// request to stop.
THICKLENS_EXPORT MergedFrames MergeFrames(const FocusSweep& sweep, const Calibration& calibration,
                                          const MergeOptions& options);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FRAME_MERGE_H_

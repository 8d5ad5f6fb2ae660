#ifndef THICKLENS_CALIB_FRAME_CHECKS_H_
#define THICKLENS_CALIB_FRAME_CHECKS_H_

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>

#include "thicklens/base/export.h"
#include "thicklens/calib/frame_statistics.h"

namespace thicklens::calib {

// The kind of a rejection, without the numbers and names of the single frame: "dark" for "dark:
// mean 0.003 of full scale", "reading off" for "reading off by 15.1 mm, or frame damaged". Every
// rejection begins with its kind.
THICKLENS_EXPORT std::string FailedCheck(const std::string& rejection);
// Kinds of rejection that the light causes.
inline constexpr char kKindDark[] = "dark";
// The kind of a frame with too many black pixels.
inline constexpr char kKindBlack[] = "black";
// The kind of a frame with too many saturated pixels.
inline constexpr char kKindSaturated[] = "saturated";

// The limits of the quality checks of a frame.
struct QualityCheckOptions {
  double min_mean_encoded = 4.0 / 255;   // dark below this
  double max_saturated_fraction = 0.05;  // saturated above this
  double max_black_fraction = 0.05;      // black above this, unless the target is an edge
  bool edge_target = false;              // the target is stated as an edge: one side may be black
  double min_relative_contrast = 0.25;   // over the sweep's median contrast; blank below this
  double min_gradient_to_noise = 4;      // top gradient over its standard deviation from noise
  double min_coarse_texture = 2;         // accepted instead, where the gradients are too weak

  // Shares are from 0 to 1; the other numbers are finite and >= 0.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// Measures `stored`, a region as read, and `linear_grey`, the same region from LinearGrey.
THICKLENS_EXPORT FrameStatistics MeasureFrame(const cv::Mat& stored, const cv::Mat& linear_grey);

// Returns the reason why the frame cannot be used, or nothing. The the absolute checks come first:
// dark, a raw mosaic, saturated or black (clipping: many pixels of one value at an end, wherever
// the camera clips), and gradients no larger than those of noise. The last quality check is blank:
// a contrast that is low against the sweep's median.
THICKLENS_EXPORT std::optional<std::string> RejectionReason(const FrameStatistics& frame,
                                                            double median_contrast,
                                                            const QualityCheckOptions& options);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FRAME_CHECKS_H_

#ifndef THICKLENS_CALIB_FRAME_GATES_H_
#define THICKLENS_CALIB_FRAME_GATES_H_

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>

#include "thicklens/calib/frame_statistics.h"

namespace thicklens::calib {

// What a rejection is about, without the numbers and names of the single frame: "dark" of "dark:
// mean 0.003 of full scale", "reading off" of "reading off by 15.1 mm, or frame damaged". Every
// rejection begins with it.
std::string RejectionKind(const std::string& rejection);
// Those that are the light's fault.
inline constexpr char kKindDark[] = "dark";
inline constexpr char kKindBlack[] = "black";
inline constexpr char kKindSaturated[] = "saturated";

struct GateOptions {
  double min_mean_stored = 4.0 / 255;    // below: dark
  double max_saturated_fraction = 0.05;  // above: saturated
  double max_black_fraction = 0.05;      // above, of a target that is no edge: black
  bool edge_target = false;              // stated: one side may be black
  double min_relative_contrast = 0.25;   // of the sweep's median contrast; below: blank
  double min_gradient_to_noise = 4;      // top gradient over its standard deviation from noise
  double min_coarse_texture = 2;         // or this, where the gradients are too weak
};

// `stored` as read, `linear_grey` from LinearGrey, of the same region.
FrameStatistics MeasureFrame(const cv::Mat& stored, const cv::Mat& linear_grey);

// Why the frame is of no use, or nothing. The absolute gates come first: dark, a raw mosaic,
// saturated or black (a pile-up of one value at an end, wherever the camera clips), gradient no
// larger than noise makes; then blank against the sweep's median contrast.
std::optional<std::string> RejectionReason(const FrameStatistics& frame, double median_contrast,
                                           const GateOptions& options);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FRAME_GATES_H_

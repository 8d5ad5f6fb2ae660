#ifndef THICKLENS_CALIB_FRAME_GATES_H_
#define THICKLENS_CALIB_FRAME_GATES_H_

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>

namespace thicklens::calib {

// What a rejection is about, without the numbers and names of the single frame: "dark" of "dark:
// mean 0.003 of full scale", "reading off" of "reading off by 15.1 mm, or frame damaged". Every
// rejection begins with it.
std::string RejectionKind(const std::string& rejection);
// Those that are the light's fault.
inline constexpr char kKindDark[] = "dark";
inline constexpr char kKindBlack[] = "black";
inline constexpr char kKindSaturated[] = "saturated";

// What a frame is like before anything is normalised; levels in units of full scale.
struct FrameStatistics {
  double mean_stored = 0;   // mean of the stored grey values
  double mean_linear = 0;   // mean of the linear grey
  double contrast = 0;      // standard deviation over mean, linear, of the smoothed frame
  double noise_sigma = 0;   // of a linear grey pixel, from the flattest parts
  double top_gradient = 0;  // 99.5 percentile of the gradient magnitude, per px, linear
  // Standard deviation of what is 4 px or larger (and no shading) over what the noise alone would
  // give there: a strongly blurred texture still shows.
  double coarse_texture = 0;
  double saturated_fraction = 0;  // of all samples, at full scale or piled up on one value
  double saturation_level = 0;    // stored value of the pile-up; 0 if none
  // The same at the dark end. A backlit edge is black on one side by right: there the black pixels
  // fill one side of a straight line.
  double black_fraction = 0;
  double black_level = 0;
  bool black_is_one_side = false;
  bool is_mosaic = false;          // one channel, in which the colours of a filter alternate
  std::uint64_t content_hash = 0;  // equal for equal pixels: a picture that was repeated
};

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

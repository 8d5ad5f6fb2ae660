#ifndef THICKLENS_CALIB_FRAME_STATISTICS_H_
#define THICKLENS_CALIB_FRAME_STATISTICS_H_

#include <cstdint>

namespace thicklens::calib {

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

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FRAME_STATISTICS_H_

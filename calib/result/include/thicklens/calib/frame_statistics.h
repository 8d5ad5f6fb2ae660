#ifndef THICKLENS_CALIB_FRAME_STATISTICS_H_
#define THICKLENS_CALIB_FRAME_STATISTICS_H_

#include <cstdint>

namespace thicklens::calib {

// Statistics of a frame before any normalisation. Levels are in units of full scale.
struct FrameStatistics {
  double mean_encoded = 0;  // mean of the stored grey values
  double mean_linear = 0;   // mean of the linear grey
  double contrast = 0;      // standard deviation over mean, linear, of the smoothed frame
  double noise_sigma = 0;   // standard deviation of a linear grey pixel, from the flattest parts
  double top_gradient = 0;  // 99.5th percentile of the gradient magnitude, linear, per px
  // Standard deviation of structure of 4 px or larger (without shading) over the value that the
  // noise alone would give: a strongly blurred texture is still detected.
  double coarse_texture = 0;
  double saturated_fraction = 0;  // share of the samples at full scale or piled up on one value
  double saturation_level = 0;    // encoded value of the clipping; 0 if there is none
  // The corresponding values at the dark end. A backlit edge is normally black on one side: there
  // the black pixels fill one side of a straight line.
  double black_fraction = 0;
  double black_level = 0;          // encoded value of that clipping; 0 if there is none
  bool black_is_one_side = false;  // the black pixels fill one side of a line
  bool is_mosaic = false;          // one channel, in which the colours of a filter alternate
  std::uint64_t content_hash = 0;  // equal for equal pixels: shows a repeated image
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FRAME_STATISTICS_H_

#ifndef THICKLENS_KERNELS_REFERENCE_WARP_ARGUMENTS_H_
#define THICKLENS_KERNELS_REFERENCE_WARP_ARGUMENTS_H_

#include "thicklens/kernels/view_warp.h"

namespace thicklens::kernels {

// Both functions throw Error for sizes and indices that do not fit.
void CheckImage(const SurfaceImage& image);
void CheckView(const SurfaceImage& image, const ViewSources& view);

// Minimum and maximum of the disparities of the 4 x 4 pixels at -1 to 2 around each pixel, clamped
// to the image.
struct TapRanges {
  std::vector<float> lowest, highest;
};
TapRanges TapRangesOf(const SurfaceImage& image);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_REFERENCE_WARP_ARGUMENTS_H_

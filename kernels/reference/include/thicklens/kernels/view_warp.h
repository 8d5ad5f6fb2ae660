#ifndef THICKLENS_KERNELS_VIEW_WARP_H_
#define THICKLENS_KERNELS_VIEW_WARP_H_

#include <cstdint>
#include <memory>
#include <vector>

#include "thicklens/base/export.h"

namespace thicklens::kernels {

// An image of surfaces. Pixels whose disparities differ by at most `tolerance` (in the unit of the
// disparity) belong to one surface. The vectors are not owned.
struct SurfaceImage {
  int width_px = 0, height_px = 0, channels = 0;  // size, px; values per pixel
  const std::vector<float>* values = nullptr;     // row by row, the channels of a pixel together
  const std::vector<float>* disparity = nullptr;  // one per pixel, finite
  float tolerance = 0;                            // in the unit of the disparity
};

// A sample of a view that does not show the point at its disparity.
struct OccludedSample {
  std::int32_t index = 0;            // at y width + x
  float source_x = 0, source_y = 0;  // displacement to the pixel that is read instead, px
  float disparity = 0;               // disparity of the pixel that is read instead
};

// A sample whose pixel two surfaces share. It is (1 - share) of its unmixed value plus `share` of
// the value at another place. The latter is the mean of those of the four surrounding pixels that
// belong to the surface there.
struct BoundarySample {
  std::int32_t index = 0;  // at y width + x
  OccludedSample other;  // displacement and disparity of the other place; its index is that of the
                         // sample whose displacement is used
  float share = 0;       // 0 to 1
};

// The positions at which the samples of a view read the image, clamped to it. They follow from the
// disparities, so that a view is one number per sample and a list; only this is sent to a device.
struct ViewSources {
  // One per sample, as many as the image has pixels. Sample (x, y) of disparity d reads at (x +
  // shift_x d, y + shift_y d), on the surface of d. NaN: the sample is one of `hidden`.
  const std::vector<float>* disparity = nullptr;
  double shift_x = 0, shift_y = 0;                        // px per unit of disparity
  const std::vector<OccludedSample>* occluded = nullptr;  // the samples that are NaN, each once
  const std::vector<BoundarySample>* boundary = nullptr;  // ascending index, each once; null: none
};

// Reads one image for many views. The interpolation is bicubic (Catmull-Rom, the borders repeated)
// if all 16 surrounding pixels belong to the sample's surface. Otherwise it is the mean of those of
// the four surrounding pixels that belong to it, with bilinear weights. If none does, it is the one
// of the four whose disparity is nearest. Several threads may use an object at once.
class THICKLENS_EXPORT ViewWarp {
 public:
  virtual ~ViewWarp() = default;
  // Sets `values` in the order of SurfaceImage and resizes them. Throws Error for sizes and
  // indices that do not fit, and for errors of a device.
  virtual void Warp(const ViewSources& view, std::vector<float>* values) = 0;
};

// Returns the plain C++ implementation, which is the specification for devices. Keeps the data of
// the image by reference. Throws Error for sizes that do not fit.
THICKLENS_EXPORT std::unique_ptr<ViewWarp> NewReferenceWarp(const SurfaceImage& image);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_VIEW_WARP_H_

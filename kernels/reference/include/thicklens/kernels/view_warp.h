#ifndef THICKLENS_KERNELS_VIEW_WARP_H_
#define THICKLENS_KERNELS_VIEW_WARP_H_

#include <cstdint>
#include <memory>
#include <vector>

namespace thicklens::kernels {

// A picture of surfaces: pixels whose disparities differ by at most `tolerance` (in the unit of the
// disparity) are of one.
struct SurfacePicture {
  int width_px = 0, height_px = 0, channels = 0;
  const std::vector<float>* values = nullptr;     // row by row, the channels of a pixel together
  const std::vector<float>* disparity = nullptr;  // one a pixel, finite
  float tolerance = 0;
};

// A sample of a view that does not show what stands at its disparity.
struct HiddenSample {
  std::int32_t index = 0;            // y width + x
  float source_x = 0, source_y = 0;  // px to what is read in its place
  float disparity = 0;               // of that
};

// A sample whose pixel two surfaces share: it shows (1 - share) of what it would without, and
// `share` of what stands at another place, the mean of those of the four pixels around that are of
// the surface there.
struct MixedSample {
  std::int32_t index = 0;
  HiddenSample other;  // its index: of the sample whose way to a source is taken
  float share = 0;     // 0 to 1
};

// Where the samples of a view read the picture, cut to it. What is seen follows from its disparity,
// so that a view is one number a sample and a list, and no more than that has to go to a device.
struct ViewSources {
  // One a sample, as many as the picture has pixels. Sample (x, y) of disparity d reads at
  // (x + shift_x d, y + shift_y d), on the surface of d. NaN: it is one of `hidden`.
  const std::vector<float>* disparity = nullptr;
  double shift_x = 0, shift_y = 0;                    // px per unit of disparity
  const std::vector<HiddenSample>* hidden = nullptr;  // those that are NaN, each once
  const std::vector<MixedSample>* mixed = nullptr;    // by index, each once; null: none
};

// Reads one picture for many views. Bicubic (Catmull-Rom, the borders repeated) where all 16 pixels
// around are of the sample's surface, else the mean of those of the four around that are, weighted
// as bilinearly; where none is, the one of the four that is nearest to it in disparity. An object
// is used by many threads.
class ViewWarp {
 public:
  virtual ~ViewWarp() = default;
  // Sets `values`, as SurfacePicture has them, in the memory that they have. Throws Error for sizes
  // and indices that do not fit, and what a device reports.
  virtual void Warp(const ViewSources& view, std::vector<float>* values) = 0;
};

// In C++, plainly: the specification of a device's. Keeps the picture by reference. Throws Error
// for sizes that do not fit.
std::unique_ptr<ViewWarp> NewReferenceWarp(const SurfacePicture& picture);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_VIEW_WARP_H_

#ifndef THICKLENS_KERNELS_ROW_WARPER_H_
#define THICKLENS_KERNELS_ROW_WARPER_H_

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/kernels/view_warp.h"

namespace thicklens::kernels {

// Reads one image for rows of views, with the interpolation of ViewWarp and vector instructions.
// Several threads may use an object at once.
class THICKLENS_EXPORT RowWarper {
 public:
  // Where the samples of a row are read: the pixels before their positions, and the remaining
  // fractions. The memory can be used for many rows.
  struct Places {
    // Makes places for rows of `width_px` samples.
    explicit Places(int width_px);

    std::vector<std::int32_t> x, y;             // pixel before the position
    std::vector<float> fraction_x, fraction_y;  // 0 to 1, from that pixel
  };

  // Copies the values of the image and keeps its disparities by reference. The counts of both must
  // fit the sizes. Throws Interrupted after a cancellation.
  explicit RowWarper(const SurfaceImage& image);

  // Sets the values of row y of a view, the channels of a sample together. Sample x has the
  // disparity disparity[x] and is read at the displacement (source_x[x], source_y[x]), px.
  void Warp(int y, const float* disparity, const float* source_x, const float* source_y,
            Places* places, float* warped) const;

  // Replaces the share of the other place in the values of a view.
  void Mix(const std::vector<BoundarySample>& mixed, float* warped) const;

 private:
  struct Range {
    float lowest, highest;
  };

  void CopyPixels(const std::vector<float>& values);
  void FindRanges();
  template <int kChannels>
  void WarpRow(const Places& places, const float* disparity, float* warped) const;
  template <int kChannels>
  void WarpRowAvx2(const Places& places, const float* disparity, float* warped) const;
  template <int kChannels>
  void WarpRowOf(const Places& places, const float* disparity, float* warped) const;
  void Bilinear(int x0, int y0, float fraction_x, float fraction_y, float disparity,
                float* value) const;
  bool Agrees(float tap_disparity, float disparity) const {
    return std::abs(tap_disparity - disparity) <= tolerance_;
  }
  const float* Tap(int x, int y) const;

  const int width_px_, height_px_, channels_;
  const float tolerance_;
  const std::vector<float>& disparity_;
  std::vector<float> pixels_;  // planes of four channels each (a single channel is stored alone),
                               // with repeated borders
  std::vector<Range> ranges_;  // minimum and maximum disparity of the 16 taps of each pixel
};

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_ROW_WARPER_H_

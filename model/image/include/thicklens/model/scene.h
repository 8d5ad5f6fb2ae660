#ifndef THICKLENS_MODEL_SCENE_H_
#define THICKLENS_MODEL_SCENE_H_

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "thicklens/model/camera.h"

namespace thicklens::model {

// A picture as a file stores it: integer values, rows top to bottom, channels interleaved (RGB).
struct StoredPicture {
  int width_px = 0;
  int height_px = 0;
  int channels = 0;
  int bits = 8;                       // 8 or 16; full scale is 2^bits - 1
  std::vector<std::uint16_t> values;  // width * height * channels

  double full_scale() const { return bits == 8 ? 255.0 : 65535.0; }
};

// A picture in linear light, 1 at full scale, same order of values.
struct LinearPicture {
  int width_px = 0;
  int height_px = 0;
  int channels = 0;
  std::vector<float> values;

  float at(int x, int y, int channel) const {
    return values[(static_cast<std::size_t>(y) * static_cast<std::size_t>(width_px) +
                   static_cast<std::size_t>(x)) *
                      static_cast<std::size_t>(channels) +
                  static_cast<std::size_t>(channel)];
  }
};

LinearPicture ToLinear(const StoredPicture& picture, const TransferCurve& transfer);
StoredPicture ToStored(const LinearPicture& picture, const TransferCurve& transfer, int bits);
// The same with normal noise of standard deviation `sigma`, in full scales, added to the stored
// values before they are rounded; sigma = 0 gives ToStored. The seed alone decides the draws.
StoredPicture ToStoredWithNoise(const LinearPicture& picture, const TransferCurve& transfer,
                                int bits, double sigma, std::uint64_t seed);
// .2126 R + .7152 G + .0722 B for three channels; one channel is returned as it is; of four the
// last (alpha) is left out. Throws Error for other counts.
LinearPicture ToGrey(const LinearPicture& picture);

// What the numbers of a depth map mean. Never guessed: the user says it.
enum class DepthKind {
  kZ,          // depth along the axis from Ap
  kRange,      // distance along the chief ray of the pixel, from the centre of Ap
  kDisparity,  // px per view step, near positive, 0 in the plane of focus
};
DepthKind DepthKindFromName(const std::string& name);  // "z", "range", "disparity"

// A map as read from a file, one number a pixel.
struct RawDepthMap {
  int width_px = 0;
  int height_px = 0;
  std::vector<float> values;
  bool integer = false;  // from an integer file format, where 0 means "no data"
};

struct DepthConvention {
  DepthKind kind = DepthKind::kZ;
  double unit_mm = 1;          // kZ, kRange: mm per unit of the map (tum5000: 0.2)
  double disparity_scale = 1;  // kDisparity: disparity_px = scale * value + offset
  double disparity_offset_px = 0;
  double aperture_step_mm = 0;  // kDisparity: da of the views that the disparity refers to
};
// "mm", "cm", "m", "tum5000" (16-bit PNG of the TUM benchmark, m x 5000): mm per unit. Throws
// Error.
double DepthUnitMm(const std::string& name);

struct DepthStatistics {
  std::size_t valid = 0;
  std::size_t holes = 0;
  double min_mm = 0, median_mm = 0, max_mm = 0;  // of the valid ones; 0 if there are none
};

// A picture in linear light with the depth of what each pixel's chief ray meets.
struct Scene {
  LinearPicture picture;
  std::vector<float> depth_mm;  // z from Ap, aligned with the picture; NaN marks a hole
  DepthStatistics depth;
};

// Converts the map by its convention (range: z = range/sqrt(1 + (t p/K)^2), t px from the principal
// point; disparity: 1/z = 1/zf + d p/(da K)) and puts it beside the picture. Holes: NaN and
// infinities; 0 in integer maps and in z and range; a disparity of a point at or behind infinity.
// Throws Error naming `depth_name` if the sizes differ, a depth is negative, all are holes, or the
// depths cannot be this camera's (nearer than its front focal point, or the unit off by a factor
// of 1000), with min, median and max in mm.
Scene MakeScene(const Camera& camera, LinearPicture picture, const RawDepthMap& map,
                const DepthConvention& convention, const std::string& depth_name);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SCENE_H_

#ifndef THICKLENS_MODEL_SCENE_H_
#define THICKLENS_MODEL_SCENE_H_

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/camera.h"

namespace thicklens::model {

// An image as a file stores it: integer values, rows from top to bottom, channels interleaved
// (RGB).
struct EncodedImage {
  int width_px = 0;                   // width, px
  int height_px = 0;                  // height, px
  int channels = 0;                   // 1 (grey), 3 (RGB) or 4 (RGBA)
  int bits = 8;                       // 8 or 16; full scale is 2^bits - 1
  std::vector<std::uint16_t> values;  // width * height * channels

  // The largest value, 2^bits - 1.
  double full_scale() const { return bits == 8 ? 255.0 : 65535.0; }
};

// An image in linear light, 1 at full scale; the order of the values is that of EncodedImage.
struct LinearImage {
  int width_px = 0;           // width, px
  int height_px = 0;          // height, px
  int channels = 0;           // number of values per pixel
  std::vector<float> values;  // width * height * channels; may be outside [0, 1]

  // The value of one channel of the pixel (x, y), which must exist.
  float at(int x, int y, int channel) const {
    return values[(static_cast<std::size_t>(y) * static_cast<std::size_t>(width_px) +
                   static_cast<std::size_t>(x)) *
                      static_cast<std::size_t>(channels) +
                  static_cast<std::size_t>(channel)];
  }
};

// Decodes the encoded values. Throws Error if `bits` is not 8 or 16, the number of values does not
// fit the size, or a value is above full scale.
THICKLENS_EXPORT LinearImage ToLinear(const EncodedImage& image, const TransferCurve& transfer);
// Encodes, rounds and clips the values; NaN becomes 0. Throws Error if `bits` is not 8 or 16 or the
// number of values does not fit the size.
THICKLENS_EXPORT EncodedImage ToEncoded(const LinearImage& image, const TransferCurve& transfer,
                                        int bits);
// ToEncoded with normal noise, which is added to the encoded values before they are rounded.
// `sigma` is its standard deviation in units of full scale; 0 gives ToEncoded. The seed alone
// determines the noise. Throws Error also unless sigma is finite and >= 0.
THICKLENS_EXPORT EncodedImage ToEncodedWithNoise(const LinearImage& image,
                                                 const TransferCurve& transfer, int bits,
                                                 double sigma, std::uint64_t seed);
// Grey image 0.2126 R + 0.7152 G + 0.0722 B of three channels. One channel is returned unchanged;
// the last of four channels (alpha) is ignored. Throws Error for other numbers of channels.
THICKLENS_EXPORT LinearImage ToGrey(const LinearImage& image);

// Meaning of the numbers of a depth map. The user states it; it is never guessed.
enum class DepthKind {
  kZ,          // depth along the axis from Ap
  kRange,      // distance along the chief ray of the pixel, from the centre of Ap
  kDisparity,  // px per view step, near positive, 0 in the plane of focus
  kInverse,    // 1/z by a scale and an offset, near positive
};
// The kind of the name "z", "range", "disparity" or "inverse". Throws Error for any other name.
THICKLENS_EXPORT DepthKind DepthKindFromName(const std::string& name);

// Which order of a depth map's values is reversed, for files whose rows or columns are stored the
// other way.
enum class DepthFlip {
  kNone,     // none
  kRows,     // the first row is the lowest
  kColumns,  // the first column is the right one
  kBoth,     // both: the map is turned by 180 degrees
};
// The name "none", "rows", "columns" or "both".
THICKLENS_EXPORT std::string DepthFlipName(DepthFlip flip);
// The flip of that name. Throws Error for any other name.
THICKLENS_EXPORT DepthFlip DepthFlipFromName(const std::string& name);
// One flip after the other, in any order.
THICKLENS_EXPORT DepthFlip Combined(DepthFlip first, DepthFlip second);
// Reverses the values of a map of width_px columns in place. Throws Error unless they are full
// rows.
THICKLENS_EXPORT void FlipDepth(DepthFlip flip, int width_px, std::vector<float>* values);

// A depth map as read from a file: one number per pixel, rows from top to bottom.
struct RawDepthMap {
  int width_px = 0;           // width, px
  int height_px = 0;          // height, px
  std::vector<float> values;  // width * height numbers, in the unit of the map
  bool integer = false;       // true: the file format is integer, and 0 means "no data"
  // The largest value that the file's integer type, or its stated range, can hold.
  std::optional<double> largest_of_type = std::nullopt;
};

// How the numbers of a depth map are converted.
struct DepthConvention {
  DepthKind kind = DepthKind::kZ;  // what the numbers mean
  double unit_mm = 1;              // kZ, kRange: mm per unit of the map (tum5000: 0.2)
  double disparity_scale = 1;      // kDisparity: disparity_px = scale * value + offset
  double disparity_offset_px = 0;  // kDisparity: offset, px per view step
  double aperture_step_mm = 0;     // kDisparity: da, step on Ap between the views of the disparity
  // kInverse: 1/z = scale * value + offset, in dioptres (1/m). The scale is not 0.
  double inverse_scale_dpt = 1;
  double inverse_offset_dpt = 0;  // kInverse: the offset, dioptres
};
// The two numbers of an inverse depth: 1/z = scale_dpt * value + offset_dpt.
struct InverseScale {
  double scale_dpt = 1;   // dioptres per unit of the map
  double offset_dpt = 0;  // of the value 0
};
// Scale and offset of a map whose value 0 lies at one depth and whose value `full_scale` lies at
// another, linear in 1/z: 1/z = 1/z0 + value/full_scale (1/z1 - 1/z0). Either depth may be
// infinite. Throws Error if a depth is not > 0, both are equal, or full_scale is not > 0.
THICKLENS_EXPORT InverseScale InverseScaleBetween(double depth_at_zero_mm,
                                                  double depth_at_full_scale_mm, double full_scale);
// Millimetres per unit for the name "mm", "cm", "m" or "tum5000" (16-bit PNG of the TUM benchmark,
// m x 5000). Throws Error for any other name.
THICKLENS_EXPORT double DepthUnitMm(const std::string& name);

// Numbers of depths and holes in a depth map, and the depths from Ap.
struct DepthStatistics {
  std::size_t valid = 0;                         // number of pixels with a depth
  std::size_t holes = 0;                         // number of pixels without one
  double min_mm = 0, median_mm = 0, max_mm = 0;  // over the valid depths; 0 if there are none
};

// An image in linear light with the depth of the surface that the chief ray of each pixel meets.
struct Scene {
  LinearImage image;            // linear light, 1 at full scale
  std::vector<float> depth_mm;  // z from Ap, one value per pixel of the image; NaN marks a hole
  DepthStatistics depth;        // of depth_mm
};

// Makes a scene of an image and its depth map. The map is converted to z by its convention:
//   range: z = range/sqrt(1 + (t p/K)^2), t px from the principal point
//   disparity: 1/z = 1/zf + d p/(da K)
//   inverse: 1/z = scale * value + offset
// Holes are NaN and infinities, 0 in integer maps and in maps of z and range, and disparities and
// inverse depths of points at or beyond infinity. Throws Error, which names `depth_name`, if the
// sizes differ, a depth is negative, all values are holes, or the depths are impossible for this
// camera (nearer than its front focal point, or with a unit that is wrong by a factor of 1000); the
// latter message states the minimum, median and maximum in mm. Throws Error also if the convention
// is invalid or the camera lacks the calibration that range and disparity need.
THICKLENS_EXPORT Scene MakeScene(const Camera& camera, LinearImage image, const RawDepthMap& map,
                                 const DepthConvention& convention, const std::string& depth_name);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SCENE_H_

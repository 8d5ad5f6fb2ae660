#ifndef THICKLENS_DEPTH_H_
#define THICKLENS_DEPTH_H_

#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/scene.h"

namespace thicklens {

// The meaning of a depth map's numbers: kZ is the depth along the axis from the aperture plane Ap;
// kRange the distance along the chief ray of the pixel from the centre of Ap; kDisparity the
// displacement in px per view step, positive for near points, 0 in the plane of focus.
using DepthKind = model::DepthKind;

// Unit of the numbers of a depth map.
enum class LengthUnit {
  kNone,        // not stated; a disparity has no unit
  kMillimetre,  // 1 mm per unit of the map
  kCentimetre,  // 10 mm per unit of the map
  kMetre,       // 1000 mm per unit of the map
  kTum5000,     // metres times 5000, as the TUM benchmark stores them: 0.2 mm per unit
};
THICKLENS_EXPORT std::string LengthUnitName(LengthUnit unit);  // "mm", "cm", "m", "tum5000", ""

// The meaning of the numbers of a map. It is stated by the user and never guessed: kind and unit of
// a map in kZ or kRange have no default.
struct DepthMeaning {
  DepthKind kind = DepthKind::kZ;       // what the numbers are
  LengthUnit unit = LengthUnit::kNone;  // kZ and kRange need one, kDisparity has none
  // Only for kDisparity: disparity_px = disparity_scale * value + disparity_offset_px. The scale
  // is finite and not 0, the offset finite.
  double disparity_scale = 1;
  double disparity_offset_px = 0;  // px per view step

  // Returns whether kind, unit, scale and offset are stated and fit each other. Otherwise `why`, if
  // not null, gets the reason.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// A depth map: one number per pixel, rows from top to bottom. NaN and infinities are holes; so is 0
// in maps of whole numbers, and in kZ and kRange.
struct DepthMap {
  int width_px = 0, height_px = 0;  // size, px
  std::vector<float> values;        // width * height numbers
  bool is_integer = false;          // the file's type is integer, so that 0 means "no data"
  DepthMeaning meaning;             // what the numbers mean
  std::string source;               // file that it was read from; messages name it

  // Returns a rectangle of the map, px. Throws Error if it is empty or not inside.
  THICKLENS_EXPORT DepthMap Cropped(const model::PixelRect& rect) const;

  // Returns true if the sizes are >= 1, the number of values fits and the meaning is valid.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// Reads a map of one channel: PFM, 8- or 16-bit PNG, 16-bit or float TIFF, float EXR. Throws
// OptionError if the meaning is not valid, before the file is opened, and Error that names the
// file.
THICKLENS_EXPORT DepthMap ReadDepth(const std::string& path, const DepthMeaning& meaning);
// The bytes of a PFM file (float, little endian) with the values; the meaning is not part of it.
THICKLENS_EXPORT std::string EncodeDepth(const DepthMap& depth);
// Writes that file, completely or not at all.
THICKLENS_EXPORT void WriteDepth(const std::string& path, const DepthMap& depth);

}  // namespace thicklens

#endif  // THICKLENS_DEPTH_H_

#ifndef THICKLENS_DEPTH_H_
#define THICKLENS_DEPTH_H_

#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/depth_holes.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/scene.h"
#include "thicklens/run.h"

namespace thicklens {

// The meaning of a depth map's numbers: kZ is the depth along the axis from the aperture plane Ap;
// kRange the distance along the chief ray of the pixel from the centre of Ap; kDisparity the
// displacement in px per view step, positive for near points, 0 in the plane of focus; kInverse 1/z
// by a scale and an offset, as relative maps and phones store it.
using DepthKind = model::DepthKind;

// Unit of the numbers of a depth map.
enum class LengthUnit {
  kNone,        // not stated; a disparity and an inverse depth have no unit
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
  // Only for kDisparity: the scale and the offset are not known, as with the relative map of a
  // network. The sign of the scale states which values are near: 1 large ones, -1 small ones; the
  // offset is 0. An estimate finds both from the blur of the photograph (FitDepthValues); nothing
  // else takes such a map.
  bool is_relative = false;
  // Only for kInverse: 1/z in dioptres (1/m) = inverse_scale_dpt * value + inverse_offset_dpt. The
  // scale is finite and not 0, the offset finite. The defaults are those of a map of dioptres.
  double inverse_scale_dpt = 1;
  double inverse_offset_dpt = 0;  // the offset, dioptres

  // Returns whether kind, unit, scale and offset are stated and fit each other. Otherwise `why`, if
  // not null, gets the reason.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// A depth map: one number per pixel, rows from top to bottom. NaN and infinities are holes; so is 0
// in maps of whole numbers, and in kZ and kRange, and what `holes` states (model::MarkHoles).
struct DepthMap {
  int width_px = 0, height_px = 0;  // size, px
  std::vector<float> values;        // width * height numbers
  bool is_integer = false;          // the file's type is integer, so that 0 means "no data"
  DepthMeaning meaning;             // what the numbers mean
  std::string source;               // file that it was read from; messages name it
  // The largest value that the type of the file holds, if it is an integer type.
  std::optional<double> largest_of_type = std::nullopt;
  model::HoleRules holes = {};  // which values are no depths
  // Findings of the reader: remarks and doubts, one sentence each.
  std::vector<std::string> notes = {}, warnings = {};
  model::DepthFlip flip = model::DepthFlip::kNone;  // by which the file's values were reversed
  bool is_lossy = false;  // the file is compressed with losses, as JPEG is
  // The value that lies at DepthReadOptions::near_mm, if that was given.
  std::optional<double> near_value = std::nullopt;
  // Confidence of each value, 0 (none) to 1 (full); empty: it is not known. It is the weight of
  // the value where values are interpolated and smoothed, and a confidence of 0 makes a hole.
  std::vector<float> confidence = {};

  // Returns a rectangle of the map, px. Throws Error if it is empty or not inside.
  THICKLENS_EXPORT DepthMap Cropped(const model::PixelRect& rect) const;

  // Returns true if the sizes are >= 1, the number of values fits and the meaning is valid.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// Whether the values of a PFM file are multiplied by the magnitude of the scale in its header.
enum class PfmScale {
  kByRule,   // applied, except for the 1/255 of the Middlebury benchmark, whose values are px
  kApplied,  // always
  kIgnored,  // never, as most programs do
};

// How a depth map is read.
struct DepthReadOptions {
  // The name of the channel that is the depth, in a file with named channels; empty: the one named
  // Z, depth or disparity, or one of three or more that are equal.
  std::string channel;
  PfmScale pfm_scale = PfmScale::kByRule;  // of a PFM file
  model::HoleRules holes;                  // which of the values are no depths
  // Reverses rows or columns, for a file that stores them in another order than its format says.
  model::DepthFlip flip = model::DepthFlip::kNone;
  // kInverse: the depths, mm, of the largest value of the file's integer type, or of 1 in a map of
  // floats, and of 0; the far one may be infinite. They give the meaning's scale and offset. For a
  // map whose zeros are near, near_mm is the larger one.
  std::optional<double> near_mm, far_mm;

  // Returns whether the options fit the meaning. Otherwise `why`, if not null, gets the reason.
  THICKLENS_EXPORT bool IsValid(const DepthMeaning& meaning, std::string* why) const;
};

// Reads a map of one channel, or of three or more equal ones: PFM, NPY, PNG, PGM, TIFF, EXR, JPEG.
// Throws OptionError if the meaning or the options are not valid, before the file is opened, and
// Error that names the file.
THICKLENS_EXPORT DepthMap ReadDepth(const std::string& path, const DepthMeaning& meaning,
                                    const DepthReadOptions& options = {},
                                    const RunControl& run = {});
// Reads the depth map that a phone or a program stored in the photograph's own file, with the
// meaning that the file states: lengths in mm (kZ, kRange) or dioptres (kInverse), as floats. The
// forms are those of io::FindEmbeddedDepth. `width_px` and `height_px` are the photograph's size,
// to which a smaller map of the same aspect ratio is enlarged; 0: the map keeps its size. `flip`
// reverses its rows or columns. The first of its notes describes it in one line. Returns nothing if
// the file holds no depth. Throws Error that names the file: its fields are wrong, it states no
// unit, or the map has another aspect ratio.
THICKLENS_EXPORT std::optional<DepthMap> ReadEmbeddedDepth(
    const std::string& path, int width_px = 0, int height_px = 0,
    model::DepthFlip flip = model::DepthFlip::kNone, const RunControl& run = {});
// Returns the values of the map, in which NaN marks the holes (model::MarkHoles). `run` gets what
// the reader of the map found, which values are holes, and which look like marks of "no depth".
// Throws Error that names the map's source.
THICKLENS_EXPORT model::RawDepthMap MarkedDepth(const DepthMap& depth, const RunControl& run = {});
// The bytes of a PFM file (float, little endian) with the values; the meaning is not part of it.
THICKLENS_EXPORT std::string EncodeDepth(const DepthMap& depth);
// Writes that file, completely or not at all.
THICKLENS_EXPORT void WriteDepth(const std::string& path, const DepthMap& depth);

}  // namespace thicklens

#endif  // THICKLENS_DEPTH_H_

#ifndef THICKLENS_IO_DEPTH_IO_H_
#define THICKLENS_IO_DEPTH_IO_H_

#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/scene.h"

namespace thicklens::io {

// Whether the values of a PFM file are multiplied by the magnitude of the scale in its header. The
// format gives the sign a meaning, and most programs ignore the magnitude.
enum class PfmScale {
  // Applied, except for 1/255: the disparity maps of the Middlebury benchmark state it, and their
  // values are px already.
  kByRule,
  kApplied,  // always
  kIgnored,  // never
};

// Which values of a file are the depth.
struct DepthReading {
  std::string channel;  // of this name, in a file with named channels; empty: found by rule
  PfmScale pfm_scale = PfmScale::kByRule;  // of a PFM file
};

// A depth map and what its user should know about the reading.
struct DepthFile {
  model::RawDepthMap map;             // its values, rows from top to bottom
  std::string description;            // "PNG, 128 x 96 px, unsigned 16-bit integers"
  std::vector<std::string> notes;     // one sentence each, without the file's name
  std::vector<std::string> warnings;  // likewise
  bool is_lossy = false;  // compressed with losses: the values are changed by some levels
};

// Decodes a depth map: PFM, NPY, PNG, PGM and PPM, TIFF, JPEG, and, unless the build has no GPL
// parts, EXR, WebP and BMP. The rows of the result go top to bottom. Of several channels it takes
// the one that `reading` names, or the one named Z, depth or disparity, or one of three or more
// that are equal; pixels of alpha 0 are NaN then. Throws Error that begins with `name` and states
// what was found and what is expected (for an image of colours, a colour-mapped image, a file
// that is no image, a broken header, missing values).
THICKLENS_EXPORT DepthFile DecodeDepthFile(const std::string& bytes, const std::string& name,
                                           const DepthReading& reading = {});
// Reads the file and decodes it.
THICKLENS_EXPORT DepthFile ReadDepthFile(const std::string& path, const DepthReading& reading = {});
// The map of ReadDepthFile alone.
THICKLENS_EXPORT model::RawDepthMap ReadDepthMap(const std::string& path);

// A depth map that is part of a photograph's file.
struct EmbeddedDepth {
  // The numbers as they are stored; NaN where there is none.
  model::RawDepthMap map;
  // The meaning of offset + scale * number. kZ and kRange: a length in mm, or, if `is_inverse`, its
  // inverse in dioptres (1/m). kInverse: dioptres, and `is_inverse` is true.
  model::DepthKind kind = model::DepthKind::kZ;
  bool is_inverse = false;       // see `kind`
  double scale = 1, offset = 0;  // of the numbers, see `kind`
  // Whether the file states the unit of length. If not, scale and offset are those for metres, and
  // the true ones are an unknown multiple of them.
  bool has_unit = true;
  std::string form;                   // "GDepth", "Dynamic Depth", "Apple's disparity"
  std::string description;            // in one line: form, size, type and range
  std::vector<std::string> notes;     // one sentence each, without the file's name
  std::vector<std::string> warnings;  // likewise
};

// The result of a search for depth in a photograph.
struct EmbeddedDepthSearch {
  std::optional<EmbeddedDepth> depth;  // absent: there is none
  // Other contents of the file that may be taken for it, in words: "a second image of 320 x 240 px
  // that is not stated to be depth".
  std::vector<std::string> others;
};

// The forms that are looked for, in words.
THICKLENS_EXPORT std::string EmbeddedDepthForms();
// Finds and decodes the depth map inside a photograph: GDepth in XMP (of JPEG, PNG, WebP, TIFF and
// HEIF), Dynamic Depth and Apple's depth or disparity behind a JPEG, and, unless the build has no
// GPL parts, the auxiliary depth image of HEIF. Throws Error that begins with `name` if the file
// states that it holds depth and its fields contradict one another, are missing or point outside
// the file.
THICKLENS_EXPORT EmbeddedDepthSearch FindEmbeddedDepth(const std::string& bytes,
                                                       const std::string& name);
// Reads the file and searches it.
THICKLENS_EXPORT EmbeddedDepthSearch ReadEmbeddedDepthFile(const std::string& path);
// Returns the depths: mm of kZ and kRange, dioptres of kInverse; NaN where there is none. They are
// floats, so that 0 dioptres is a value.
THICKLENS_EXPORT model::RawDepthMap DepthsOf(const EmbeddedDepth& depth);
// Returns the map in the size of its photograph. The stored numbers are interpolated linearly
// between the four around a pixel; beside a hole the nearest one is taken. Throws Error that begins
// with `name` if the map has another aspect ratio than the photograph, or more pixels.
THICKLENS_EXPORT EmbeddedDepth Enlarged(const EmbeddedDepth& depth, int width_px, int height_px,
                                        const std::string& name);

// Encodes the map as a PFM file (little endian).
THICKLENS_EXPORT std::string EncodePfm(const model::RawDepthMap& map);

}  // namespace thicklens::io

#endif  // THICKLENS_IO_DEPTH_IO_H_

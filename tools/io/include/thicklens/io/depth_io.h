#ifndef THICKLENS_IO_DEPTH_IO_H_
#define THICKLENS_IO_DEPTH_IO_H_

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
  kApplied,
  kIgnored,
};

// Which values of a file are the depth.
struct DepthReading {
  std::string channel;  // of this name, in a file with named channels; empty: found by rule
  PfmScale pfm_scale = PfmScale::kByRule;
};

// A depth map and what its user should know about the reading.
struct DepthFile {
  model::RawDepthMap map;
  std::string description;            // "PNG, 128 x 96 px, unsigned 16-bit integers"
  std::vector<std::string> notes;     // one sentence each, without the file's name
  std::vector<std::string> warnings;  // likewise
};

// Decodes a depth map: PFM, NPY, PNG, PGM and PPM, TIFF, JPEG, and, unless the build has no GPL
// parts, EXR, WebP and BMP. The rows of the result go top to bottom. Of several channels it takes
// the one that `reading` names, or the one named Z, depth or disparity, or one of three or more
// that are equal; pixels of alpha 0 are NaN then. Throws Error that begins with `name` and states
// what was found and what is expected (for a picture of colours, a colour-mapped picture, a file
// that is no image, a broken header, missing values).
THICKLENS_EXPORT DepthFile DecodeDepthFile(const std::string& bytes, const std::string& name,
                                           const DepthReading& reading = {});
// Reads the file and decodes it.
THICKLENS_EXPORT DepthFile ReadDepthFile(const std::string& path, const DepthReading& reading = {});
// The map of ReadDepthFile alone.
THICKLENS_EXPORT model::RawDepthMap ReadDepthMap(const std::string& path);

// Encodes the map as a PFM file (little endian).
THICKLENS_EXPORT std::string EncodePfm(const model::RawDepthMap& map);

}  // namespace thicklens::io

#endif  // THICKLENS_IO_DEPTH_IO_H_

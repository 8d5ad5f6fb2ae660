// Selects the reader of a depth map by the first bytes of its file.
#include <fmt/format.h>

#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "tools/io/depth/depth_readers.h"

namespace thicklens::io {

DepthFile DecodeDepthFile(const std::string& bytes, const std::string& name,
                          const DepthReading& reading) {
  if (bytes.compare(0, 2, "Pf") == 0) return DecodePfmDepth(bytes, name, reading.pfm_scale);
  if (IsNpy(bytes)) return DecodeNpyDepth(bytes, name);
  if (IsZip(bytes)) {
    throw Error(fmt::format(
        "{}: not a depth map: a PFM, NPY, PNG, PGM, TIFF, EXR or JPEG file is expected, "
        "found {}",
        name, WordsOnZip(bytes, name)));
  }
  return DecodeImageDepth(bytes, name, reading);
}

DepthFile ReadDepthFile(const std::string& path, const DepthReading& reading) {
  return DecodeDepthFile(ReadWholeFile(path), path, reading);
}

model::RawDepthMap ReadDepthMap(const std::string& path) {
  return std::move(ReadDepthFile(path).map);
}

}  // namespace thicklens::io

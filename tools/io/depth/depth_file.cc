// Selects the reader of a depth map by the first bytes of its file.
#include <fmt/format.h>

#include <cstddef>
#include <cstdio>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/printable_text.h"
#include "tools/io/depth/depth_readers.h"

namespace thicklens::io {
namespace {

// Little endian.
std::size_t NumberAt(const std::string& bytes, std::size_t at) {
  std::size_t number = 0;
  for (std::size_t i = 4; i > 0; --i)
    number = number << 8 | static_cast<unsigned char>(bytes[at + i - 1]);
  return number;
}

bool BeginsWith(const std::string& bytes, const std::string& start) {
  return bytes.compare(0, start.size(), start) == 0;
}

// How the array that a Python expression gives becomes a file that is read.
std::string Saved(const std::string& array) {
  return fmt::format("save it as NPY, in Python numpy.save('depth.npy', {})", array);
}

// The files of flows and depths that begin with the float 202021.25: 4 or 8 bytes per pixel follow
// width and height.
std::string WordsOnPieh(const std::string& bytes, const std::string& file) {
  constexpr std::size_t kHeaderBytes = 12, kMaxSidePx = 1 << 20;
  if (bytes.size() < kHeaderBytes) return "";
  const std::size_t width = NumberAt(bytes, 4), height = NumberAt(bytes, 8);
  if (width > kMaxSidePx || height > kMaxSidePx) return "";
  const std::size_t values = bytes.size() - kHeaderBytes, pixels = width * height;
  if (values == 4 * pixels) {
    return "a depth file of the Sintel benchmark (DPT): " +
           Saved(
               fmt::format("numpy.fromfile('{}', '<f4')[3:].reshape({}, {})", file, height, width));
  }
  if (values == 8 * pixels) {
    return "an optical flow (FLO), of which the horizontal part may be a disparity: " +
           Saved(fmt::format("numpy.fromfile('{}', '<f4')[3:].reshape({}, {}, 2)[..., 0]", file,
                             height, width));
  }
  return "";
}

// COLMAP writes "640&480&1&" in front of the floats, the rows from top to bottom.
std::string WordsOnColmap(const std::string& bytes, const std::string& file) {
  const std::string header = bytes.substr(0, 40);
  int width = 0, height = 0, channels = 0, length = 0;
  if (std::sscanf(header.c_str(), "%9d&%9d&%9d&%n", &width, &height, &channels, &length) != 3 ||
      length == 0 || channels != 1) {
    return "";
  }
  return "a dense map of COLMAP: " +
         Saved(fmt::format("numpy.fromfile('{}', '<f4', offset={}).reshape({}, {})", file, length,
                           height, width));
}

std::string WordsOnNumbers(const std::string& bytes, const std::string& file) {
  const std::string start = bytes.substr(0, 200);
  const bool is_text =
      start.find_first_not_of("0123456789+-.eEnaNif,;\t\r\n ") == std::string::npos;
  if (!is_text || start.find_first_of("0123456789") == std::string::npos ||
      start.find_first_of(",;\t\n ") == std::string::npos) {
    return "";
  }
  const char* const separator = start.find(';') != std::string::npos   ? ", delimiter=';'"
                                : start.find(',') != std::string::npos ? ", delimiter=','"
                                                                       : "";
  return "a table of numbers in text: " +
         Saved(fmt::format("numpy.loadtxt('{}'{})", file, separator));
}

// The kind of a file that may hold a depth but is not read, and how the depth is taken from it;
// empty: it is none of these.
std::string WordsOnOtherDepth(const std::string& bytes, const std::string& name) {
  const std::string file = PrintableUtf8(name.substr(name.find_last_of('/') + 1));
  if (IsZip(bytes)) return WordsOnZip(bytes, name);
  if (BeginsWith(bytes, "PIEH")) return WordsOnPieh(bytes, file);
  if (BeginsWith(bytes, "ply\n") || BeginsWith(bytes, "ply\r")) {
    return "points or a mesh (PLY), which have no pixels: project them into the photograph first, "
           "to "
           "one depth per pixel";
  }
  // Version 7.3 is HDF5 with the axes in the opposite order.
  if (BeginsWith(bytes, "MATLAB 7.3")) {
    return "a MAT file (Matlab 7.3): " + Saved(fmt::format("h5py.File('{}')['NAME'][()].T", file));
  }
  if (BeginsWith(bytes, "MATLAB ")) {
    return "a MAT file (Matlab): " + Saved(fmt::format("scipy.io.loadmat('{}')['NAME']", file));
  }
  if (BeginsWith(bytes, "\x89HDF\r\n"))
    return "an HDF5 file: " + Saved(fmt::format("h5py.File('{}')['NAME'][()]", file));
  const std::string colmap = WordsOnColmap(bytes, file);
  return colmap.empty() ? WordsOnNumbers(bytes, file) : colmap;
}

}  // namespace

DepthFile DecodeDepthFile(const std::string& bytes, const std::string& name,
                          const DepthReading& reading) {
  if (bytes.compare(0, 2, "Pf") == 0) return DecodePfmDepth(bytes, name, reading.pfm_scale);
  if (IsNpy(bytes)) return DecodeNpyDepth(bytes, name);
  const std::string other = WordsOnOtherDepth(bytes, name);
  if (!other.empty()) {
    throw Error(fmt::format(
        "{}: not a depth map: a PFM, NPY, PNG, PGM, TIFF, EXR or JPEG file is expected, found {}",
        name, other));
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

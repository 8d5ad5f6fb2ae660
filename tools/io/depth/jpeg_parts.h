#ifndef THICKLENS_TOOLS_IO_DEPTH_JPEG_PARTS_H_
#define THICKLENS_TOOLS_IO_DEPTH_JPEG_PARTS_H_

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace thicklens::io {

// One image of the index of a Multi-Picture Format file (CIPA DC-007).
struct MpfImage {
  std::uint32_t type = 0;           // the lower 24 bits of its attribute
  std::size_t begin = 0, size = 0;  // in the file; an old index may point beyond its end
};

// The parts of a JPEG file that its photograph does not need.
struct JpegParts {
  int width_px = 0, height_px = 0;  // of the photograph; 0: no frame was found
  std::string xmp;                  // the packet; empty: there is none
  // The extended packet, put together; empty: there is none. With a fault it is what is left of it.
  std::string extended_xmp;
  // The fault of the extended packet, beginning with the file's name: a wrong length, a gap
  // or parts on one another; empty: nothing.
  std::string extended_fault;
  std::vector<MpfImage> images;  // those of the index behind the first one
  // Behind the end-of-image marker of the first photograph; the file's size if the marker is
  // missing.
  std::size_t end = 0;
};

// Types of an MpfImage.
constexpr std::uint32_t kMpfUndefined = 0, kMpfSmallPreview = 0x010001, kMpfLargePreview = 0x010002,
                        kMpfStereo = 0x020002;

// Finds them; `name` is the file's.
JpegParts PartsOfJpeg(const std::string& bytes, const std::string& name);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_DEPTH_JPEG_PARTS_H_

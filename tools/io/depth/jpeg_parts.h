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

// The parts of a JPEG file that its picture does not need.
struct JpegParts {
  int width_px = 0, height_px = 0;  // of the picture; 0: no frame was found
  std::string xmp;                  // the packet; empty: there is none
  // The extended packet, put together; empty: there is none.
  std::string extended_xmp;
  std::vector<MpfImage> images;  // those of the index behind the first one
  // Behind the end-of-image marker of the first picture; the file's size if the marker is missing.
  std::size_t end = 0;
};

// The types of an MpfImage.
constexpr std::uint32_t kMpfUndefined = 0, kMpfSmallPreview = 0x010001, kMpfLargePreview = 0x010002,
                        kMpfPanorama = 0x020001, kMpfStereo = 0x020002, kMpfAngles = 0x020003;

// Finds them. Throws Error that begins with `name` if the extended packet has a wrong length, a
// gap or parts on one another.
JpegParts PartsOfJpeg(const std::string& bytes, const std::string& name);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_DEPTH_JPEG_PARTS_H_

#ifndef THICKLENS_TOOLS_IO_TIFF_PIXELS_H_
#define THICKLENS_TOOLS_IO_TIFF_PIXELS_H_

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "thicklens/io/image_file.h"

namespace thicklens::io {

// One page of a file, as libtiff finds it. Reduced copies (previews, pyramids) and
// masks are no pages.
struct TiffPage {
  unsigned directory = 0;  // which of the file's directories
  int width_px = 0, height_px = 0;
  double bits_per_px = 0;
  int compression = 1;
};
std::vector<TiffPage> TiffPages(const std::string& bytes);

// Whether a TIFF file is a camera's raw file: DNG, or a mosaic in another directory than the first.
bool IsRawTiff(const std::string& bytes);

// Decodes one page; `pixels` and what a TIFF file states about itself. The values are those of the
// file, whatever their arrangement (strips, tiles, planes), compression and byte order. The mosaic
// of a CFA file is returned as it is, with facts.raw. Throws Error without the file's name.
DecodedImage DecodeTiff(const std::string& bytes, const TiffPage& page, bool spread_bits);

// Encodes 8 or 16 bits or floats, 1, 3 or 4 channels. Throws Error.
std::string EncodeTiff(const cv::Mat& pixels, const ImageWriting& writing);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_TIFF_PIXELS_H_

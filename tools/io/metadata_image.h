#ifndef THICKLENS_TOOLS_IO_METADATA_IMAGE_H_
#define THICKLENS_TOOLS_IO_METADATA_IMAGE_H_

#include <exiv2/exiv2.hpp>
#include <string>

namespace thicklens::io {

// Opens the bytes of an image, which must outlive the result, and reads its metadata. A file is not
// opened by its name, which Exiv2 may take for a network address or for standard input. Throws
// Exiv2::Error for what is no image. Videos are none: Exiv2's readers of them do not end on some
// damaged files.
Exiv2::Image::AutoPtr ReadMetadata(const std::string& bytes);

// Returns whether ReadMetadata knows this kind of file.
bool CanHoldMetadata(const std::string& bytes);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_METADATA_IMAGE_H_

#ifndef THICKLENS_TOOLS_IO_IMAGE_METADATA_H_
#define THICKLENS_TOOLS_IO_IMAGE_METADATA_H_

#include <string>

#include "thicklens/io/image_file.h"
#include "tools/io/image_file_kind.h"

namespace thicklens::io {

// Sets what the bytes of a file state besides its pixels: the orientation and pixel pitch of EXIF,
// the colour profile, transfer and primaries of PNG. Facts that another rule has set remain. What
// is damaged is left out: a photograph with a broken profile is still a photograph.
void TakeMetadata(const std::string& bytes, ImageFileKind kind, ImageFacts* facts);

// The ICC profile in the bytes of an image; empty: it has none.
std::string ColourProfileOf(const std::string& bytes);

// The text by which an ICC profile names itself; empty if it has none.
std::string IccDescription(const std::string& profile);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_IMAGE_METADATA_H_

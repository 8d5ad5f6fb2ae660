#ifndef THICKLENS_IO_IMAGE_DESCRIPTION_H_
#define THICKLENS_IO_IMAGE_DESCRIPTION_H_

#include <string>

#include "thicklens/base/export.h"

namespace thicklens::io {

// Returns the bytes of a PNG file with a text (UTF-8) that describes the image: the text chunk
// "Description", which programs show. The pixels do not change. Throws Error if `png` is no PNG
// file.
THICKLENS_EXPORT std::string WithDescription(const std::string& png, const std::string& text);
// Returns that text; empty if there is none. Throws Error that begins with `name`.
THICKLENS_EXPORT std::string DescriptionOf(const std::string& png, const std::string& name);

}  // namespace thicklens::io

#endif  // THICKLENS_IO_IMAGE_DESCRIPTION_H_

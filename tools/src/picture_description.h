#ifndef THICKLENS_TOOLS_PICTURE_DESCRIPTION_H_
#define THICKLENS_TOOLS_PICTURE_DESCRIPTION_H_

#include <string>

namespace thicklens::tools {

// The bytes of a PNG file with a text (UTF-8) that says what the picture is: the text chunk
// "Description", which programs show. The pixels stay as they are. Throws Error if they are no PNG.
std::string WithDescription(const std::string& png, const std::string& text);
// That text; empty if there is none. Throws Error that begins with `name`.
std::string DescriptionOf(const std::string& png, const std::string& name);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_PICTURE_DESCRIPTION_H_

#ifndef THICKLENS_TOOLS_PRINTABLE_TEXT_H_
#define THICKLENS_TOOLS_PRINTABLE_TEXT_H_

#include <string>

namespace thicklens::tools {

// Text made safe for XML content and attributes: markup characters escaped, everything that XML 1.0
// cannot carry (broken UTF-8, control characters) replaced by U+FFFD.
std::string EscapeXml(const std::string& text);

// The same text with every broken UTF-8 sequence and every control character replaced by U+FFFD:
// file names may hold any byte, terminals and JSON may not.
std::string PrintableUtf8(const std::string& text);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_PRINTABLE_TEXT_H_

#ifndef THICKLENS_BASE_PRINTABLE_TEXT_H_
#define THICKLENS_BASE_PRINTABLE_TEXT_H_

#include <string>

#include "thicklens/base/export.h"

namespace thicklens {

// Makes text safe for XML content and attributes: markup characters are escaped, and everything
// that XML 1.0 cannot hold (broken UTF-8, control characters) is replaced by U+FFFD.
THICKLENS_EXPORT std::string EscapeXml(const std::string& text);

// Replaces every broken UTF-8 sequence and every control character by U+FFFD: file names may hold
// any byte, terminals and JSON may not.
THICKLENS_EXPORT std::string PrintableUtf8(const std::string& text);

}  // namespace thicklens

#endif  // THICKLENS_BASE_PRINTABLE_TEXT_H_

#ifndef THICKLENS_TOOLS_DATA_HASH_H_
#define THICKLENS_TOOLS_DATA_HASH_H_

#include <string>

namespace thicklens::tools {

// SHA-256 in lower-case hexadecimal, as sha256sum prints it.
std::string Sha256Hex(const std::string& bytes);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_DATA_HASH_H_

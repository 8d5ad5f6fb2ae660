#ifndef THICKLENS_VERSION_H_
#define THICKLENS_VERSION_H_

#include <string>

#include "thicklens/base/export.h"

// The version of the headers with which a program is compiled. CMake reads it here.
#define THICKLENS_VERSION_MAJOR 0
#define THICKLENS_VERSION_MINOR 1
#define THICKLENS_VERSION_PATCH 0
#define THICKLENS_VERSION_STRING "0.1.0"
// One number that grows with the version: 1.2.3 is 10203.
#define THICKLENS_VERSION \
  (THICKLENS_VERSION_MAJOR * 10000 + THICKLENS_VERSION_MINOR * 100 + THICKLENS_VERSION_PATCH)

namespace thicklens {

// The version of the library with which the program is linked, for example "0.1.0". It is written
// into camera files and light fields. It differs from THICKLENS_VERSION_STRING if the program was
// compiled with the headers of another version.
THICKLENS_EXPORT std::string LibraryVersion();

}  // namespace thicklens

#endif  // THICKLENS_VERSION_H_

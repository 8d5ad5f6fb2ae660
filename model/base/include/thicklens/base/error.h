#ifndef THICKLENS_BASE_ERROR_H_
#define THICKLENS_BASE_ERROR_H_

#include <stdexcept>
#include <string>

namespace thicklens {

// A wrong file, configuration or device. The message is one line that names the place (file, field
// or frame), the value found there and what would be right. Modules throw it; only `tools` prints
// it and turns it into an exit code.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// The user asked to stop. Whoever holds a half-written output drops it while this passes by.
class Interrupted : public Error {
 public:
  Interrupted() : Error("interrupted; nothing was written") {}
};

}  // namespace thicklens

#endif  // THICKLENS_BASE_ERROR_H_

#ifndef THICKLENS_BASE_ERROR_H_
#define THICKLENS_BASE_ERROR_H_

#include <stdexcept>
#include <string>

#include "thicklens/base/export.h"

namespace thicklens {

// An invalid file, configuration or device. The message is one line that names the place (file,
// field or frame), the value found there and the expected value. Modules throw it; only `tools`
// prints it and converts it to an exit code.
class THICKLENS_EXPORT Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// A cancellation by the user. The owner of an incomplete output discards it while the exception
// propagates. The text does not say what was written before: only the caller knows that.
class THICKLENS_EXPORT Interrupted : public Error {
 public:
  // Makes the error with the message "interrupted".
  Interrupted() : Error("interrupted") {}
};

}  // namespace thicklens

#endif  // THICKLENS_BASE_ERROR_H_

#ifndef THICKLENS_TESTS_SUPPORT_ERROR_MESSAGE_H_
#define THICKLENS_TESTS_SUPPORT_ERROR_MESSAGE_H_

#include <string>

#include "thicklens/base/error.h"

namespace thicklens::testing {

// Returns the message of the Error that `call` throws, or "(no error)" if it throws none. Other
// exceptions pass through.
template <typename Call>
std::string ErrorOf(const Call& call) {
  try {
    call();
  } catch (const Error& e) {
    return e.what();
  }
  return "(no error)";
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_SUPPORT_ERROR_MESSAGE_H_

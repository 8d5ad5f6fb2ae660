#ifndef THICKLENS_TESTS_TOOLS_SUPPORT_OPTION_ERROR_H_
#define THICKLENS_TESTS_TOOLS_SUPPORT_OPTION_ERROR_H_

#include <string>

#include "thicklens/run.h"

namespace thicklens::testing {

// Returns the field of the OptionError that `call` throws, or "" if it throws none. Other
// exceptions pass through.
template <typename Call>
std::string FieldOfOptionError(const Call& call) {
  try {
    call();
  } catch (const OptionError& error) {
    return error.field();
  }
  return "";
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_TOOLS_SUPPORT_OPTION_ERROR_H_

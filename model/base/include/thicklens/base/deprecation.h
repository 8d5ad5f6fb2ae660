#ifndef THICKLENS_BASE_DEPRECATION_H_
#define THICKLENS_BASE_DEPRECATION_H_

#include <string>

namespace thicklens {

// A key, value or option that was renamed. Its former name is accepted until version 1.0.
struct RenamedWord {
  std::string former, now;  // the name that is deprecated, and the present one
};

// The warning for somebody who uses the former name.
inline std::string DeprecationText(const RenamedWord& word) {
  return "'" + word.former + "' is deprecated and will be removed in 1.0: use '" + word.now + "'";
}

}  // namespace thicklens

#endif  // THICKLENS_BASE_DEPRECATION_H_

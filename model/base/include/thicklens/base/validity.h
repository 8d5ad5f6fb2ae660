#ifndef THICKLENS_BASE_VALIDITY_H_
#define THICKLENS_BASE_VALIDITY_H_

#include <string>
#include <utility>

namespace thicklens {

// Ends a check such as `IsValid(std::string* why)` that has found a fault: stores the reason in
// `*why`, unless `why` is null, and returns false.
inline bool Fail(std::string* why, std::string reason) {
  if (why != nullptr) *why = std::move(reason);
  return false;
}

}  // namespace thicklens

#endif  // THICKLENS_BASE_VALIDITY_H_

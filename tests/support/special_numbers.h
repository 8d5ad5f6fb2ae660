#ifndef THICKLENS_TESTS_SUPPORT_SPECIAL_NUMBERS_H_
#define THICKLENS_TESTS_SUPPORT_SPECIAL_NUMBERS_H_

#include <limits>

namespace thicklens::testing {

inline constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();
inline constexpr double kPi = 3.14159265358979323846;

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_SUPPORT_SPECIAL_NUMBERS_H_

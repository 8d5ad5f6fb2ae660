#ifndef THICKLENS_BASE_PI_H_
#define THICKLENS_BASE_PI_H_

namespace thicklens {

// The ratio of a circle's circumference to its diameter, to the precision of double.
inline constexpr double kPi = 3.14159265358979323846;

}  // namespace thicklens

#endif  // THICKLENS_BASE_PI_H_

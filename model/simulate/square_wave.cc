#include "model/simulate/square_wave.h"

#include <algorithm>
#include <cmath>

#include "thicklens/base/pi.h"

namespace thicklens::model {

// The mean is the difference of the antiderivative, which is a triangle wave.
double SquareWaveMean(double x, double period, double width) {
  const auto triangle = [period](double at) {
    const double phase = at - period * std::floor(at / period);
    return phase < period / 2 ? phase : period - phase;
  };
  return (triangle(x + width / 2) - triangle(x - width / 2)) / width;
}

double StarMean(double x, double y, double cycles, double cell) {
  const double radius = std::max(std::hypot(x, y), cell / 2);
  return SquareWaveMean(cycles * std::atan2(y, x) / (2 * kPi), 1,
                        cycles * cell / (2 * kPi * radius));
}

}  // namespace thicklens::model

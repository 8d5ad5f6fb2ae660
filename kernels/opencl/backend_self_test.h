#ifndef THICKLENS_KERNELS_OPENCL_BACKEND_SELF_TEST_H_
#define THICKLENS_KERNELS_OPENCL_BACKEND_SELF_TEST_H_

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "thicklens/kernels/device.h"

namespace thicklens::kernels {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// The largest difference so far, and the name of its kernel.
struct MaxError {
  double error = 0;
  std::string what;

  void Add(const std::string& name, double candidate) {
    if (!(candidate > error)) return;
    error = candidate;
    what = name;
  }
};

// Returns the largest difference over the largest right number. It is infinite if the sizes differ
// or only one of two numbers is NaN.
template <typename Number>
double Difference(const std::vector<Number>& found, const std::vector<Number>& right) {
  if (found.size() != right.size()) return kInfinity;
  double largest = 0;
  double difference = 0;
  for (std::size_t i = 0; i < right.size(); ++i) {
    const auto a = static_cast<double>(found[i]);
    const auto b = static_cast<double>(right[i]);
    if (std::isnan(a) && std::isnan(b)) continue;
    if (!std::isfinite(a - b)) return kInfinity;
    largest = std::max(largest, std::abs(b));
    difference = std::max(difference, std::abs(a - b));
  }
  return difference == 0 ? 0 : difference / largest;
}

// Pseudo-random numbers that are equal on every machine, unlike the distributions of the standard
// library.
class PortableRng {
 public:
  double Between(double low, double high) {
    return low + (high - low) * static_cast<double>(engine_()) / static_cast<double>(0xffffffffU);
  }
  template <typename Real>
  std::vector<Real> Vector(int count, double low, double high) {
    std::vector<Real> values(static_cast<std::size_t>(count));
    for (Real& value : values) value = static_cast<Real>(Between(low, high));
    return values;
  }

 private:
  std::mt19937 engine_{12345};
};

// Compares the steps of a device with those of the CPU.
template <typename Real>
void CompareSteps(Backend* device, MaxError* worst);

// Compares a view of a device with that of the reference.
void CompareWarp(Backend* device, MaxError* worst);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_OPENCL_BACKEND_SELF_TEST_H_

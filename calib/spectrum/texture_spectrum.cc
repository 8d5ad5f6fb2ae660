#include "calib/spectrum/texture_spectrum.h"

#include <algorithm>
#include <cmath>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/pi.h"

namespace thicklens::calib {
namespace {

// The largest leaf relative to the field, as the simulator draws them.
constexpr double kLargestLeaf = 1.0 / 6;
constexpr int kFrequencies = 64;
constexpr double kCyclesPerLeaf[] = {0.02, 2.5};  // of the largest leaf's and the smallest's radius
constexpr int kRadii = 200;
constexpr int kStepsPerSmallest = 24;  // of the distance x, per radius of the smallest leaf

// Area that a disc shares with itself moved by x.
double SharedArea(double radius, double x) {
  if (!(x < 2 * radius)) return 0;
  return 2 * radius * radius * std::acos(x / (2 * radius)) -
         0.5 * x * std::sqrt(4 * radius * radius - x * x);
}

// Mean of the slope of tanh(a x) for a standard normal x, over a.
double MeanSlopeOfLimit(double a) {
  constexpr int kSteps = 400;
  constexpr double kReach = 6;
  double sum = 0;
  for (int i = 0; i <= kSteps; ++i) {
    const double x = -kReach + 2 * kReach * i / kSteps;
    const double t = std::tanh(a * x);
    sum += (1 - t * t) * std::exp(-0.5 * x * x);
  }
  return sum * 2 * kReach / kSteps / std::sqrt(2 * kPi);
}

}  // namespace

bool HasSpectrum(model::TargetKind kind) {
  return kind == model::TargetKind::kDeadLeaves || kind == model::TargetKind::kWhiteNoise ||
         kind == model::TargetKind::kPinkNoise;
}

TextureSpectrum::TextureSpectrum(const Texture& texture) : texture_(texture) {
  if (!HasSpectrum(texture.kind) || !(texture.feature_size_mm > 0) || !(texture.field_mm > 0))
    throw Error("a texture of dead leaves or noise with a size > 0 is expected");
  if (texture.kind == model::TargetKind::kDeadLeaves) {
    TabulateLeaves();
    return;
  }
  const double amplitude = texture.contrast / 2;
  const double variance = std::pow(amplitude * MeanSlopeOfLimit(amplitude), 2);
  const double highest = 1 / texture.feature_size_mm, lowest = 1 / texture.field_mm;
  // The integral of the density over the frequencies is the variance.
  const double integral = texture.kind == model::TargetKind::kWhiteNoise
                              ? highest * highest
                              : lowest * lowest * (1 + 2 * std::log(highest / lowest));
  level_mm2_ = variance / (kPi * integral);
}

void TextureSpectrum::TabulateLeaves() {
  const double r0 = texture_.feature_size_mm;
  const double r1 = std::max(kLargestLeaf * texture_.field_mm, 2 * r0);
  const double variance = texture_.contrast * texture_.contrast / 3;
  const double mean_area = kPi * std::log(r1 / r0);
  // Radii in equal steps of the logarithm: the weight r^-3 dr is r^-2 d ln r.
  const double log_step = std::log(r1 / r0) / kRadii;
  const int count = static_cast<int>(std::ceil(2 * r1 / r0 * kStepsPerSmallest));
  // At most so many; the steps are then wider than a part of the smallest leaf.
  const int steps = std::min(count, 6000);
  const double dx = 2 * r1 / steps;
  std::vector<double> weighted(static_cast<std::size_t>(steps));  // covariance times x dx
  for (int i = 0; i < steps; ++i) {
    if (i % 256 == 0) ThrowIfCancelled();
    const double x = (i + 0.5) * dx;
    double shared = 0;
    for (int j = 0; j < kRadii; ++j) {
      const double radius = r0 * std::exp((j + 0.5) * log_step);
      shared += SharedArea(radius, x) / (radius * radius) * log_step;
    }
    const double g = shared / mean_area;
    weighted[static_cast<std::size_t>(i)] = variance * g / (2 - g) * x * dx;
  }
  first_ = std::log(kCyclesPerLeaf[0] / r1);
  step_ = (std::log(kCyclesPerLeaf[1] / r0) - first_) / (kFrequencies - 1);
  for (int k = 0; k < kFrequencies; ++k) {
    ThrowIfCancelled();
    const double omega = 2 * kPi * std::exp(first_ + k * step_);
    double sum = 0;
    for (int i = 0; i < steps; ++i)
      sum += weighted[static_cast<std::size_t>(i)] * ::j0(omega * (i + 0.5) * dx);
    densities_mm2_.push_back(std::max(2 * kPi * sum, 1e-30));
  }
}

double TextureSpectrum::DensityMm2(double cycles_per_mm) const {
  if (texture_.kind != model::TargetKind::kDeadLeaves) {
    if (cycles_per_mm * texture_.feature_size_mm > 1) return 0;
    if (texture_.kind == model::TargetKind::kWhiteNoise) return level_mm2_;
    const double lowest = 1 / texture_.field_mm;
    return level_mm2_ * std::pow(lowest / std::max(cycles_per_mm, lowest), 2);
  }
  const double place = (std::log(std::max(cycles_per_mm, 1e-12)) - first_) / step_;
  const double last = kFrequencies - 1;
  if (place <= 0) return densities_mm2_.front();
  if (place >= last) {  // edges: the power falls as the third power of the frequency
    return densities_mm2_.back() * std::exp(-3 * (place - last) * step_);
  }
  const auto below = static_cast<std::size_t>(place);
  const double rest = place - static_cast<double>(below);
  return std::exp((1 - rest) * std::log(densities_mm2_[below]) +
                  rest * std::log(densities_mm2_[std::min(below + 1, densities_mm2_.size() - 1)]));
}

}  // namespace thicklens::calib

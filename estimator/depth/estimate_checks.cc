#include "thicklens/estimator/estimate_checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"

namespace thicklens::estimator {
namespace {

constexpr int kPatchPx = 32;
constexpr double kFarAbove = 4;
constexpr double kAbove = 1.5;
constexpr double kMinCounted = 0.1;  // share of all blocks
constexpr float kMaxOccluded = 0.01F;

std::size_t Index(int width_px, int x, int y) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_px) +
         static_cast<std::size_t>(x);
}

// Returns the upper one if there are two medians.
template <typename Number>
Number Median(std::vector<Number>* values) {
  const auto middle = values->begin() + static_cast<std::ptrdiff_t>(values->size() / 2);
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

// A subset of the rows and columns of a large map is sufficient.
int StrideFor(int width_px, int height_px) {
  constexpr double kEnough = 1 << 20;
  return std::max(1, static_cast<int>(std::sqrt(width_px * 1.0 * height_px / kEnough)));
}

struct Patch {
  ResidualPatch place;
  int counted = 0;
};

Patch MeasurePatch(const std::vector<float>& residual, const std::vector<float>& occluded_fraction,
                   int width_px, const ResidualPatch& place) {
  Patch patch{place};
  double sum = 0;
  for (int y = place.y; y < place.y + place.height_px; ++y) {
    for (int x = place.x; x < place.x + place.width_px; ++x) {
      const std::size_t i = Index(width_px, x, y);
      if (occluded_fraction[i] > kMaxOccluded) continue;
      sum += static_cast<double>(residual[i]) * static_cast<double>(residual[i]);
      ++patch.counted;
    }
  }
  if (patch.counted > 0) patch.place.rms = std::sqrt(sum / patch.counted);
  return patch;
}

std::size_t Blocks(int size_px) {
  return static_cast<std::size_t>((size_px + kPatchPx - 1) / kPatchPx);
}

// Returns the blocks of which the whole aperture sees enough.
std::vector<ResidualPatch> MeasurePatches(const std::vector<float>& residual,
                                          const std::vector<float>& occluded_fraction, int width_px,
                                          int height_px) {
  const std::size_t pixels =
      static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px);
  if (residual.size() != pixels || occluded_fraction.size() != pixels) {
    throw Error(fmt::format(
        "residual and occluded_fraction have {} and {} values: each must have {}, one per pixel",
        residual.size(), occluded_fraction.size(), pixels));
  }
  std::vector<ResidualPatch> patches;
  for (int y = 0; y < height_px; y += kPatchPx) {
    ThrowIfCancelled();
    for (int x = 0; x < width_px; x += kPatchPx) {
      const Patch patch = MeasurePatch(
          residual, occluded_fraction, width_px,
          {x, y, std::min(kPatchPx, width_px - x), std::min(kPatchPx, height_px - y), 0});
      if (4 * patch.counted < patch.place.width_px * patch.place.height_px) continue;
      patches.push_back(patch.place);
    }
  }
  return patches;
}

}  // namespace

StepCheck CheckSteps(const DisparityMap& map, const Eigen::Vector2d& landing_step_px) {
  StepCheck check;
  std::size_t known = 0, beyond = 0;
  for (const float disparity : map.disparity) {
    if (std::isnan(disparity)) continue;
    ++known;
    const Eigen::Vector2d step_px = static_cast<double>(disparity) * map.step - landing_step_px;
    const double largest_px = step_px.cwiseAbs().maxCoeff();
    check.largest_px = std::max(check.largest_px, largest_px);
    if (largest_px > kLargestStepPx) ++beyond;
  }
  if (known > 0) check.share = static_cast<double>(beyond) / static_cast<double>(known);
  return check;
}

std::optional<double> DepthNoisePx(const DisparityMap& map) {
  // Normal noise of unit variance: the standard deviation of its second difference, times the
  // median absolute value of a unit normal variable.
  const double kMedianOfUnitNoise = 0.6745 * std::sqrt(6.0);
  const int stride = StrideFor(map.width_px, map.height_px);
  std::vector<float> second;
  const auto add = [&](float before, float at, float after) {
    const float difference = std::abs(before - 2 * at + after);
    if (!std::isnan(difference)) second.push_back(difference);
  };
  const auto value = [&](int x, int y) { return map.disparity[Index(map.width_px, x, y)]; };
  for (int y = 0; y < map.height_px; y += stride) {
    ThrowIfCancelled();
    for (int x = 0; x < map.width_px; x += stride) {
      if (x > 0 && x + 1 < map.width_px) add(value(x - 1, y), value(x, y), value(x + 1, y));
      if (y > 0 && y + 1 < map.height_px) add(value(x, y - 1), value(x, y), value(x, y + 1));
    }
  }
  if (second.empty()) return std::nullopt;
  return static_cast<double>(Median(&second)) / kMedianOfUnitNoise * map.step.cwiseAbs().maxCoeff();
}

std::vector<ResidualPatch> ResidualPatches(const std::vector<float>& residual,
                                           const std::vector<float>& occluded_fraction,
                                           int width_px, int height_px, double noise_sigma) {
  std::vector<ResidualPatch> patches =
      MeasurePatches(residual, occluded_fraction, width_px, height_px);
  std::vector<double> all;
  all.reserve(patches.size());
  for (const ResidualPatch& patch : patches) all.push_back(patch.rms);
  if (all.empty()) return {};
  const double usual = kFarAbove * std::max(noise_sigma, Median(&all));
  patches.erase(
      std::remove_if(patches.begin(), patches.end(),
                     [usual](const ResidualPatch& patch) { return !(patch.rms > usual); }),
      patches.end());
  std::stable_sort(patches.begin(), patches.end(),
                   [](const ResidualPatch& a, const ResidualPatch& b) { return a.rms > b.rms; });
  return patches;
}

std::optional<double> UnexplainedShare(const std::vector<float>& residual,
                                       const std::vector<float>& occluded_fraction, int width_px,
                                       int height_px, double noise_sigma) {
  const std::vector<ResidualPatch> patches =
      MeasurePatches(residual, occluded_fraction, width_px, height_px);
  const auto blocks = static_cast<double>(Blocks(width_px) * Blocks(height_px));
  if (patches.empty() || static_cast<double>(patches.size()) < kMinCounted * blocks) {
    return std::nullopt;
  }
  const double usual = kAbove * noise_sigma;
  const auto above =
      std::count_if(patches.begin(), patches.end(),
                    [usual](const ResidualPatch& patch) { return patch.rms > usual; });
  return static_cast<double>(above) / static_cast<double>(patches.size());
}

}  // namespace thicklens::estimator

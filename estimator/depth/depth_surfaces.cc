#include "estimator/depth/depth_surfaces.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "thicklens/base/cancel.h"

namespace thicklens::estimator {
namespace {

constexpr float kNoSample = std::numeric_limits<float>::quiet_NaN();
// Two samples belong to one surface if they differ by less than this share of the map's range.
constexpr double kJumpOfRange = 0.02;
// A difference that is that of the next samples, within this share, is a slope.
constexpr float kSlopeTolerance = 0.3F;
// A sample is a mixture of two surfaces only if it lies in the middle between them: nearer to one
// of them, it more often is the rim of a rounded surface.
constexpr float kMixedFrom = 0.25F;

}  // namespace

DepthSurfaces::DepthSurfaces(const DepthSampling& map)
    : width_(map.width_px), height_(map.height_px), values_(map.values), weights_(map.confidence) {
  if (weights_.empty()) weights_.assign(values_.size(), 1.0F);
  for (std::size_t i = 0; i < values_.size(); ++i) {
    if (i % Index(width_) == 0) ThrowIfCancelled();
    if (!std::isfinite(values_[i]) || !(weights_[i] > 0)) {
      values_[i] = kNoSample;
      weights_[i] = 0;
    }
  }
  FindJump();
  GiveMixedSamplesAway();
  for (std::size_t n = 0; n < kSteps.size(); ++n) {
    linked_[n].assign(values_.size(), 0);
    for (int y = 0; y < height_; ++y) {
      ThrowIfCancelled();
      for (int x = 0; x < width_; ++x)
        linked_[n][At(x, y)] = AreLinked(x, y, kSteps[n][0], kSteps[n][1]) ? 1 : 0;
    }
  }
}

float DepthSurfaces::ValueOrHole(int x, int y) const {
  return x < 0 || y < 0 || x >= width_ || y >= height_ ? kNoSample : values_[At(x, y)];
}

void DepthSurfaces::FindJump() {
  std::vector<float> known, bends;
  for (int y = 0; y < height_; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < width_; ++x) {
      const float v = value(x, y);
      if (std::isnan(v)) continue;
      known.push_back(v);
      const float bend = ValueOrHole(x - 1, y) - 2 * v + ValueOrHole(x + 1, y);
      if (!std::isnan(bend)) bends.push_back(std::abs(bend));
    }
  }
  if (known.empty()) return;
  const auto rank = [](std::vector<float>* list, double share) {
    const auto n = static_cast<std::ptrdiff_t>(share * static_cast<double>(list->size() - 1));
    std::nth_element(list->begin(), list->begin() + n, list->end());
    return static_cast<double>((*list)[static_cast<std::size_t>(n)]);
  };
  const double range = rank(&known, 0.99) - rank(&known, 0.01);
  // The second difference of independent noise has sqrt(6) times its standard deviation, and a
  // quarter of a normal distribution's magnitudes are below 0.3186 of its own. Maps of many edges
  // have larger differences, but not in a quarter of their samples.
  const double noise = bends.empty() ? 0 : rank(&bends, 0.25) / (0.3186 * std::sqrt(6.0));
  constexpr double kOfNoise = 5, kMaxOfRange = 0.1;
  jump_ =
      static_cast<float>(std::clamp(kOfNoise * noise, kJumpOfRange * range, kMaxOfRange * range));
}

// A sample strictly between its neighbours on both sides, by more than a jump each, whose
// neighbours continue flat, is no point of a scene: averaging made it.
void DepthSurfaces::GiveMixedSamplesAway() {
  const std::vector<float> found = values_;
  const auto at = [&](int x, int y) {
    return x < 0 || y < 0 || x >= width_ || y >= height_ ? kNoSample : found[At(x, y)];
  };
  for (int y = 0; y < height_; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < width_; ++x) {
      const float own = at(x, y);
      if (std::isnan(own)) continue;
      for (const auto& [dx, dy] : kSteps) {
        const float before = at(x - dx, y - dy), after = at(x + dx, y + dy);
        const float half = std::abs(after - before) / 2;
        const float place = (own - before) / (after - before);
        if (!(half > jump_) || !(place > kMixedFrom && place < 1 - kMixedFrom)) {
          continue;
        }
        // On a slope the samples beyond differ as much.
        const float beyond_before = std::abs(before - at(x - 2 * dx, y - 2 * dy));
        const float beyond_after = std::abs(after - at(x + 2 * dx, y + 2 * dy));
        if (std::isnan(beyond_before) && std::isnan(beyond_after)) continue;
        if (beyond_before > half / 2 || beyond_after > half / 2) continue;
        values_[At(x, y)] = std::abs(own - before) < std::abs(own - after) ? before : after;
        ++mixed_;
        break;
      }
    }
  }
}

bool DepthSurfaces::AreLinked(int x, int y, int dx, int dy) const {
  const float difference = ValueOrHole(x + dx, y + dy) - value(x, y);
  if (std::isnan(difference)) return false;
  if (std::abs(difference) <= jump_) return true;
  const float before = value(x, y) - ValueOrHole(x - dx, y - dy);
  const float after = ValueOrHole(x + 2 * dx, y + 2 * dy) - ValueOrHole(x + dx, y + dy);
  const float limit = kSlopeTolerance * std::abs(difference);
  return std::abs(difference - before) < limit || std::abs(difference - after) < limit;
}

}  // namespace thicklens::estimator

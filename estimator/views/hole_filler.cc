#include "estimator/views/hole_filler.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "estimator/views/surface_taps.h"
#include "thicklens/base/cancel.h"

namespace thicklens::estimator {
namespace {

// std::floor is a function call in builds for older processors. `x` must be in the range of int.
int Floor(double x) {
  const int toward_zero = static_cast<int>(x);
  return toward_zero > x ? toward_zero - 1 : toward_zero;
}

std::array<HoleFiller::Sample, 4> Neighbours(const HoleFiller::Sample& of) {
  return {{{of.x + 1, of.y}, {of.x - 1, of.y}, {of.x, of.y + 1}, {of.x, of.y - 1}}};
}

// Limits [first, last] to the whole numbers n at which floor(x + n step + 1/2) may be 0 to count -
// 1.
void CutSteps(double x, double step, int count, int* first, int* last) {
  if (step == 0) return;
  const double at_start = (-0.5 - x) / step, at_end = (count - 0.5 - x) / step;
  *first = static_cast<int>(std::max<double>(*first, std::floor(std::min(at_start, at_end))));
  *last = static_cast<int>(std::min<double>(*last, std::ceil(std::max(at_start, at_end))));
}

}  // namespace

SupportedPixels FindSupported(const DisparityMap& map, const std::vector<char>& is_surface) {
  const int width_px = map.width_px, height_px = map.height_px;
  const auto width = static_cast<std::size_t>(width_px);
  SupportedPixels supported;
  std::vector<char>& is_supported = supported.is_supported;
  is_supported.assign(map.disparity.size(), 0);
  // Each cell of a pixel contains three of the pixel's neighbours.
  for (std::size_t i = 0; i < is_surface.size(); ++i) {
    if (is_surface[i] == 0) continue;
    is_supported[i] = is_supported[i + 1] = 1;
    is_supported[i + width] = is_supported[i + width + 1] = 1;
  }
  const auto same_surface = static_cast<float>(SurfaceTolerance(map));
  const int needed = std::min(width_px, height_px) == 1 ? 1 : 2;
  std::size_t i = 0;
  for (int y = 0; y < height_px; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < width_px; ++x, ++i) {
      const float disparity = map.disparity[i];
      if (is_supported[i] == 0) {
        int found = -1;  // the pixel itself is found as well
        for (int v = std::max(y - 1, 0); v <= std::min(y + 1, height_px - 1); ++v) {
          const float* const row = map.disparity.data() + static_cast<std::size_t>(v) * width;
          for (int u = std::max(x - 1, 0); u <= std::min(x + 1, width_px - 1); ++u)
            found += std::abs(row[u] - disparity) <= same_surface ? 1 : 0;
        }
        if (found < needed) continue;
        is_supported[i] = 1;
      }
      supported.lowest = std::min(supported.lowest.value_or(disparity), disparity);
    }
  }
  return supported;
}

HoleFiller::HoleFiller(const DisparityMap& map, const SupportedPixels& supported,
                       const DisparityBuffer& buffer, const Eigen::Vector2d& shift)
    : map_(map),
      supported_(supported),
      buffer_(buffer),
      shift_(shift),
      px_per_unit_(shift.cwiseAbs().maxCoeff()),
      direction_(shift / px_per_unit_),
      same_surface_(static_cast<float>(SurfaceTolerance(map))) {
  for (int y = 0; y < buffer.height_px(); ++y) {
    ThrowIfCancelled();
    const float* const row = buffer.row(y);
    int count = 0;
    for (int x = 0; x < buffer.width_px(); ++x) count += row[x] == DisparityBuffer::kUncovered;
    for (int x = 0; count > 0; ++x) {
      if (row[x] != DisparityBuffer::kUncovered) continue;
      holes_.push_back({x, y});
      --count;
    }
  }
  // Steps that are longer than the image lead out of it.
  const double longest = std::max(map.width_px, map.height_px);
  first_step_ = static_cast<int>(
      std::clamp(std::floor(px_per_unit_ * supported.lowest.value_or(0)), -longest, longest));
}

HoleFiller::Source HoleFiller::Background(int x, int y) {
  const Sample hole{x, y};
  const std::optional<Found> ahead = Walk(x, y, 1);
  const std::optional<Found> back = Walk(x, y, -1);
  if (const std::optional<Sample> last = LastBefore(x, y)) {
    const float disparity = map_.disparity[buffer_.Index(last->x, last->y)];
    const auto is_its_surface = [&](const std::optional<Found>& found) {
      return found &&
             std::abs(buffer_.at(found->sample.x, found->sample.y) - disparity) <= same_surface_;
    };
    const bool take_ahead = is_its_surface(ahead), take_back = is_its_surface(back);
    if (!take_ahead && !take_back) {
      return {static_cast<double>(last->x - x), static_cast<double>(last->y - y), disparity};
    }
    const bool ahead_is_closer = take_ahead && (!take_back || ahead->steps <= back->steps);
    return SourceAt(hole, ahead_is_closer ? ahead->sample : back->sample);
  }
  if (!ahead && !back) return SourceAt(hole, Closest(x, y));
  if (!ahead) return SourceAt(hole, back->sample);
  if (!back) return SourceAt(hole, ahead->sample);
  const float ahead_disparity = buffer_.at(ahead->sample.x, ahead->sample.y);
  const float back_disparity = buffer_.at(back->sample.x, back->sample.y);
  const bool take_ahead = ahead_disparity == back_disparity ? ahead->steps <= back->steps
                                                            : ahead_disparity < back_disparity;
  return SourceAt(hole, take_ahead ? ahead->sample : back->sample);
}

HoleFiller::Source HoleFiller::SourceAt(const Sample& hole, const Sample& covered) const {
  const float disparity = buffer_.at(covered.x, covered.y);
  return {covered.x - hole.x + shift_.x() * disparity, covered.y - hole.y + shift_.y() * disparity,
          disparity};
}

HoleFiller::Sample HoleFiller::At(int x, int y, int steps) const {
  return {Floor(x + steps * direction_.x() + 0.5), Floor(y + steps * direction_.y() + 0.5)};
}

// The ray of the sample passes over the centre view's pixel at n steps where its own disparity is n
// / px_per_unit_. From the far end on, the ray is behind the pixels, up to the first pixel whose
// disparity is below that. Beyond that pixel, away from the viewer, the ray stays occluded from the
// centre. A pixel without support is no surface to pass in front of.
std::optional<HoleFiller::Sample> HoleFiller::LastBefore(int x, int y) const {
  if (!supported_.lowest) return std::nullopt;
  int first = first_step_;
  int last = std::max(map_.width_px, map_.height_px);
  CutSteps(x, direction_.x(), buffer_.width_px(), &first, &last);
  CutSteps(y, direction_.y(), buffer_.height_px(), &first, &last);
  for (int steps = first; steps <= last; ++steps) {
    const Sample at = At(x, y, steps);
    if (!buffer_.IsInside(at.x, at.y)) continue;
    const std::size_t i = buffer_.Index(at.x, at.y);
    if (supported_.is_supported[i] != 0 && px_per_unit_ * map_.disparity[i] < steps) return at;
  }
  return std::nullopt;
}

std::optional<HoleFiller::Found> HoleFiller::Walk(int x, int y, int sense) const {
  for (int steps = 1;; ++steps) {
    const Sample at = At(x, y, sense * steps);
    if (!buffer_.IsInside(at.x, at.y)) return std::nullopt;
    if (buffer_.IsCovered(at.x, at.y)) return Found{at, steps};
  }
}

HoleFiller::Sample HoleFiller::Closest(int x, int y) {
  if (closest_.empty()) SpreadCovered();
  const int origin = closest_[buffer_.Index(x, y)];
  return {origin % buffer_.width_px(), origin / buffer_.width_px()};
}

// The search is breadth first, from all covered samples beside a hole at once, row by row.
void HoleFiller::SpreadCovered() {
  closest_.assign(buffer_.Index(0, buffer_.height_px()), -1);
  const auto closest_of = [this](const Sample& of) -> int& {
    return closest_[buffer_.Index(of.x, of.y)];
  };
  std::vector<Sample> queue;
  for (const Sample& hole : holes_) {
    ThrowIfCancelled();
    for (const Sample& beside : Neighbours(hole)) {
      if (!buffer_.IsInside(beside.x, beside.y) || !buffer_.IsCovered(beside.x, beside.y) ||
          closest_of(beside) >= 0) {
        continue;
      }
      closest_of(beside) = static_cast<int>(buffer_.Index(beside.x, beside.y));
      queue.push_back(beside);
    }
  }
  std::sort(queue.begin(), queue.end(),
            [](const Sample& a, const Sample& b) { return a.y != b.y ? a.y < b.y : a.x < b.x; });
  for (std::size_t i = 0; i < queue.size(); ++i) {
    ThrowIfCancelled();
    const Sample from = queue[i];
    for (const Sample& to : Neighbours(from)) {
      if (!buffer_.IsInside(to.x, to.y) || buffer_.IsCovered(to.x, to.y) || closest_of(to) >= 0) {
        continue;
      }
      closest_of(to) = closest_of(from);
      queue.push_back(to);
    }
  }
}

}  // namespace thicklens::estimator

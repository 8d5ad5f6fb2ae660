#include "hole_filler.h"

#include <algorithm>
#include <array>

namespace thicklens::estimator {
namespace {

// std::floor is a call where the processor may be an old one. `x` must be in the range of int.
int Floor(double x) {
  const int toward_zero = static_cast<int>(x);
  return toward_zero > x ? toward_zero - 1 : toward_zero;
}

std::array<HoleFiller::Sample, 4> Neighbours(const HoleFiller::Sample& of) {
  return {{{of.x + 1, of.y}, {of.x - 1, of.y}, {of.x, of.y + 1}, {of.x, of.y - 1}}};
}

}  // namespace

HoleFiller::HoleFiller(const DisparityBuffer& buffer, const Eigen::Vector2d& direction)
    : buffer_(buffer), direction_(direction / direction.cwiseAbs().maxCoeff()) {
  for (int y = 0; y < buffer.height_px(); ++y) {
    const float* const row = buffer.row(y);
    int count = 0;
    for (int x = 0; x < buffer.width_px(); ++x) count += row[x] == DisparityBuffer::kUncovered;
    for (int x = 0; count > 0; ++x) {
      if (row[x] != DisparityBuffer::kUncovered) continue;
      holes_.push_back({x, y});
      --count;
    }
  }
}

HoleFiller::Sample HoleFiller::Background(int x, int y) {
  const std::optional<Found> ahead = Walk(x, y, 1);
  const std::optional<Found> back = Walk(x, y, -1);
  if (!ahead && !back) return Closest(x, y);
  if (!ahead) return back->sample;
  if (!back) return ahead->sample;
  const float ahead_disparity = buffer_.at(ahead->sample.x, ahead->sample.y);
  const float back_disparity = buffer_.at(back->sample.x, back->sample.y);
  if (ahead_disparity == back_disparity) {
    return ahead->steps <= back->steps ? ahead->sample : back->sample;
  }
  return ahead_disparity < back_disparity ? ahead->sample : back->sample;
}

std::optional<HoleFiller::Found> HoleFiller::Walk(int x, int y, int sense) const {
  for (int steps = 1;; ++steps) {
    const Sample at{Floor(x + sense * steps * direction_.x() + 0.5),
                    Floor(y + sense * steps * direction_.y() + 0.5)};
    if (!buffer_.IsInside(at.x, at.y)) return std::nullopt;
    if (buffer_.IsCovered(at.x, at.y)) return Found{at, steps};
  }
}

HoleFiller::Sample HoleFiller::Closest(int x, int y) {
  if (closest_.empty()) SpreadCovered();
  const int origin = closest_[buffer_.Index(x, y)];
  return {origin % buffer_.width_px(), origin / buffer_.width_px()};
}

// Breadth first, from all covered samples beside a hole at once, row by row.
void HoleFiller::SpreadCovered() {
  closest_.assign(buffer_.Index(0, buffer_.height_px()), -1);
  const auto closest_of = [this](const Sample& of) -> int& {
    return closest_[buffer_.Index(of.x, of.y)];
  };
  std::vector<Sample> queue;
  for (const Sample& hole : holes_) {
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

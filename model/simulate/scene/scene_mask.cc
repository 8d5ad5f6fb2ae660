#include "model/simulate/scene/scene_mask.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

const LinearImage& Checked(const LinearImage& image, int width_px, int height_px,
                           const std::string& name) {
  if (image.width_px < 1 || image.height_px < 1) throw Error(name + " is empty");
  if (image.channels != 1) {
    throw Error(fmt::format("{} has {} channels: a mask must be a grey image with 1 channel", name,
                            image.channels));
  }
  if (image.width_px != width_px || image.height_px != height_px) {
    throw Error(
        fmt::format("{} has {}x{} px, but the scene's image has {}x{} px: the sizes must be equal",
                    name, image.width_px, image.height_px, width_px, height_px));
  }
  return image;
}

// Position at which a line from the first value to the second, one px away, has the value `level`.
double CrossingPx(double first, double second, double level) {
  return (level - first) / (second - first);
}

}  // namespace

SceneMask::SceneMask(const LinearImage& image, int width_px, int height_px, const std::string& name)
    : width_px_(width_px),
      height_px_(height_px),
      values_(Checked(image, width_px, height_px, name).values),
      bounds_(width_px, height_px, [this](int x, int y) { return At(x, y); }) {
  if (std::all_of(values_.begin(), values_.end(),
                  [](float value) { return static_cast<double>(value) < kHalf; })) {
    throw Error(fmt::format("{} is empty: none of its {} values is at least half of full scale",
                            name, values_.size()));
  }
  FindExtent();
}

double SceneMask::At(int x, int y) const {
  return static_cast<double>(values_[static_cast<std::size_t>(std::clamp(y, 0, height_px_ - 1)) *
                                         static_cast<std::size_t>(width_px_) +
                                     static_cast<std::size_t>(std::clamp(x, 0, width_px_ - 1))]);
}

bool SceneMask::IsInside(const Eigen::Vector2d& position_px) const {
  const float zero = 0;
  bool inside = false;
  AreInside(position_px, &zero, &zero, 1, &inside);
  return inside;
}

void SceneMask::AreInside(const Eigen::Vector2d& centre_px, const float* x_px, const float* y_px,
                          int count, bool* inside) const {
  const Eigen::Vector2d most_px(width_px_ - 1, height_px_ - 1);
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d at_px = (centre_px + Eigen::Vector2f(x_px[i], y_px[i]).cast<double>())
                                      .cwiseMax(0)
                                      .cwiseMin(most_px);
    const int x = static_cast<int>(at_px.x()), y = static_cast<int>(at_px.y());
    const double fx = at_px.x() - x, fy = at_px.y() - y;
    const double above = At(x, y) + fx * (At(x + 1, y) - At(x, y));
    const double below = At(x, y + 1) + fx * (At(x + 1, y + 1) - At(x, y + 1));
    inside[i] = above + fy * (below - above) >= kHalf;
  }
}

// Between two rows of pixels the values of each column are linear. The inside therefore extends as
// far to the sides on one of the rows, where the values are linear too, as anywhere between them.
void SceneMask::FindExtent() {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  extent_ = {{kInfinity, kInfinity}, {-kInfinity, -kInfinity}};
  // Includes a pixel that is inside and has the index `at` on a line; `before` and `after` are the
  // values of its neighbours.
  const auto include = [&](int axis, int at, int size, double before, double here, double after) {
    double low = at, high = at;
    if (before < kHalf) low = at - 1 + CrossingPx(before, here, kHalf);
    if (after < kHalf) high = at + CrossingPx(here, after, kHalf);
    if (at == 0) low = -kInfinity;
    if (at == size - 1) high = kInfinity;
    extent_.low_px(axis) = std::min(extent_.low_px(axis), low);
    extent_.high_px(axis) = std::max(extent_.high_px(axis), high);
  };
  for (int y = 0; y < height_px_; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < width_px_; ++x) {
      const double here = At(x, y);
      if (here < kHalf) continue;
      include(0, x, width_px_, At(x - 1, y), here, At(x + 1, y));
      include(1, y, height_px_, At(x, y - 1), here, At(x, y + 1));
    }
  }
}

}  // namespace thicklens::model

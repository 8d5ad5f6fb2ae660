#include "tests/estimator/views/plain_views.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <queue>
#include <utility>

namespace thicklens::estimator::testing {
namespace {

constexpr double kTolerancePx = 1e-5;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Vertex {
  double x, y, disparity;
};

std::size_t At(int x, int y, int width) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
         static_cast<std::size_t>(x);
}

double Edge(const Vertex& p, const Vertex& q, double x, double y) {
  return (p.x - x) * (q.y - y) - (q.x - x) * (p.y - y);
}

// The nearest surface at every sample of a view; -infinity if there is none.
struct Canvas {
  int width, height;
  std::vector<double> disparity;

  Canvas(int width_px, int height_px)
      : width(width_px), height(height_px), disparity(At(0, height_px, width_px), -kInfinity) {}

  bool IsCovered(int x, int y) const { return disparity[At(x, y, width)] > -kInfinity; }
  bool IsInside(int x, int y) const { return x >= 0 && y >= 0 && x < width && y < height; }

  void Put(int x, int y, double value) {
    disparity[At(x, y, width)] = std::max(disparity[At(x, y, width)], value);
  }

  // Calls `draw(x, y)` for the samples in the rectangle.
  template <typename Draw>
  void ForSamples(double left, double right, double top, double bottom, const Draw& draw) const {
    for (int y = std::max(0, Whole(std::ceil(top - kTolerancePx)));
         y <= std::min(height - 1, Whole(std::floor(bottom + kTolerancePx))); ++y) {
      for (int x = std::max(0, Whole(std::ceil(left - kTolerancePx)));
           x <= std::min(width - 1, Whole(std::floor(right + kTolerancePx))); ++x) {
        draw(x, y);
      }
    }
  }

  void Triangle(const Vertex& p, const Vertex& q, const Vertex& r) {
    const double area = Edge(p, q, r.x, r.y);
    if (!(std::abs(area) > 1e-9)) return;
    ForSamples(std::min({p.x, q.x, r.x}), std::max({p.x, q.x, r.x}), std::min({p.y, q.y, r.y}),
               std::max({p.y, q.y, r.y}), [&](int x, int y) {
                 const double sign = area > 0 ? 1 : -1;
                 const std::array<double, 3> share = {
                     sign * Edge(q, r, x, y), sign * Edge(r, p, x, y), sign * Edge(p, q, x, y)};
                 if (*std::min_element(share.begin(), share.end()) < -kTolerancePx) return;
                 const double in_p = std::max(share[0], 0.0);
                 const double in_q = std::max(share[1], 0.0);
                 const double in_r = std::max(share[2], 0.0);
                 Put(x, y,
                     (in_p * p.disparity + in_q * q.disparity + in_r * r.disparity) /
                         (in_p + in_q + in_r));
               });
  }

  void Square(const Vertex& centre) {
    ForSamples(centre.x - 0.5, centre.x + 0.5, centre.y - 0.5, centre.y + 0.5,
               [&](int x, int y) { Put(x, y, centre.disparity); });
  }

  static int Whole(double x) { return static_cast<int>(std::clamp(x, -1e9, 1e9)); }
};

Vertex VertexAt(const DisparityMap& map, const Eigen::Vector2d& shift, int x, int y) {
  const double d = map.disparity[At(x, y, map.width_px)];
  return {x - shift.x() * d, y - shift.y() * d, d};
}

// Draws the surfaces. Of each pixel whether it is at a jump.
std::vector<bool> Draw(const DisparityMap& map, const Eigen::Vector2d& shift, Canvas* canvas) {
  const int width = map.width_px;
  const auto vertex = [&](int x, int y) { return VertexAt(map, shift, x, y); };
  std::vector<bool> alone(map.disparity.size(), width == 1 || map.height_px == 1);
  for (int y = 0; y + 1 < map.height_px; ++y) {
    for (int x = 0; x + 1 < width; ++x) {
      const std::array<Vertex, 4> corner = {vertex(x, y), vertex(x + 1, y), vertex(x, y + 1),
                                            vertex(x + 1, y + 1)};
      const auto [low, high] = std::minmax(
          {corner[0].disparity, corner[1].disparity, corner[2].disparity, corner[3].disparity});
      if ((high - low) * map.step.cwiseAbs().maxCoeff() > 0.2) {
        for (const auto& [i, j] : {std::pair{0, 0}, {1, 0}, {0, 1}, {1, 1}}) {
          alone[At(x + i, y + j, width)] = true;
        }
        continue;
      }
      canvas->Triangle(corner[0], corner[1], corner[3]);
      canvas->Triangle(corner[0], corner[3], corner[2]);
    }
  }
  for (int y = 0; y < map.height_px; ++y) {
    for (int x = 0; x < width; ++x) {
      if (alone[At(x, y, width)]) canvas->Square(vertex(x, y));
    }
  }
  return alone;
}

using Sample = std::pair<int, int>;

// For each sample, the covered one with the fewest steps along rows and columns.
std::vector<Sample> Closest(const Canvas& canvas) {
  std::vector<Sample> closest(canvas.disparity.size(), Sample{-1, -1});
  std::queue<Sample> queue;
  for (int y = 0; y < canvas.height; ++y) {
    for (int x = 0; x < canvas.width; ++x) {
      if (!canvas.IsCovered(x, y)) continue;
      closest[At(x, y, canvas.width)] = {x, y};
      queue.push({x, y});
    }
  }
  for (; !queue.empty(); queue.pop()) {
    const auto [x, y] = queue.front();
    for (const auto& [dx, dy] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
      if (!canvas.IsInside(x + dx, y + dy)) continue;
      Sample& there = closest[At(x + dx, y + dy, canvas.width)];
      if (there.first >= 0) continue;
      there = closest[At(x, y, canvas.width)];
      queue.push({x + dx, y + dy});
    }
  }
  return closest;
}

// The background of a sample that is not covered.
struct Behind {
  double source_x = 0, source_y = 0, disparity = 0;
};

// The sample to which a step along the displacement leads.
Sample Stepped(const Eigen::Vector2d& step, int x, int y, double steps) {
  return {static_cast<int>(std::floor(x + steps * step.x() + 0.5)),
          static_cast<int>(std::floor(y + steps * step.y() + 0.5))};
}

// True if two of the pixels around it are of its surface, or one, if the surface is a line of
// pixels.
bool IsOfASurface(const DisparityMap& map, int x, int y) {
  const double here = map.disparity[At(x, y, map.width_px)];
  const double tolerance = static_cast<float>(0.3 / map.step.cwiseAbs().maxCoeff());
  int found = 0;
  for (int v = y - 1; v <= y + 1; ++v) {
    for (int u = x - 1; u <= x + 1; ++u) {
      if (u < 0 || v < 0 || u >= map.width_px || v >= map.height_px || (u == x && v == y)) continue;
      if (std::abs(map.disparity[At(u, v, map.width_px)] - here) <= tolerance) ++found;
    }
  }
  return found >= std::min({2, map.width_px, map.height_px});
}

// The pixel of the centre view after which the ray of a sample is hidden for good: of those that it
// passes before, and that are of a surface, the one at which it is farthest away. (-1, -1): none.
Sample LastPassed(const DisparityMap& map, const Eigen::Vector2d& shift, int x, int y) {
  const double per_unit = shift.cwiseAbs().maxCoeff();
  const int most = std::max(map.width_px, map.height_px);
  Sample last{-1, -1};
  for (int steps = most; steps >= -most; --steps) {
    const auto [xx, yy] = Stepped(shift / per_unit, x, y, steps);
    if (xx < 0 || yy < 0 || xx >= map.width_px || yy >= map.height_px) continue;
    if (!IsOfASurface(map, xx, yy)) continue;
    if (steps > per_unit * map.disparity[At(xx, yy, map.width_px)]) last = {xx, yy};
  }
  return last;
}

// The background that a sample that is not covered gets.
Behind Background(const DisparityMap& map, const Canvas& canvas, const Eigen::Vector2d& shift,
                  const std::vector<Sample>& closest, int x, int y) {
  struct End {
    Sample sample;
    int steps;
    double disparity;
  };
  std::vector<End> ends;
  for (const int sense : {1, -1}) {
    for (int n = 1;; ++n) {
      const auto [xx, yy] = Stepped(shift / shift.cwiseAbs().maxCoeff(), x, y, sense * n);
      if (!canvas.IsInside(xx, yy)) break;
      if (!canvas.IsCovered(xx, yy)) continue;
      const auto there = static_cast<float>(canvas.disparity[At(xx, yy, canvas.width)]);
      ends.push_back({{xx, yy}, n, double{there}});
      break;
    }
  }
  const Sample last = LastPassed(map, shift, x, y);
  if (last.first >= 0) {
    const double disparity = map.disparity[At(last.first, last.second, map.width_px)];
    const double tolerance = static_cast<float>(0.3 / map.step.cwiseAbs().maxCoeff());
    ends.erase(std::remove_if(
                   ends.begin(), ends.end(),
                   [&](const End& end) { return std::abs(end.disparity - disparity) > tolerance; }),
               ends.end());
    if (ends.empty()) {
      return {static_cast<double>(last.first), static_cast<double>(last.second), disparity};
    }
    for (End& end : ends) end.disparity = 0;  // the closer one, then
  }
  Sample found = closest[At(x, y, canvas.width)];
  if (!ends.empty()) {
    found = std::min_element(ends.begin(), ends.end(), [](const End& one, const End& other) {
              return std::pair(one.disparity, one.steps) < std::pair(other.disparity, other.steps);
            })->sample;
  }
  const double disparity = canvas.disparity[At(found.first, found.second, canvas.width)];
  return {found.first + shift.x() * disparity, found.second + shift.y() * disparity, disparity};
}

// The fraction of a sample's square that the squares of a surface's pixels cover at the positions
// that its disparity gives them. The border of the image is repeated.
double CoveredShare(const DisparityMap& map, int x, int y, const kernels::OccludedSample& from) {
  const double tolerance = static_cast<float>(0.3 / map.step.cwiseAbs().maxCoeff());
  const double at_x = x + double{from.source_x}, at_y = y + double{from.source_y};
  double covered = 0;
  for (int row = Canvas::Whole(at_y) - 1; row <= Canvas::Whole(at_y) + 1; ++row) {
    for (int column = Canvas::Whole(at_x) - 1; column <= Canvas::Whole(at_x) + 1; ++column) {
      const double there = map.disparity[At(std::clamp(column, 0, map.width_px - 1),
                                            std::clamp(row, 0, map.height_px - 1), map.width_px)];
      if (std::abs(there - from.disparity) > tolerance) continue;
      covered +=
          std::max(0.0, 1 - std::abs(column - at_x)) * std::max(0.0, 1 - std::abs(row - at_y));
    }
  }
  return covered;
}

kernels::OccludedSample OnSurface(const Eigen::Vector2d& shift, std::int32_t index,
                                  float disparity) {
  return {index, static_cast<float>(shift.x() * disparity),
          static_cast<float>(shift.y() * disparity), disparity};
}

// The surface beyond a disparity among the neighbours of a sample, direct neighbours before
// diagonal ones. A visible surface that the centre view shows at this sample as well is preferred,
// then a visible one as shown at the neighbour, then a hidden one.
bool FindBehind(const DisparityMap& map, const Eigen::Vector2d& shift, const ViewDisparity& view,
                int x, int y, float disparity, kernels::OccludedSample* behind) {
  const double tolerance = static_cast<float>(0.3 / map.step.cwiseAbs().maxCoeff());
  const auto index = static_cast<std::int32_t>(At(x, y, view.width_px));
  for (const auto& [kind, is_shown_here] : {std::pair{Visibility::kVisible, true},
                                            {Visibility::kVisible, false},
                                            {Visibility::kOccluded, false}}) {
    for (const auto& [dx, dy] :
         {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}, {-1, -1}, {1, -1}, {-1, 1}, {1, 1}}) {
      const int xx = x + dx, yy = y + dy;
      if (xx < 0 || yy < 0 || xx >= view.width_px || yy >= view.height_px) continue;
      const std::size_t there = At(xx, yy, view.width_px);
      if (view.visibility[there] != kind || !(view.disparity[there] < disparity - tolerance))
        continue;
      *behind = OnSurface(shift, index, view.disparity[there]);
      if (kind == Visibility::kOccluded) {
        *behind = {static_cast<std::int32_t>(there), view.source_x[there], view.source_y[there],
                   view.disparity[there]};
      }
      if (CoveredShare(map, x, y, *behind) >= 0.01) return true;
      if (is_shown_here) continue;
      behind->source_x += static_cast<float>(dx);
      behind->source_y += static_cast<float>(dy);
      return true;
    }
  }
  return false;
}

// Surfaces that could share the pixel of a sample.
struct Sharers {
  std::vector<kernels::BoundarySample> of_others;
  // Parts of the surface of an occluded sample that are visible nevertheless.
  std::vector<kernels::BoundarySample> of_its_own;
};
Sharers SharersOf(const DisparityMap& map, const Eigen::Vector2d& shift, const ViewDisparity& view,
                  const std::vector<bool>& at_jump, int x, int y) {
  const double tolerance = static_cast<float>(0.3 / map.step.cwiseAbs().maxCoeff());
  const std::size_t i = At(x, y, map.width_px);
  const auto index = static_cast<std::int32_t>(i);
  const bool is_occluded = view.visibility[i] == Visibility::kOccluded;
  Sharers sharers;
  for (std::size_t p = 0; p < at_jump.size(); ++p) {
    if (!at_jump[p]) continue;
    const auto width = static_cast<std::size_t>(map.width_px);
    const Vertex lands =
        VertexAt(map, shift, static_cast<int>(p % width), static_cast<int>(p / width));
    // Squares of 1 px that overlap.
    if (x != std::floor(lands.x) && x != std::floor(lands.x) + 1) continue;
    if (y != std::floor(lands.y) && y != std::floor(lands.y) + 1) continue;
    const auto disparity = static_cast<float>(lands.disparity);
    const bool is_nearer = disparity > view.disparity[i] + tolerance;
    if (disparity < view.disparity[i] - tolerance) continue;
    kernels::OccludedSample other = OnSurface(shift, index, disparity);
    double share = CoveredShare(map, x, y, other);
    if (!is_nearer && !is_occluded) {
      if (!FindBehind(map, shift, view, x, y, view.disparity[i], &other)) continue;
      share = 1 - CoveredShare(map, x, y, OnSurface(shift, index, view.disparity[i]));
    }
    if (share < 0.01) continue;
    (is_nearer || !is_occluded ? sharers.of_others : sharers.of_its_own)
        .push_back({index, other, static_cast<float>(share)});
  }
  return sharers;
}

std::array<double, 4> CatmullRom(double f) {
  return {0.5 * (-f * f * f + 2 * f * f - f), 0.5 * (3 * f * f * f - 5 * f * f + 2),
          0.5 * (-3 * f * f * f + 4 * f * f + f), 0.5 * (f * f * f - f * f)};
}

}  // namespace

ViewDisparity PlainView(const DisparityMap& map, double a, double b) {
  const int width = map.width_px;
  const Eigen::Vector2d shift(a * map.step.x(), b * map.step.y());
  const std::vector<float> zero(map.disparity.size(), 0);
  ViewDisparity view{width, map.height_px, map.disparity, {}, zero, zero, {}};
  view.visibility.assign(map.disparity.size(), Visibility::kVisible);
  if (shift == Eigen::Vector2d::Zero()) return view;
  Canvas canvas(width, map.height_px);
  const std::vector<bool> at_jump = Draw(map, shift, &canvas);
  const std::vector<Sample> closest = Closest(canvas);
  const bool nothing_covered = closest.front().first < 0;
  for (int y = 0; y < map.height_px; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::size_t i = At(x, y, width);
      const double drawn = canvas.disparity[i];
      Behind shown{x + shift.x() * drawn, y + shift.y() * drawn, drawn};
      if (!canvas.IsCovered(x, y)) {
        view.visibility[i] = Visibility::kOccluded;
        if (nothing_covered) continue;
        shown = Background(map, canvas, shift, closest, x, y);
      }
      view.disparity[i] = static_cast<float>(shown.disparity);
      view.source_x[i] = static_cast<float>(shown.source_x - x);
      view.source_y[i] = static_cast<float>(shown.source_y - y);
    }
  }
  for (int y = 0; y < map.height_px; ++y) {
    for (int x = 0; x < width; ++x) {
      const Sharers sharers = SharersOf(map, shift, view, at_jump, x, y);
      const std::vector<kernels::BoundarySample>& likely =
          sharers.of_others.empty() ? sharers.of_its_own : sharers.of_others;
      const auto most = std::max_element(
          likely.begin(), likely.end(),
          [](const kernels::BoundarySample& one, const kernels::BoundarySample& other) {
            return std::pair(one.share, one.other.disparity) <
                   std::pair(other.share, other.other.disparity);
          });
      if (most != likely.end()) view.boundary.push_back(*most);
    }
  }
  return view;
}

namespace {

// Interpolation the pixels of a surface.
enum class Interpolation { kLinear, kCubicWhereItCan };

// A channel of the image at the way to a source from (x, y).
double Read(const model::LinearImage& image, const DisparityMap& map, int x, int y,
            const kernels::OccludedSample& from, Interpolation interpolation, int channel) {
  const int width = image.width_px;
  const int height = image.height_px;
  const double tolerance = 0.3 / map.step.cwiseAbs().maxCoeff();
  const double source_x = std::clamp(x + double{from.source_x}, 0.0, width - 1.0);
  const double source_y = std::clamp(y + double{from.source_y}, 0.0, height - 1.0);
  const int x0 = static_cast<int>(source_x);
  const int y0 = static_cast<int>(source_y);
  const auto at = [&](int n, int count) { return std::clamp(n, 0, count - 1); };
  const auto difference = [&](int xx, int yy) {
    return std::abs(double{map.disparity[At(at(xx, width), at(yy, height), width)]} -
                    from.disparity);
  };
  bool bicubic = interpolation == Interpolation::kCubicWhereItCan;
  for (int n = 0; n < 16; ++n) {
    bicubic = bicubic && difference(x0 - 1 + n % 4, y0 - 1 + n / 4) <= tolerance;
  }
  const std::array<double, 4> cubic_x = CatmullRom(source_x - x0);
  const std::array<double, 4> cubic_y = CatmullRom(source_y - y0);
  const std::array<double, 4> linear_x = {0, 1 - (source_x - x0), source_x - x0, 0};
  const std::array<double, 4> linear_y = {0, 1 - (source_y - y0), source_y - y0, 0};
  double sum = 0;
  double weights = 0;
  double closest = kInfinity;
  double value_of_closest = 0;
  for (int n = 0; n < 16; ++n) {
    const auto j = static_cast<std::size_t>(n / 4);
    const auto k = static_cast<std::size_t>(n % 4);
    const int xx = x0 - 1 + n % 4;
    const int yy = y0 - 1 + n / 4;
    const double value = image.at(at(xx, width), at(yy, height), channel);
    const double weight = bicubic ? cubic_x[k] * cubic_y[j] : linear_x[k] * linear_y[j];
    if (weight != 0 && difference(xx, yy) < closest) {
      closest = difference(xx, yy);
      value_of_closest = value;
    }
    if (difference(xx, yy) > tolerance) continue;
    sum += weight * value;
    weights += weight;
  }
  return weights > 0 ? sum / weights : value_of_closest;
}

}  // namespace

model::LinearImage PlainWarp(const model::LinearImage& image, const DisparityMap& map,
                             const ViewDisparity& view) {
  model::LinearImage warped = image;
  for (int y = 0; y < image.height_px; ++y) {
    for (int x = 0; x < image.width_px; ++x) {
      const std::size_t i = At(x, y, image.width_px);
      const auto boundary = std::find_if(view.boundary.begin(), view.boundary.end(),
                                         [&](const kernels::BoundarySample& one) {
                                           return static_cast<std::size_t>(one.index) == i;
                                         });
      for (int c = 0; c < image.channels; ++c) {
        double value =
            Read(image, map, x, y, {0, view.source_x[i], view.source_y[i], view.disparity[i]},
                 Interpolation::kCubicWhereItCan, c);
        if (boundary != view.boundary.end()) {
          value = (1 - double{boundary->share}) * value +
                  double{boundary->share} *
                      Read(image, map, x, y, boundary->other, Interpolation::kLinear, c);
        }
        warped.values[i * static_cast<std::size_t>(image.channels) + static_cast<std::size_t>(c)] =
            static_cast<float>(value);
      }
    }
  }
  return warped;
}

}  // namespace thicklens::estimator::testing

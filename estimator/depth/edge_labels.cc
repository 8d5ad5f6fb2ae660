#include "estimator/depth/edge_labels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/imgproc/detail/gcgraph.hpp>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"

namespace thicklens::estimator {
namespace {

// How many times the range of the flanks a ramp has.
constexpr float kRampOfFlank = 2.5F;

cv::Mat Range(const cv::Mat& map, int reach, cv::Mat* low, cv::Mat* high) {
  const cv::Mat window = cv::Mat::ones(2 * reach + 1, 2 * reach + 1, CV_8U);
  cv::dilate(map, *high, window);
  cv::erode(map, *low, window);
  return *high - *low;
}

// The edges of a map: for each edge pixel, one that has a neighbour of the other side, the
// disparities of both sides.
struct Edges {
  std::vector<float> near_px, far_px;
  cv::Mat distance_px;  // of each pixel to the closest edge pixel, CV_32F
  cv::Mat closest;      // its number, CV_32S, which counts from 1
};

Edges FindEdges(const cv::Mat& map, float jump) {
  cv::Mat is_off(map.size(), CV_8U, cv::Scalar(1));
  cv::Mat nearer = map.clone(), farther = map.clone();
  const auto join = [&](int ya, int xa, int yb, int xb) {
    const float a = map.at<float>(ya, xa), b = map.at<float>(yb, xb);
    if (std::abs(a - b) < jump) return;
    for (const auto& [y, x] : {std::pair{ya, xa}, std::pair{yb, xb}}) {
      is_off.at<uchar>(y, x) = 0;
      nearer.at<float>(y, x) = std::max({nearer.at<float>(y, x), a, b});
      farther.at<float>(y, x) = std::min({farther.at<float>(y, x), a, b});
    }
  };
  for (int y = 0; y < map.rows; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < map.cols; ++x) {
      if (x + 1 < map.cols) join(y, x, y, x + 1);
      if (y + 1 < map.rows) join(y, x, y + 1, x);
    }
  }
  Edges edges;
  if (cv::countNonZero(is_off) == static_cast<int>(is_off.total())) return edges;
  cv::distanceTransform(is_off, edges.distance_px, edges.closest, cv::DIST_L2, cv::DIST_MASK_5,
                        cv::DIST_LABEL_PIXEL);
  double labels = 0;
  cv::minMaxLoc(edges.closest, nullptr, &labels);
  edges.near_px.resize(static_cast<std::size_t>(labels) + 1);
  edges.far_px.resize(edges.near_px.size());
  for (int y = 0; y < map.rows; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < map.cols; ++x) {
      if (is_off.at<uchar>(y, x) != 0) continue;
      const auto label = Index(edges.closest.at<int>(y, x));
      edges.near_px[label] = nearer.at<float>(y, x);
      edges.far_px[label] = farther.at<float>(y, x);
    }
  }
  return edges;
}

float SquaredDifference(const cv::Mat& guide, int xa, int ya, int xb, int yb) {
  const int channels = guide.channels();
  const float* a = guide.ptr<float>(ya) + static_cast<std::ptrdiff_t>(xa) * channels;
  const float* b = guide.ptr<float>(yb) + static_cast<std::ptrdiff_t>(xb) * channels;
  float sum = 0;
  for (int c = 0; c < channels; ++c) sum += (a[c] - b[c]) * (a[c] - b[c]);
  return sum / static_cast<float>(channels);
}

// The two sides at a pixel near an edge, and by how much it prefers the near one.
struct Choice {
  float near_px = 0, far_px = 0, preference = 0;
  int node = -1;  // -1: the pixel is not near an edge
};

// Finds by how much the colours of both sides make the pixel one of the near side.
class ColourPreference {
 public:
  // Pixels of `unknown`, which may be empty, are no samples.
  ColourPreference(const cv::Mat& guide, const cv::Mat& map, const cv::Mat& unknown,
                   const Edges& edges, const EdgeLabelOptions& options)
      : guide_(guide),
        map_(map),
        unknown_(unknown),
        edges_(edges),
        reach_(static_cast<int>(options.reach_px) + (unknown.empty() ? 3 : 8)),
        stride_(unknown.empty() ? 1 : 2),
        unsure_(static_cast<float>(options.unsure_px)),
        inverse_(static_cast<float>(1 / (2 * options.colour_sigma * options.colour_sigma))) {}

  float At(int x, int y, float near_px, float far_px) const {
    const float middle = (near_px + far_px) / 2, tolerance = (near_px - far_px) / 2;
    double like[2] = {0, 0}, total[2] = {0, 0};
    const float spread = static_cast<float>(reach_) / 2;
    for (int v = -reach_; v <= reach_; v += stride_) {
      if (y + v < 0 || y + v >= map_.rows) continue;
      for (int u = -reach_; u <= reach_; u += stride_) {
        if (x + u < 0 || x + u >= map_.cols || (u == 0 && v == 0)) continue;
        if (!unknown_.empty() && unknown_.at<uchar>(y + v, x + u) != 0) continue;
        const float disparity = map_.at<float>(y + v, x + u);
        if (disparity > near_px + tolerance || disparity < far_px - tolerance) continue;
        // The closer to the edge, the less sure is the side of a sample.
        const float sure = std::clamp(
            (edges_.distance_px.at<float>(y + v, x + u) + 0.5F - unsure_) / 3, 0.0F, 1.0F);
        if (sure <= 0) continue;
        const float weight =
            sure * std::exp(-static_cast<float>(u * u + v * v) / (2 * spread * spread));
        const std::size_t side = disparity > middle ? 1 : 0;
        total[side] += static_cast<double>(weight);
        like[side] += static_cast<double>(
            weight * std::exp(-inverse_ * SquaredDifference(guide_, x, y, x + u, y + v)));
      }
    }
    if (total[0] <= 0 || total[1] <= 0) return 0;
    constexpr double kOutlier = 1e-2;
    return static_cast<float>(
        std::log((like[1] / total[1] + kOutlier) / (like[0] / total[0] + kOutlier)));
  }

 private:
  const cv::Mat& guide_;
  const cv::Mat& map_;
  const cv::Mat unknown_;
  const Edges& edges_;
  const int reach_, stride_;
  const float unsure_, inverse_;
};

}  // namespace

void SharpenEdges(double width_px, double jump, cv::Mat* map) {
  const int reach = std::max(1, static_cast<int>(std::lround(width_px / 2)));
  cv::Mat low, high, gradient_x, gradient_y, smooth;
  const cv::Mat range = Range(*map, reach, &low, &high);
  cv::GaussianBlur(*map, smooth, {}, width_px / 3 + 0.5);
  cv::Sobel(smooth, gradient_x, CV_32F, 1, 0);
  cv::Sobel(smooth, gradient_y, CV_32F, 0, 1);
  const cv::Mat before = map->clone();
  const auto flank = static_cast<float>(2 * reach + 1);
  const auto range_at = [&](float x, float y) {
    return range.at<float>(std::clamp(static_cast<int>(std::lround(y)), 0, map->rows - 1),
                           std::clamp(static_cast<int>(std::lround(x)), 0, map->cols - 1));
  };
  for (int y = 0; y < map->rows; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < map->cols; ++x) {
      const float own = range.at<float>(y, x);
      if (!(own > static_cast<float>(jump))) continue;
      const float gx = gradient_x.at<float>(y, x), gy = gradient_y.at<float>(y, x);
      const float length = std::hypot(gx, gy);
      if (!(length > 0)) continue;
      const float dx = flank * gx / length, dy = flank * gy / length;
      const auto fx = static_cast<float>(x), fy = static_cast<float>(y);
      const float flanks = (range_at(fx + dx, fy + dy) + range_at(fx - dx, fy - dy)) / 2;
      if (own < kRampOfFlank * flanks && own - flanks < static_cast<float>(4 * jump)) continue;
      const float value = before.at<float>(y, x);
      const float up = high.at<float>(y, x) - value, down = value - low.at<float>(y, x);
      map->at<float>(y, x) = up < down ? high.at<float>(y, x) : low.at<float>(y, x);
    }
  }
}

namespace {

// `unknown` may be empty: all pixels may change.
void Label(const cv::Mat& guide, const cv::Mat& unknown, const EdgeLabelOptions& options,
           cv::Mat* map) {
  const Edges edges = FindEdges(*map, static_cast<float>(options.jump));
  if (edges.near_px.empty()) return;
  const int width = map->cols, height = map->rows;
  std::vector<Choice> choices(map->total());
  const auto at = [&](int x, int y) -> Choice& {
    return choices[Index(y) * Index(width) + Index(x)];
  };
  const ColourPreference colours(guide, *map, unknown, edges, options);
  const auto reach = static_cast<float>(options.reach_px);
  ParallelFor(height, ResolveThreads(options.threads), [&](int y) {
    for (int x = 0; x < width; ++x) {
      const float away = edges.distance_px.at<float>(y, x);
      if (away >= reach) continue;
      if (!unknown.empty() && unknown.at<uchar>(y, x) == 0) continue;
      const auto edge = Index(edges.closest.at<int>(y, x));
      const float near_px = edges.near_px[edge], far_px = edges.far_px[edge];
      const float own = map->at<float>(y, x);
      const bool is_near = own > (near_px + far_px) / 2;
      Choice& choice = at(x, y);
      choice.node = 0;
      choice.near_px = is_near ? own : near_px;
      choice.far_px = is_near ? far_px : own;
      const float distance = (away + 0.5F) / static_cast<float>(options.edge_sigma_px);
      choice.preference =
          (is_near ? 1.0F : -1.0F) * distance * distance / 2 +
          static_cast<float>(options.colour_weight) * colours.At(x, y, near_px, far_px);
    }
  });
  int nodes = 0;
  double contrast = 0;
  for (int y = 0; y < height; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < width; ++x) {
      if (at(x, y).node < 0) continue;
      at(x, y).node = nodes++;
      if (x + 1 < width) contrast += static_cast<double>(SquaredDifference(guide, x, y, x + 1, y));
    }
  }
  if (nodes == 0) return;
  const auto inverse_contrast = static_cast<float>(1 / std::max(1e-6, 2 * contrast / nodes));
  cv::detail::GCGraph<float> graph(static_cast<unsigned>(nodes + 1),
                                   static_cast<unsigned>(4 * nodes + 4));
  ThrowIfCancelled();
  for (int n = 0; n < nodes; ++n) graph.addVtx();
  constexpr int kAround[8][2] = {{1, 0},  {0, 1},  {1, 1},   {-1, 1},
                                 {-1, 0}, {0, -1}, {-1, -1}, {1, -1}};
  for (int y = 0; y < height; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < width; ++x) {
      const Choice& own = at(x, y);
      if (own.node < 0) continue;
      float near_weight = std::max(0.0F, own.preference);
      float far_weight = std::max(0.0F, -own.preference);
      for (int n = 0; n < 8; ++n) {
        const int ox = x + kAround[n][0], oy = y + kAround[n][1];
        if (ox < 0 || oy < 0 || ox >= width || oy >= height) continue;
        const Choice& other = at(ox, oy);
        if (other.node >= 0 && n >= 4) continue;  // the other one adds this pair
        const float length = kAround[n][0] != 0 && kAround[n][1] != 0 ? 0.35F : 0.5F;
        const float weight = static_cast<float>(options.smoothness) * length *
                             std::exp(-inverse_contrast * SquaredDifference(guide, x, y, ox, oy));
        if (other.node >= 0) {
          graph.addEdges(own.node, other.node, weight, weight);
        } else {
          const float there = map->at<float>(oy, ox);
          (there > (own.near_px + own.far_px) / 2 ? near_weight : far_weight) += weight;
        }
      }
      graph.addTermWeights(own.node, near_weight, far_weight);
    }
  }
  graph.maxFlow();
  for (int y = 0; y < height; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < width; ++x) {
      const Choice& choice = at(x, y);
      if (choice.node < 0) continue;
      const float value = graph.inSourceSegment(choice.node) ? choice.near_px : choice.far_px;
      map->at<float>(y, x) = value;
    }
  }
}

}  // namespace

void LabelEdges(const cv::Mat& guide, const EdgeLabelOptions& options, cv::Mat* map) {
  Label(guide, {}, options, map);
}

void LabelUnknown(const cv::Mat& guide, const cv::Mat& unknown, const EdgeLabelOptions& options,
                  cv::Mat* map) {
  Label(guide, unknown, options, map);
}

namespace {

constexpr int kMaxShiftPx = 5, kMaxDilationPx = 4;
constexpr std::size_t kParts = 16;
constexpr double kTollOfAgreement = 1e-3;
// Share of the edges on one side of the near surfaces, relative to those on the other side.
constexpr double kMinSide = 0.2;

struct Voter {
  int x = 0, y = 0;
  float middle_px = 0, preference = 0;
  double near_x = 0, near_y = 0;  // direction of the near side
  std::size_t part = 0;
};

// The map with its near surfaces narrower by that many px on each side; wider if it is below 0.
cv::Mat Narrowed(const cv::Mat& map, int by_px) {
  if (by_px == 0) return map;
  const int size = 2 * std::abs(by_px) + 1;
  const cv::Mat window = cv::getStructuringElement(cv::MORPH_RECT, {size, size});
  cv::Mat narrowed;
  if (by_px > 0) {
    cv::erode(map, narrowed, window);
  } else {
    cv::dilate(map, narrowed, window);
  }
  return narrowed;
}

// The agreement of each part of the image, for edges whose near side is in the direction (x, y) and
// for those whose near side is in the opposite one.
using Agreement = std::array<std::array<double, 2>, kParts>;

Agreement AgreementOf(const std::vector<Voter>& voters, const cv::Mat& map, int right_px,
                      int down_px, double x_direction, double y_direction) {
  Agreement sums{};
  for (const Voter& voter : voters) {
    const int x = std::clamp(voter.x + right_px, 0, map.cols - 1);
    const int y = std::clamp(voter.y + down_px, 0, map.rows - 1);
    const float sign = map.at<float>(y, x) > voter.middle_px ? 1.0F : -1.0F;
    const bool is_along = voter.near_x * x_direction + voter.near_y * y_direction > 0;
    sums[voter.part][is_along ? 0 : 1] += static_cast<double>(sign * voter.preference);
  }
  return sums;
}

// The gain of one place of the map over another, and its standard error.
struct Gain {
  double gain = 0, sigma = 0;
};
Gain GainOf(const Agreement& after, const Agreement& before) {
  std::array<double, 2> sides{};
  for (std::size_t part = 0; part < kParts; ++part) {
    for (std::size_t side = 0; side < 2; ++side)
      sides[side] += after[part][side] - before[part][side];
  }
  Gain gain{sides[0] + sides[1], 0};
  const double mean = (sides[0] + sides[1]) / kParts;
  double squares = 0;
  for (std::size_t part = 0; part < kParts; ++part) {
    const double own = after[part][0] + after[part][1] - before[part][0] - before[part][1];
    squares += std::pow(own - mean, 2);
  }
  gain.sigma = std::sqrt(squares);
  return gain;
}

}  // namespace

EdgeAlignment AlignEdges(const cv::Mat& guide, const cv::Mat& map,
                         const EdgeLabelOptions& options) {
  EdgeAlignment alignment;
  const Edges edges = FindEdges(map, static_cast<float>(options.jump));
  if (edges.near_px.empty()) return alignment;
  const ColourPreference colours(guide, map, cv::Mat(), edges, options);
  const auto reach = static_cast<float>(options.reach_px);
  const int part_px = std::max(16, std::min(map.cols, map.rows) / 12);
  // A part of the pixels is sufficient.
  constexpr double kEnough = 16000;
  const cv::Mat in_reach = edges.distance_px < options.reach_px;
  const int stride = std::max(2, static_cast<int>(cv::countNonZero(in_reach) / kEnough));
  cv::Mat smooth, slope_x, slope_y;
  cv::GaussianBlur(map, smooth, {}, 2);
  cv::Sobel(smooth, slope_x, CV_32F, 1, 0);
  cv::Sobel(smooth, slope_y, CV_32F, 0, 1);
  std::vector<std::vector<Voter>> rows(Index(map.rows));
  ParallelFor(map.rows, ResolveThreads(options.threads), [&](int y) {
    for (int x = y % stride; x < map.cols; x += stride) {
      if (edges.distance_px.at<float>(y, x) >= reach) continue;
      const auto edge = Index(edges.closest.at<int>(y, x));
      Voter voter;
      voter.x = x;
      voter.y = y;
      voter.middle_px = (edges.near_px[edge] + edges.far_px[edge]) / 2;
      voter.preference = colours.At(x, y, edges.near_px[edge], edges.far_px[edge]);
      voter.near_x = static_cast<double>(slope_x.at<float>(y, x));
      voter.near_y = static_cast<double>(slope_y.at<float>(y, x));
      voter.part = (Index(x / part_px) * 5 + Index(y / part_px) * 3) % kParts;
      rows[Index(y)].push_back(voter);
    }
  });
  std::vector<Voter> voters;
  for (const auto& row : rows) voters.insert(voters.end(), row.begin(), row.end());
  if (voters.empty()) return alignment;
  const auto count = static_cast<double>(voters.size());
  double total = 0;
  for (const auto& part : AgreementOf(voters, map, 0, 0, 1, 0)) total += part[0] + part[1];
  alignment.agreement = total / count;
  // A longer way has to gain more: a map that can be moved along its edges stays.
  const double toll = kTollOfAgreement * std::abs(total);
  double best = 0;
  // Where only one side of the near surfaces is seen, a shadow beside them looks like a
  // displacement.
  const auto is_seen_from_both_sides = [&](double x_direction, double y_direction) {
    double along = 0, against = 0;
    for (const Voter& voter : voters) {
      const double part = voter.near_x * x_direction + voter.near_y * y_direction;
      const double share = part / std::max(1e-9, std::hypot(voter.near_x, voter.near_y) *
                                                     std::hypot(x_direction, y_direction));
      (share > 0 ? along : against) += std::abs(share);
    }
    return std::min(along, against) > kMinSide * std::max(along, against);
  };
  const bool is_seen_across = is_seen_from_both_sides(1, 0);
  const bool is_seen_along = is_seen_from_both_sides(0, 1);
  const auto try_out = [&](const cv::Mat& candidate, int right, int down, int dilation) {
    const bool is_shift = right != 0 || down != 0;
    const double x_direction = is_shift ? right : 1, y_direction = down;
    const Gain found = GainOf(AgreementOf(voters, candidate, right, down, x_direction, y_direction),
                              AgreementOf(voters, map, 0, 0, x_direction, y_direction));
    const double with_toll = found.gain - toll * (std::hypot(right, down) + std::abs(dilation));
    if (!(with_toll > best) || (right != 0 && !is_seen_across) || (down != 0 && !is_seen_along))
      return;
    best = with_toll;
    alignment.right_px = right;
    alignment.down_px = down;
    alignment.dilation_px = dilation;
    alignment.gain = found.gain / count;
    alignment.gain_sigma = found.sigma / count;
  };
  for (int down = -kMaxShiftPx; down <= kMaxShiftPx; ++down) {
    for (int right = -kMaxShiftPx; right <= kMaxShiftPx; ++right) try_out(map, right, down, 0);
  }
  for (int dilation = options.least_dilation_px; dilation <= kMaxDilationPx; ++dilation) {
    try_out(Narrowed(map, dilation), 0, 0, dilation);
    try_out(Narrowed(map, -dilation), 0, 0, -dilation);
  }
  return alignment;
}

cv::Mat Aligned(const cv::Mat& map, const EdgeAlignment& alignment) {
  const cv::Mat narrowed = Narrowed(map, static_cast<int>(alignment.dilation_px));
  const int right = static_cast<int>(alignment.right_px),
            down = static_cast<int>(alignment.down_px);
  cv::Mat aligned(map.size(), CV_32F);
  for (int y = 0; y < map.rows; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < map.cols; ++x) {
      aligned.at<float>(y, x) = narrowed.at<float>(std::clamp(y + down, 0, map.rows - 1),
                                                   std::clamp(x + right, 0, map.cols - 1));
    }
  }
  return aligned;
}

}  // namespace thicklens::estimator

#include "estimator/depth/map_faults.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "thicklens/base/cancel.h"
#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"

namespace thicklens::estimator {
namespace {

constexpr int kReachPx = 8;     // of a rise, to each side
constexpr int kFlankPx = 4;     // beyond it
constexpr float kFlat = 0.15F;  // of the flanks, relative to the rise
constexpr std::size_t kFewRises = 20;

void AddWidthsOfRow(const float* row, int width, float jump, std::vector<float>* widths) {
  for (int x = kReachPx + kFlankPx; x + kReachPx + kFlankPx + 1 < width; ++x) {
    const float before = row[x - kReachPx], after = row[x + kReachPx + 1];
    const float rise = after - before, height = std::abs(rise);
    if (!(height > jump)) continue;
    if (std::abs(row[x - kReachPx - kFlankPx] - before) +
            std::abs(row[x + kReachPx + kFlankPx + 1] - after) >
        kFlat * height) {
      continue;
    }
    float path = 0, steepest = 0, moment = 0;
    for (int n = -kReachPx; n <= kReachPx; ++n) {
      const float slope = std::abs(row[x + n + 1] - row[x + n]);
      path += slope;
      moment += slope * static_cast<float>(n);
      steepest = std::max(steepest, slope);
    }
    // Each rise counts once, where it is in the middle.
    if (path > (1 + kFlat) * height || std::abs(moment / path) > 0.5F) continue;
    widths->push_back(height / steepest);
  }
}

// Returns the places where neighbouring lines differ, if these are at equal distances of at least
// 2 px; otherwise nothing. `map`: the lines are its columns.
std::vector<int> RegularStarts(const cv::Mat& map) {
  std::vector<int> starts = {0};
  for (int x = 1; x < map.cols; ++x) {
    ThrowIfCancelled();
    if (cv::norm(map.col(x), map.col(x - 1), cv::NORM_INF) > 0) starts.push_back(x);
  }
  constexpr std::size_t kFewest = 8;
  if (starts.size() < kFewest) return {};
  std::vector<int> sizes;
  for (std::size_t i = 1; i < starts.size(); ++i) sizes.push_back(starts[i] - starts[i - 1]);
  std::nth_element(sizes.begin(), sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2),
                   sizes.end());
  const int usual = sizes[sizes.size() / 2];
  const auto regular = std::count_if(sizes.begin(), sizes.end(),
                                     [usual](int n) { return std::abs(n - usual) <= 1; });
  constexpr double kMost = 0.9;
  if (usual < 2 || static_cast<double>(regular) < kMost * static_cast<double>(sizes.size()))
    return {};
  return starts;
}

// Position among the middles of blocks of each pixel.
std::vector<float> PlacesOf(const std::vector<int>& starts, int size) {
  std::vector<float> middles;
  for (std::size_t i = 0; i < starts.size(); ++i) {
    const int end = i + 1 < starts.size() ? starts[i + 1] : size;
    middles.push_back(static_cast<float>(starts[i] + end - 1) / 2);
  }
  std::vector<float> places(Index(size));
  std::size_t cell = 0;
  for (int x = 0; x < size; ++x) {
    const auto at = static_cast<float>(x);
    while (cell + 2 < middles.size() && middles[cell + 1] <= at) ++cell;
    const float share = (at - middles[cell]) / (middles[cell + 1] - middles[cell]);
    places[Index(x)] = static_cast<float>(cell) + std::clamp(share, 0.0F, 1.0F);
  }
  return places;
}

// A pass of WithoutQuanta over the pixels from `begin` to before `end` of a row.
struct QuantaPass {
  const float* own;
  const float* now;
  const float* above;
  const float* below;
  float half, min_change;
  float* next;

  // Returns whether a value changed by more than `min_change`. `left` and `right`: distances of
  // these neighbours.
  bool Run(int begin, int end, int left, int right) const {
    const float most = 3 * half;
    int changes = 0;
    // Adds no neighbour by a branch, which a map would make unpredictable.
    for (int x = begin; x < end; ++x) {
      const float a = above[x], b = below[x], c = now[x - left], d = now[x + right];
      const float of_a = std::abs(a - own[x]) <= most ? 1.0F : 0.0F;
      const float of_b = std::abs(b - own[x]) <= most ? 1.0F : 0.0F;
      const float of_c = std::abs(c - own[x]) <= most ? 1.0F : 0.0F;
      const float of_d = std::abs(d - own[x]) <= most ? 1.0F : 0.0F;
      const float mean =
          (now[x] + of_a * a + of_b * b + of_c * c + of_d * d) / (1 + of_a + of_b + of_c + of_d);
      const float value = std::min(std::max(mean, own[x] - half), own[x] + half);
      changes |= std::abs(value - now[x]) > min_change ? 1 : 0;
      next[x] = value;
    }
    return changes != 0;
  }
};

bool SmoothRow(const cv::Mat& map, const cv::Mat& smooth, int y, float half, float min_change,
               cv::Mat* next) {
  const QuantaPass pass{map.ptr<float>(y),
                        smooth.ptr<float>(y),
                        smooth.ptr<float>(std::max(0, y - 1)),
                        smooth.ptr<float>(std::min(map.rows - 1, y + 1)),
                        half,
                        min_change,
                        next->ptr<float>(y)};
  const int last = map.cols - 1;
  // At the borders the pixel itself stands for its neighbour.
  bool has_changed = pass.Run(0, 1, 0, last > 0 ? 1 : 0);
  has_changed |= pass.Run(1, last, 1, 1);
  if (last > 0) has_changed |= pass.Run(last, last + 1, 1, 0);
  return has_changed;
}

}  // namespace

double EdgeWidthPx(const cv::Mat& map, double jump) {
  std::vector<float> widths;
  const cv::Mat turned = map.t();
  for (const cv::Mat& lines : {map, turned}) {
    for (int y = 0; y < lines.rows; ++y) {
      ThrowIfCancelled();
      AddWidthsOfRow(lines.ptr<float>(y), lines.cols, static_cast<float>(jump), &widths);
    }
  }
  if (widths.size() < kFewRises) return 0;
  const auto middle = widths.begin() + static_cast<std::ptrdiff_t>(widths.size() / 2);
  std::nth_element(widths.begin(), middle, widths.end());
  return static_cast<double>(*middle);
}

int BlockGrid::size_px() const {
  if (columns.size() < 2 || rows.size() < 2) return 1;
  const double across =
      static_cast<double>(columns.back()) / static_cast<double>(columns.size() - 1);
  return static_cast<int>(std::lround(across));
}

BlockGrid FindBlocks(const cv::Mat& map) {
  BlockGrid grid{RegularStarts(map), RegularStarts(map.t())};
  if (grid.columns.empty() || grid.rows.empty()) return {};
  return grid;
}

cv::Mat WithoutBlocks(const cv::Mat& map, const BlockGrid& grid) {
  cv::Mat small(static_cast<int>(grid.rows.size()), static_cast<int>(grid.columns.size()), CV_32F);
  for (int y = 0; y < small.rows; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < small.cols; ++x)
      small.at<float>(y, x) = map.at<float>(grid.rows[Index(y)], grid.columns[Index(x)]);
  }
  const std::vector<float> across = PlacesOf(grid.columns, map.cols);
  const std::vector<float> down = PlacesOf(grid.rows, map.rows);
  cv::Mat at_x(map.size(), CV_32F), at_y(map.size(), CV_32F), smooth;
  for (int y = 0; y < map.rows; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < map.cols; ++x) {
      at_x.at<float>(y, x) = across[Index(x)];
      at_y.at<float>(y, x) = down[Index(y)];
    }
  }
  cv::remap(small, smooth, at_x, at_y, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  return smooth;
}

double QuantumOf(const cv::Mat& map, double jump) {
  // A part of the rows is sufficient.
  constexpr int kEnough = 1 << 20;
  const int stride = std::max(1, static_cast<int>(map.total() / kEnough));
  std::vector<float> values;
  for (int y = 0; y < map.rows; y += stride)
    values.insert(values.end(), map.ptr<float>(y), map.ptr<float>(y) + map.cols);
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  constexpr std::size_t kMost = 1024, kFewest = 5;
  if (values.size() > kMost || values.size() < kFewest) return 0;
  std::vector<float> steps;
  for (std::size_t i = 1; i < values.size(); ++i) steps.push_back(values[i] - values[i - 1]);
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  const float quantum = *middle;
  if (!(static_cast<double>(quantum) < jump / 2)) return 0;
  // The layers of a scene are at any distances.
  constexpr float kTolerance = 0.1F;
  constexpr double kRegular = 0.8;
  const auto regular = std::count_if(steps.begin(), steps.end(), [quantum](float step) {
    const float multiple = step / quantum;
    return std::abs(multiple - std::max(1.0F, std::round(multiple))) <= kTolerance;
  });
  const bool is_regular =
      static_cast<double>(regular) >= kRegular * static_cast<double>(steps.size());
  return is_regular ? static_cast<double>(quantum) : 0;
}

cv::Mat WithoutQuanta(const cv::Mat& map, double quantum, int threads) {
  constexpr int kPasses = 80, kBandRows = 16;
  // A step spreads over n pixels by n^2 passes, and changes by less than 1 % of it in most of them.
  constexpr double kMinChange = 1e-3;
  const auto min_change = static_cast<float>(kMinChange * quantum);
  const auto half = static_cast<float>(quantum / 2);
  const int bands = (map.rows + kBandRows - 1) / kBandRows;
  cv::Mat smooth = map.clone(), next(map.size(), CV_32F);
  std::vector<char> has_changed(Index(bands), 1);
  for (int pass = 0; pass < kPasses; ++pass) {
    ParallelFor(bands, threads, [&](int band) {
      bool is_any = false;
      const int end = std::min(map.rows, (band + 1) * kBandRows);
      for (int y = band * kBandRows; y < end; ++y)
        is_any |= SmoothRow(map, smooth, y, half, min_change, &next);
      has_changed[Index(band)] = is_any ? 1 : 0;
    });
    std::swap(smooth, next);
    if (std::count(has_changed.begin(), has_changed.end(), 1) == 0) break;
  }
  return smooth;
}

double DropOutliers(double jump, cv::Mat* map) {
  const cv::Mat before = map->clone();
  const auto least_jump = static_cast<float>(jump);
  std::size_t count = 0;
  for (int y = 1; y + 1 < map->rows; ++y) {
    ThrowIfCancelled();
    for (int x = 1; x + 1 < map->cols; ++x) {
      std::array<float, 8> others{};
      std::size_t n = 0;
      int alike = 0;
      const float own = before.at<float>(y, x);
      for (int v = -1; v <= 1; ++v) {
        for (int u = -1; u <= 1; ++u) {
          if (u == 0 && v == 0) continue;
          others[n] = before.at<float>(y + v, x + u);
          if (std::abs(others[n++] - own) <= least_jump) ++alike;
        }
      }
      if (alike >= 2) continue;
      std::nth_element(others.begin(), others.begin() + 4, others.end());
      map->at<float>(y, x) = others[4];
      ++count;
    }
  }
  return static_cast<double>(count) / static_cast<double>(map->total());
}

}  // namespace thicklens::estimator

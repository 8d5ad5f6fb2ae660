#include "tools/io/lightfields/image_tiles.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"

namespace thicklens::io {
namespace {

constexpr int kMaxTiles = 40;
constexpr int kMinTilePx = 8;
// Views side by side differ by their parallax only. A photograph without repetitions has a ratio
// near 1.
constexpr double kRepeats = 0.5;
constexpr int kMaxPitchPx = 20;
// Differences across the edge of a lenslet, relative to those inside.
constexpr double kEdgeContrast = 1.3;
// Rows of an image that are compared.
constexpr int kRows = 400;

// Grey values of the image, or of its transpose, as floats.
cv::Mat GreyOf(const cv::Mat& pixels) {
  cv::Mat grey(pixels.rows, pixels.cols, CV_32F);
  cv::Mat floats;
  pixels.convertTo(floats, CV_32F);
  const int channels = floats.channels();
  const int kept = channels == 2 || channels == 4 ? channels - 1 : channels;
  for (int y = 0; y < floats.rows; ++y) {
    ThrowIfCancelled();
    const auto* row = floats.ptr<float>(y);
    auto* out = grey.ptr<float>(y);
    for (int x = 0; x < floats.cols; ++x) {
      float sum = 0;
      for (int c = 0; c < kept; ++c) {
        const float value = row[static_cast<std::ptrdiff_t>(x) * channels + c];
        sum += std::isfinite(value) ? value : 0.0F;
      }
      out[x] = sum;
    }
  }
  return grey;
}

// Mean absolute difference of pixels `lag` apart across.
double DifferenceAt(const cv::Mat& grey, int lag) {
  const int stride = std::max(1, grey.rows / kRows);
  double sum = 0, count = 0;
  for (int y = 0; y < grey.rows; y += stride) {
    const auto* row = grey.ptr<float>(y);
    for (int x = 0; x + lag < grey.cols; ++x) sum += std::abs(row[x + lag] - row[x]);
    count += std::max(0, grey.cols - lag);
  }
  return count > 0 ? sum / count : 0;
}

bool RepeatsAcross(const cv::Mat& grey, int count) {
  if (count < 2 || grey.cols % count != 0) return count == 1;
  ThrowIfCancelled();
  const int lag = grey.cols / count;
  return DifferenceAt(grey, lag) < kRepeats * DifferenceAt(grey, lag / 2);
}

int RepetitionsAcross(const cv::Mat& grey) {
  for (int count = std::min(kMaxTiles, grey.cols / kMinTilePx); count >= 2; --count) {
    if (RepeatsAcross(grey, count)) return count;
  }
  return 1;
}

// Tiles along one axis and the columns of one colour between them.
struct AxisBorders {
  int count = 1, gap_px = 0, tile_px = 0;
};
std::optional<AxisBorders> BordersAcross(const cv::Mat& grey) {
  std::vector<std::pair<int, int>> gaps;  // first column and number of columns
  for (int x = 0; x < grey.cols; ++x) {
    const float first = grey.at<float>(0, x);
    bool is_flat = true;
    for (int y = 1; y < grey.rows && is_flat; ++y) is_flat = grey.at<float>(y, x) == first;
    if (!is_flat) continue;
    if (!gaps.empty() && gaps.back().first + gaps.back().second == x) {
      ++gaps.back().second;
    } else {
      gaps.emplace_back(x, 1);
    }
  }
  if (gaps.empty() || gaps.size() >= static_cast<std::size_t>(kMaxTiles)) return std::nullopt;
  const int count = static_cast<int>(gaps.size()) + 1;
  const AxisBorders borders{count, gaps.front().second, gaps.front().first};
  const int step = borders.tile_px + borders.gap_px;
  if (borders.tile_px < kMinTilePx || borders.gap_px >= borders.tile_px) return std::nullopt;
  for (int i = 1; i < count; ++i) {
    const auto& [at, width] = gaps[static_cast<std::size_t>(i - 1)];
    if (width != borders.gap_px || at != i * step - borders.gap_px) return std::nullopt;
  }
  return count * step - borders.gap_px == grey.cols ? std::optional(borders) : std::nullopt;
}

int PitchAcross(const cv::Mat& grey) {
  // Mean difference between the columns x and x + 1.
  std::vector<double> step(static_cast<std::size_t>(std::max(0, grey.cols - 1)), 0.0);
  const int stride = std::max(1, grey.rows / kRows);
  for (int y = 0; y < grey.rows; y += stride) {
    const auto* row = grey.ptr<float>(y);
    for (std::size_t x = 0; x < step.size(); ++x) step[x] += std::abs(row[x + 1] - row[x]);
  }
  int best = 0;
  double best_contrast = kEdgeContrast;
  for (int pitch = 2; pitch <= kMaxPitchPx; ++pitch) {
    if (grey.cols < 4 * pitch) break;
    double edge = 0, inside = 0, edges = 0, insides = 0;
    for (std::size_t x = 0; x < step.size(); ++x) {
      const bool is_edge = static_cast<int>(x) % pitch == pitch - 1;
      (is_edge ? edge : inside) += step[x];
      (is_edge ? edges : insides) += 1;
    }
    const double contrast = inside > 0 ? (edge / edges) / (inside / insides) : 0;
    if (contrast > best_contrast) {
      best_contrast = contrast;
      best = pitch;
    }
  }
  return best;
}

}  // namespace

AxisCounts RepetitionsOf(const cv::Mat& pixels) {
  const cv::Mat grey = GreyOf(pixels);
  return {RepetitionsAcross(grey), RepetitionsAcross(grey.t())};
}

bool Repeats(const cv::Mat& pixels, AxisCounts counts) {
  const cv::Mat grey = GreyOf(pixels);
  return RepeatsAcross(grey, counts.across) && RepeatsAcross(grey.t(), counts.down);
}

std::optional<BorderedTiles> BorderedTilesOf(const cv::Mat& pixels) {
  const cv::Mat grey = GreyOf(pixels);
  const std::optional<AxisBorders> across = BordersAcross(grey);
  if (!across) return std::nullopt;
  const std::optional<AxisBorders> down = BordersAcross(grey.t());
  if (!down) return std::nullopt;
  return BorderedTiles{{across->count, down->count},
                       {across->gap_px, down->gap_px},
                       {across->tile_px, down->tile_px}};
}

int LensletPitchOf(const cv::Mat& pixels) {
  const cv::Mat grey = GreyOf(pixels);
  const int across = PitchAcross(grey);
  return across == PitchAcross(grey.t()) ? across : 0;
}

std::string CommonDivisors(int width_px, int height_px) {
  std::vector<int> divisors;
  for (int n = 2; n <= kMaxTiles; ++n) {
    if (width_px % n == 0 && height_px % n == 0) divisors.push_back(n);
  }
  return divisors.empty() ? "none" : fmt::format("{}", fmt::join(divisors, ", "));
}

}  // namespace thicklens::io

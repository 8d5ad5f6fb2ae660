#include "tools/io/lightfields/image_tiles.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"

namespace thicklens::io {
namespace {

// Ratios that differ by less are alike.
constexpr double kAlike = 1.2, kAlikeFloor = 0.02;
constexpr int kMaxPitchPx = 100;
// Fewer edges may stand at regular distances by chance.
constexpr int kMinEdges = 8;  // half of it up to kSmallPitchPx
constexpr int kSmallPitchPx = 20;
// Differences across the edge of a lenslet, relative to those inside.
constexpr double kEdgeContrast = 1.3;
// Rows of an image that are compared.
constexpr int kRows = 400;

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
  return RatioAt(grey, grey.cols / count) < kRepeats;
}

int RepetitionsAcross(const cv::Mat& grey) {
  std::vector<RatioOfCount> ratios;
  for (int count = std::min(kMaxTiles, grey.cols / kMinTilePx); count >= 2; --count) {
    if (grey.cols % count == 0) ratios.emplace_back(count, RatioAt(grey, grey.cols / count));
  }
  return CountOf(ratios);
}

int PitchAcross(const cv::Mat& grey) {
  // Mean difference between the columns x and x + 1.
  std::vector<double> step(static_cast<std::size_t>(std::max(0, grey.cols - 1)), 0.0);
  const int stride = std::max(1, grey.rows / kRows);
  for (int y = 0; y < grey.rows; y += stride) {
    const auto* row = grey.ptr<float>(y);
    for (std::size_t x = 0; x < step.size(); ++x) step[x] += std::abs(row[x + 1] - row[x]);
  }
  // The contrast of the edges at every `pitch` columns, without those at every `left_out` columns.
  const auto contrast_of = [&step](int pitch, int left_out) {
    double edge = 0, inside = 0, edges = 0, insides = 0;
    for (std::size_t i = 0; i < step.size(); ++i) {
      const int x = static_cast<int>(i);
      const bool is_edge = x % pitch == pitch - 1;
      if (is_edge && left_out > 0 && x % left_out == left_out - 1) continue;
      (is_edge ? edge : inside) += step[i];
      (is_edge ? edges : insides) += 1;
    }
    return edges > 0 && inside > 0 ? (edge / edges) / (inside / insides) : 0.0;
  };
  int best = 0;
  double best_contrast = kEdgeContrast;
  for (int pitch = 2; pitch <= kMaxPitchPx; ++pitch) {
    if (grey.cols < (pitch > kSmallPitchPx ? kMinEdges : kMinEdges / 2) * pitch) break;
    ThrowIfCancelled();
    const double contrast = contrast_of(pitch, 0);
    if (contrast > best_contrast) {
      best_contrast = contrast;
      best = pitch;
    }
  }
  // Multiples of a pitch have its edges too.
  for (int pitch = 2; pitch < best; ++pitch) {
    if (best % pitch == 0 && contrast_of(pitch, best) > kEdgeContrast) return pitch;
  }
  return best;
}

}  // namespace

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

double RatioAt(const cv::Mat& grey, int lag_px) {
  ThrowIfCancelled();
  const double at_half = DifferenceAt(grey, lag_px / 2);
  return at_half > 0 ? DifferenceAt(grey, lag_px) / at_half : 1.0;
}

int CountOf(const std::vector<RatioOfCount>& ratios) {
  double least = kRepeats;
  for (const auto& [count, ratio] : ratios) least = std::min(least, ratio);
  int best = 1;
  for (const auto& [count, ratio] : ratios) {
    if (ratio < kRepeats && ratio <= kAlike * least + kAlikeFloor) best = std::max(best, count);
  }
  return best;
}

AxisCounts RepetitionsOf(const cv::Mat& pixels) {
  const cv::Mat grey = GreyOf(pixels);
  return {RepetitionsAcross(grey), RepetitionsAcross(grey.t())};
}

bool Repeats(const cv::Mat& pixels, AxisCounts counts) {
  const cv::Mat grey = GreyOf(pixels);
  return RepeatsAcross(grey, counts.across) && RepeatsAcross(grey.t(), counts.down);
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

#include "calib/sweep/clipping.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

#include "thicklens/base/cancel.h"

namespace thicklens::calib {
namespace {

using Histogram = std::vector<double>;

int ColourChannels(const cv::Mat& stored) { return stored.channels() == 4 ? 3 : stored.channels(); }

// Counts into several tables in turn, so that the count of a repeated value does not wait for the
// previous one.
template <typename Value>
Histogram CountValues(const cv::Mat& stored, int channel, std::size_t levels) {
  constexpr int kTurns = 4;
  std::vector<std::uint32_t> counts(kTurns * levels, 0);
  const int step = stored.channels();
  for (int y = 0; y < stored.rows; ++y) {
    ThrowIfCancelled();
    const auto* value = stored.ptr<Value>(y) + channel;
    for (int x = 0; x < stored.cols; ++x, value += step)
      ++counts[static_cast<std::size_t>(x % kTurns) * levels + *value];
  }
  Histogram histogram(levels, 0);
  for (std::size_t i = 0; i < counts.size(); ++i) histogram[i % levels] += counts[i];
  return histogram;
}

Histogram HistogramOf(const cv::Mat& stored, int channel) {
  return stored.depth() == CV_8U ? CountValues<std::uint8_t>(stored, channel, 256)
                                 : CountValues<std::uint16_t>(stored, channel, 65536);
}

// [D87] The share of a plateau's pixels that have its most frequent value, where the noise is at
// least what ClearOfNoise() requires: erf(0.5/(sqrt(2) 0.41)) = 0.78 for a standard deviation of
// 0.41, which rounding raises to 0.5.
constexpr double kMaxOfAPlateau = 0.85;

// Finds clipping at any level: the brightest value that the channel uses has many pixels, and the
// values just below it have few. A camera may clip below full scale (one at 240 to 248 of 255).
Clipping BrightClipping(const Histogram& histogram, double total) {
  const std::size_t top = histogram.size() - 1;
  if (histogram[top] > 0.001 * total) return {histogram[top] / total, 1};
  // JPEG and a colour matrix smear the clipped value over some neighbours. Therefore the brightest
  // 1/64 of the range in use is compared with the three stretches of that width below it.
  const std::size_t width = std::max<std::size_t>(1, histogram.size() / 64);
  double above = 0;
  std::size_t end = histogram.size();
  while (end > width && above + histogram[end - 1] < 0.0005 * total) above += histogram[--end];
  if (end < 4 * width) return {};
  const auto sum = [&](std::size_t from, std::size_t to) {
    return std::accumulate(histogram.begin() + static_cast<std::ptrdiff_t>(from),
                           histogram.begin() + static_cast<std::ptrdiff_t>(to), 0.0);
  };
  const double bright = sum(end - width, end);
  const double below = sum(end - 4 * width, end - width) / 3;
  if (!(bright > 4 * below)) return {};
  // Noise spreads a plateau of the target to both sides of its middle, over more than one value.
  // Clipping cuts the upper side off.
  const auto value_at = [&](double fraction) {  // as if a value were spread evenly
    double count = 0;
    std::size_t value = end - width;
    while (value + 1 < end && count + histogram[value] < fraction * bright)
      count += histogram[value++];
    return static_cast<double>(value) + (fraction * bright - count) / histogram[value];
  };
  const double most =
      *std::max_element(histogram.begin() + static_cast<std::ptrdiff_t>(end - width),
                        histogram.begin() + static_cast<std::ptrdiff_t>(end));
  const double upper = value_at(0.95) - value_at(0.5);
  const double lower = value_at(0.5) - value_at(0.05);
  if (most < kMaxOfAPlateau * bright && upper > 0.5 * lower) return {};
  return {bright / total, static_cast<double>(end - 1) / static_cast<double>(top)};
}

// Where the noise is below the steps of the file, every plateau piles up on one value: only a
// clipping at the end of the scale counts there.
Clipping ClearOfNoise(Clipping found, double noise_levels) {
  return found.level < 1 && !(noise_levels > 0.5) ? Clipping() : found;
}

template <typename Value>
bool IsDark(const Value* pixel, int channels, double limit) {
  for (int c = 0; c < channels; ++c) {
    if (pixel[c] <= limit) return true;
  }
  return false;
}

// Marks the dark pixels, CV_8U, of every second row and column, which suffices for areas.
template <typename Value>
cv::Mat DarkMask(const cv::Mat& stored, double limit) {
  cv::Mat mask = cv::Mat::zeros((stored.rows + 1) / 2, (stored.cols + 1) / 2, CV_8U);
  const int channels = ColourChannels(stored);
  for (int y = 0; y < mask.rows; ++y) {
    ThrowIfCancelled();
    const auto* pixel = stored.ptr<Value>(2 * y);
    auto* out = mask.ptr<std::uint8_t>(y);
    for (int x = 0; x < mask.cols; ++x, pixel += 2 * stored.channels())
      out[x] = IsDark(pixel, channels, limit);
  }
  return mask;
}

struct Centroid {
  double x = 0, y = 0, count = 0;
};

}  // namespace

ClippingAtEnds DetectClipping(const cv::Mat& stored, double noise_sigma) {
  const double full_scale = stored.depth() == CV_8U ? 255 : 65535;
  const auto total = static_cast<double>(stored.total());
  ClippingAtEnds worst;
  for (int c = 0; c < ColourChannels(stored); ++c) {
    Histogram histogram = HistogramOf(stored, c);
    const Clipping bright =
        ClearOfNoise(BrightClipping(histogram, total), noise_sigma * full_scale);
    if (bright.fraction > worst.bright.fraction) worst.bright = bright;
    // The dark end is the bright end of the negative.
    std::reverse(histogram.begin(), histogram.end());
    const Clipping dark = ClearOfNoise(BrightClipping(histogram, total), noise_sigma * full_scale);
    if (dark.fraction > worst.dark.fraction) worst.dark = {dark.fraction, 1 - dark.level};
  }
  return worst;
}

bool IsBacklitEdge(const cv::Mat& stored, double level) {
  const bool bytes = stored.depth() == CV_8U;
  // The limit includes the values just above the level, over which noise or a smeared clipping
  // spreads.
  const double limit = (level + 1.0 / 64) * (bytes ? 255 : 65535);
  const cv::Mat mask =
      bytes ? DarkMask<std::uint8_t>(stored, limit) : DarkMask<std::uint16_t>(stored, limit);
  std::array<Centroid, 2> centroids;
  for (int y = 0; y < mask.rows; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < mask.cols; ++x) {
      Centroid& c = centroids[mask.at<std::uint8_t>(y, x)];
      c.x += x;
      c.y += y;
      c.count += 1;
    }
  }
  const auto& [light, dark] = centroids;
  if (!(light.count > 0 && dark.count > 0)) return false;
  const double dx = light.x / light.count - dark.x / dark.count;
  const double dy = light.y / light.count - dark.y / dark.count;
  const double length = std::hypot(dx, dy);
  if (!(length > 1)) return false;

  // Areas against the distance along the line between the centroids, in px of the mask.
  const int reach = mask.rows + mask.cols;
  std::vector<double> all(static_cast<std::size_t>(2 * reach), 0), black = all;
  for (int y = 0; y < mask.rows; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < mask.cols; ++x) {
      const auto bin = static_cast<std::size_t>((x * dx + y * dy) / length + reach);
      all[bin] += 1;
      black[bin] += mask.at<std::uint8_t>(y, x);
    }
  }
  // Find the side that holds 98 % of the dark pixels. An edge leaves the other side free of them,
  // and fills its own side except for the noise above black.
  double area = 0, found = 0;
  for (std::size_t i = 0; i < all.size() && found < 0.98 * dark.count; ++i) {
    area += all[i];
    found += black[i];
  }
  return area < 0.75 * static_cast<double>(mask.total()) && found > 0.4 * area;
}

}  // namespace thicklens::calib

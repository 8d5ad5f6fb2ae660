#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

#include "estimator/scene/encoding_slope.h"
#include "thicklens/base/index.h"
#include "thicklens/estimator/scene_solver.h"

namespace thicklens::estimator {
namespace {

constexpr int kBlockPx = 16;
constexpr double kDarkestMean = 12.0 / 255;
constexpr double kBrightestMean = 243.0 / 255;
constexpr double kPercentile = 0.25;

struct BlockNoise {
  double mean = 0;
  double rms = 0;  // rms of (p00 - p10 - p01 + p11)/2: the standard deviation of white noise
};

// Returns the noise of one channel of a block.
BlockNoise NoiseOf(const model::LinearImage& image, const EncodedValueTable& table, int x0, int y0,
                   int channel) {
  float stored[kBlockPx][kBlockPx];
  BlockNoise noise;
  for (int y = 0; y < kBlockPx; ++y) {
    for (int x = 0; x < kBlockPx; ++x) {
      stored[y][x] = table.Encode(image.at(x0 + x, y0 + y, channel));
      noise.mean += static_cast<double>(stored[y][x]) / (kBlockPx * kBlockPx);
    }
  }
  double sum = 0;
  for (int y = 0; y + 1 < kBlockPx; ++y) {
    for (int x = 0; x + 1 < kBlockPx; ++x) {
      const double difference = 0.5 * static_cast<double>(stored[y][x] - stored[y][x + 1] -
                                                          stored[y + 1][x] + stored[y + 1][x + 1]);
      sum += difference * difference;
    }
  }
  noise.rms = std::sqrt(sum / ((kBlockPx - 1) * (kBlockPx - 1)));
  return noise;
}

// Returns whether a channel of a block has a value that is only a lower bound.
bool IsClipped(const std::vector<std::uint8_t>& clipped, const model::LinearImage& image, int x0,
               int y0, int channel) {
  if (clipped.empty()) return false;
  for (int y = y0; y < y0 + kBlockPx; ++y) {
    for (int x = x0; x < x0 + kBlockPx; ++x) {
      const std::size_t pixel = Index(y) * Index(image.width_px) + Index(x);
      if (clipped[pixel * Index(image.channels) + Index(channel)] != 0) return true;
    }
  }
  return false;
}

}  // namespace

std::optional<double> EncodedNoiseSigma(const model::LinearImage& image,
                                        const model::TransferCurve& transfer,
                                        const std::vector<std::uint8_t>& clipped) {
  const EncodedValueTable table(transfer);
  std::vector<double> rms;
  for (int y = 0; y + kBlockPx <= image.height_px; y += kBlockPx) {
    for (int x = 0; x + kBlockPx <= image.width_px; x += kBlockPx) {
      for (int channel = 0; channel < image.channels; ++channel) {
        if (IsClipped(clipped, image, x, y, channel)) continue;
        const BlockNoise noise = NoiseOf(image, table, x, y, channel);
        if (noise.mean >= kDarkestMean && noise.mean <= kBrightestMean) rms.push_back(noise.rms);
      }
    }
  }
  if (rms.empty()) return std::nullopt;
  const auto at = rms.begin() + static_cast<std::ptrdiff_t>(
                                    kPercentile * static_cast<double>(rms.size() - 1) + 0.5);
  std::nth_element(rms.begin(), at, rms.end());
  return *at;
}

}  // namespace thicklens::estimator

#include "thicklens/calib/frame_checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "calib/sharpness/edge_pixels.h"
#include "calib/sweep/clipping.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/statistics.h"
#include "thicklens/base/validity.h"

namespace thicklens::calib {
namespace {

constexpr int kBlock = 16;  // px, side of the blocks for noise and mosaic

// Standard deviation of a pixel: the rms of (p00 - p10 - p01 + p11)/2, which cancels any slope, in
// 16 x 16 blocks. The 25th percentile of the blocks is taken, where the target is flat.
double NoiseSigma(const cv::Mat& grey) {
  std::vector<double> blocks;
  for (int y0 = 0; y0 + kBlock < grey.rows; y0 += kBlock) {
    for (int x0 = 0; x0 + kBlock < grey.cols; x0 += kBlock) {
      std::array<float, kBlock> sums{};  // per column, so that a row is one vector operation
      for (int y = y0; y < y0 + kBlock; ++y) {
        const auto* a = grey.ptr<float>(y) + x0;
        const auto* b = grey.ptr<float>(y + 1) + x0;
        for (std::size_t x = 0; x < kBlock; ++x) {
          const float d = 0.5F * (a[x] - a[x + 1] - b[x] + b[x + 1]);
          sums[x] += d * d;
        }
      }
      const double sum = std::accumulate(sums.begin(), sums.end(), 0.0);
      blocks.push_back(std::sqrt(sum / (kBlock * kBlock)));
    }
  }
  if (blocks.empty()) return 0;
  const auto quarter = blocks.begin() + static_cast<std::ptrdiff_t>(blocks.size() / 4);
  std::nth_element(blocks.begin(), quarter, blocks.end());
  return *quarter;
}

// Relative deviation of the mean of each of the four sub-lattices of 2 x 2 px from the block's.
template <typename Value>
std::array<double, 4> LatticeDeviations(const cv::Mat& stored, int y0, int x0, double* mean) {
  std::array<std::array<std::uint32_t, kBlock>, 2> columns{};  // sums of the even and the odd rows
  for (int y = 0; y < kBlock; ++y) {
    const auto* row = stored.ptr<Value>(y0 + y) + x0;
    auto& sums = columns[static_cast<std::size_t>(y % 2)];
    for (std::size_t x = 0; x < kBlock; ++x) sums[x] += row[x];
  }
  std::array<double, 4> lattices{};
  for (std::size_t x = 0; x < kBlock; ++x) {
    lattices[x % 2] += columns[0][x];
    lattices[2 + x % 2] += columns[1][x];
  }
  const double sum = std::accumulate(lattices.begin(), lattices.end(), 0.0);
  *mean = sum / (kBlock * kBlock);
  for (double& lattice : lattices) lattice = sum > 0 ? 4 * lattice / sum - 1 : 0;
  return lattices;
}

// A colour filter over the pixels makes one of the four sub-lattices of 2 x 2 px brighter or darker
// over the whole frame. A texture does that only in single blocks, and in both directions: a lens
// does not resolve a period of exactly 2 px over the whole frame.
template <typename Value>
bool HasColourFilter(const cv::Mat& stored) {
  constexpr double kMinDeviation = 0.04;  // gains of a sensor's own columns differ by 0.01
  constexpr double kPersistent = 0.9;     // share of the blocks
  const double full_scale = std::numeric_limits<Value>::max();
  std::array<std::vector<double>, 4> deviations;
  for (int y0 = 0; y0 + kBlock <= stored.rows; y0 += kBlock) {
    for (int x0 = 0; x0 + kBlock <= stored.cols; x0 += kBlock) {
      double mean = 0;
      const auto block = LatticeDeviations<Value>(stored, y0, x0, &mean);
      if (!(mean > 0.02 * full_scale && mean < 0.98 * full_scale)) continue;
      for (std::size_t k = 0; k < block.size(); ++k) deviations[k].push_back(block[k]);
    }
  }
  if (deviations[0].size() < 16) return false;
  for (std::vector<double>& of_lattice : deviations) {
    const double typical = Median(of_lattice);
    if (!(std::abs(typical) > kMinDeviation)) continue;
    const auto same = std::count_if(of_lattice.begin(), of_lattice.end(), [&](double d) {
      return d * typical > 0 && std::abs(d) > 0.5 * kMinDeviation;
    });
    if (static_cast<double>(same) > kPersistent * static_cast<double>(of_lattice.size()))
      return true;
  }
  return false;
}

bool IsMosaic(const cv::Mat& stored) {
  if (stored.channels() != 1) return false;
  return stored.depth() == CV_8U ? HasColourFilter<std::uint8_t>(stored)
                                 : HasColourFilter<std::uint16_t>(stored);
}

// Mixes eight bytes at a time by the multiply and shift of splitmix64. The last bytes of a row are
// padded with zeros.
std::uint64_t ContentHash(const cv::Mat& stored) {
  std::uint64_t hash = 0;
  const auto mix = [&hash](std::uint64_t word) {
    hash = (hash ^ word) * 0x9E3779B97F4A7C15U;
    hash ^= hash >> 32;
  };
  mix(static_cast<std::uint64_t>(stored.rows));
  mix(static_cast<std::uint64_t>(stored.cols));
  mix(static_cast<std::uint64_t>(stored.type()));
  const std::size_t row_bytes = static_cast<std::size_t>(stored.cols) * stored.elemSize();
  for (int y = 0; y < stored.rows; ++y) {
    ThrowIfCancelled();
    const auto* row = stored.ptr<std::uint8_t>(y);
    for (std::size_t i = 0; i < row_bytes; i += sizeof(std::uint64_t)) {
      std::uint64_t word = 0;
      std::memcpy(&word, row + i, std::min(sizeof word, row_bytes - i));
      mix(word);
    }
  }
  return hash;
}

// Gaussian smoothing by a sigma of many pixels: the image is shrunk by whole blocks, smoothed by a
// sigma of 5 to 10 blocks, and enlarged again by linear interpolation.
cv::Mat WidelySmoothed(const cv::Mat& grey, double sigma_px) {
  int shrink = 1;
  while (sigma_px / (2 * shrink) >= 5) shrink *= 2;
  if (shrink == 1) return Smoothed(grey, sigma_px);
  // The frame is mirrored as far as the kernel reaches, so that the borders are those of the whole
  // frame.
  const auto margin = [&](int length_px) {
    const int reach_px = std::min(static_cast<int>(std::ceil(5 * sigma_px)), length_px - 1);
    return (reach_px + shrink - 1) / shrink * shrink;
  };
  const int left = margin(grey.cols), top = margin(grey.rows);
  const auto rest = [&](int length_px) { return (shrink - length_px % shrink) % shrink; };
  cv::Mat padded, small, wide;
  cv::copyMakeBorder(grey, padded, top, top + rest(grey.rows), left, left + rest(grey.cols),
                     cv::BORDER_REFLECT_101);
  const cv::Size size = padded.size();
  cv::resize(padded, small, size / shrink, 0, 0, cv::INTER_AREA);
  padded.release();
  // [D86] The mean over a block of n px is a blur of variance (n^2 - 1)/12. Linear interpolation
  // between points n px apart, at n places between them, is on average a blur of variance n^2/6 +
  // 1/12.
  const double variance_px2 = sigma_px * sigma_px - 0.25 * shrink * shrink;
  cv::resize(Smoothed(small, std::sqrt(variance_px2) / shrink), wide, size, 0, 0, cv::INTER_LINEAR);
  return wide(cv::Rect(left, top, grey.cols, grey.rows));
}

// White noise of standard deviation n, averaged over 4 x 4 px and smoothed by a Gaussian with sigma
// of one such block, has n/4/(2 sqrt(pi)).
double CoarseTexture(const cv::Mat& grey, const cv::Mat& slow, double noise_sigma) {
  constexpr int kShrink = 4;
  if (grey.cols < 8 * kShrink || grey.rows < 8 * kShrink) return 0;
  cv::Mat coarse, coarse_slow;
  const cv::Size size(grey.cols / kShrink, grey.rows / kShrink);
  cv::resize(grey, coarse, size, 0, 0, cv::INTER_AREA);
  cv::resize(slow, coarse_slow, size, 0, 0, cv::INTER_AREA);
  coarse -= coarse_slow;
  cv::Scalar mean, deviation;
  cv::meanStdDev(Smoothed(coarse, 1), mean, deviation);
  const double noise = std::max(noise_sigma, 1e-6) / kShrink / (2 * std::sqrt(CV_PI));
  return deviation[0] / noise;
}

}  // namespace

bool QualityCheckOptions::IsValid(std::string* why) const {
  const std::pair<const char*, double> shares[] = {
      {"min_mean_encoded", min_mean_encoded},
      {"max_saturated_fraction", max_saturated_fraction},
      {"max_black_fraction", max_black_fraction}};
  for (const auto& [field, value] : shares) {
    if (value >= 0 && value <= 1) continue;
    return Fail(why, fmt::format("{} is {}: it must be from 0 to 1", field, value));
  }
  const std::pair<const char*, double> ratios[] = {{"min_relative_contrast", min_relative_contrast},
                                                   {"min_gradient_to_noise", min_gradient_to_noise},
                                                   {"min_coarse_texture", min_coarse_texture}};
  for (const auto& [field, value] : ratios) {
    if (value >= 0 && std::isfinite(value)) continue;
    return Fail(why, fmt::format("{} is {}: it must be finite and >= 0", field, value));
  }
  return true;
}

std::string FailedCheck(const std::string& rejection) {
  std::string kind = rejection.substr(0, rejection.find_first_of(":,0123456789"));
  const auto trim = [&kind] { kind.erase(kind.find_last_not_of(" -+.") + 1); };
  trim();
  // The preposition is left where the amount is in the middle: "reading off by 15.1 mm".
  const std::string preposition = " by";
  if (kind.size() > preposition.size() &&
      kind.compare(kind.size() - preposition.size(), preposition.size(), preposition) == 0)
    kind.resize(kind.size() - preposition.size());
  trim();
  return kind;
}

FrameStatistics MeasureFrame(const cv::Mat& stored, const cv::Mat& linear_grey) {
  FrameStatistics result;
  const double full_scale = stored.depth() == CV_8U ? 255 : 65535;
  const cv::Scalar means = cv::mean(stored);
  const int channels = stored.channels() == 4 ? 3 : stored.channels();
  for (int c = 0; c < channels; ++c) result.mean_encoded += means[c] / (channels * full_scale);
  result.mean_linear = cv::mean(linear_grey)[0];
  result.noise_sigma = NoiseSigma(linear_grey);

  const ClippingAtEnds clipping = DetectClipping(stored, result.noise_sigma);
  result.saturated_fraction = clipping.bright.fraction;
  result.saturation_level = clipping.bright.level * full_scale;
  result.black_fraction = clipping.dark.fraction;
  result.black_level = std::round(clipping.dark.level * full_scale);
  result.black_is_one_side =
      result.black_fraction > 0 && IsBacklitEdge(stored, clipping.dark.level);
  result.is_mosaic = IsMosaic(stored);
  result.content_hash = ContentHash(stored);

  cv::Mat smoothed = Smoothed(linear_grey, 1);
  result.top_gradient = Quantile(GradientMagnitude(smoothed), 0.995);
  if (result.mean_linear > 0) {
    // Variation by a lamp, a vignette or a shadow over a sizeable part of the field is no texture.
    const cv::Mat slow = WidelySmoothed(
        linear_grey, std::max(4.0, std::min(linear_grey.cols, linear_grey.rows) / 25.0));
    cv::Scalar mean, deviation;
    cv::subtract(smoothed, slow, smoothed);
    cv::meanStdDev(smoothed, mean, deviation);
    smoothed.release();
    result.contrast = deviation[0] / result.mean_linear;
    result.coarse_texture = CoarseTexture(linear_grey, slow, result.noise_sigma);
  }
  return result;
}

std::optional<std::string> RejectionReason(const FrameStatistics& frame, double median_contrast,
                                           const QualityCheckOptions& options) {
  if (!(frame.mean_encoded >= options.min_mean_encoded)) {
    return fmt::format(
        "{}: the mean is {:.4f} of full scale, but at least {:.4f} is needed: expose longer",
        kKindDark, frame.mean_encoded, options.min_mean_encoded);
  }
  if (frame.is_mosaic) {
    return "raw mosaic: develop it first (the pixels of a colour filter stand side by side in one "
           "channel)";
  }
  if (!(frame.saturated_fraction <= options.max_saturated_fraction)) {
    return fmt::format(
        "{}: {:.0f} % of the pixels are clipped at {:.0f}, but at most {:.0f} % may be: lower the "
        "exposure",
        kKindSaturated, 100 * frame.saturated_fraction, frame.saturation_level,
        100 * options.max_saturated_fraction);
  }
  if (!options.edge_target && !frame.black_is_one_side &&
      !(frame.black_fraction <= options.max_black_fraction)) {
    return fmt::format(
        "{}: {:.0f} % of the pixels are clipped at {:.0f}, but at most {:.0f} % may be unless the "
        "target is an edge: expose longer or lower the camera's black level",
        kKindBlack, 100 * frame.black_fraction, frame.black_level,
        100 * options.max_black_fraction);
  }
  // White noise of standard deviation n, smoothed by sigma 1 px, has derivatives of n/sqrt(8 pi)
  // per axis.
  const double noise_gradient = frame.noise_sigma / std::sqrt(8 * CV_PI);
  if (!(frame.top_gradient > options.min_gradient_to_noise * noise_gradient) &&
      !(frame.coarse_texture > options.min_coarse_texture)) {
    return fmt::format(
        "no texture above the noise: the steepest gradients are {:.1f} x those of the noise, but "
        "{:.1f} x is needed",
        noise_gradient > 0 ? frame.top_gradient / noise_gradient : 0.0,
        options.min_gradient_to_noise);
  }
  if (!(frame.contrast >= options.min_relative_contrast * median_contrast)) {
    return fmt::format("blank: the contrast is {:.4f}, but the median of the sweep is {:.4f}",
                       frame.contrast, median_contrast);
  }
  return std::nullopt;
}

}  // namespace thicklens::calib

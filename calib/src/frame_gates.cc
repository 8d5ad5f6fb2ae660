#include "thicklens/calib/frame_gates.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "edge_pixels.h"

namespace thicklens::calib {
namespace {

struct PileUp {
  double fraction = 0;
  double level = 0;  // stored value, in units of full scale
};

// Clipping anywhere: the brightest value that the channel uses holds many pixels while the values
// just below hold few of them. A camera may clip below full scale (one at 240 to 248 of 255).
PileUp BrightPileUp(const std::vector<double>& histogram, double total) {
  const std::size_t top = histogram.size() - 1;
  if (histogram[top] > 0.001 * total) return {histogram[top] / total, 1};
  // JPEG and a colour matrix smear the clipped value over some neighbours: the brightest 1/64 of
  // the range that is in use is compared with the three stretches of that width below it.
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
  // A plateau of the target is spread by noise to both sides of its middle; clipping cuts the upper
  // side off.
  const auto value_at = [&](double fraction) {
    double count = 0;
    std::size_t value = end - width;
    while (value + 1 < end && count + histogram[value] < fraction * bright)
      count += histogram[value++];
    return static_cast<double>(value);
  };
  const double upper = value_at(0.95) - value_at(0.5);
  const double lower = value_at(0.5) - value_at(0.05);
  if (upper > 0 && upper > 0.5 * lower) return {};
  return {bright / total, static_cast<double>(end - 1) / static_cast<double>(top)};
}

PileUp Saturation(const cv::Mat& stored, double noise_sigma) {
  const bool bytes = stored.depth() == CV_8U;
  const std::size_t levels = bytes ? 256 : 65536;
  const int channels = stored.channels() == 4 ? 3 : stored.channels();
  PileUp worst;
  for (int c = 0; c < channels; ++c) {
    std::vector<double> histogram(levels, 0);
    for (int y = 0; y < stored.rows; ++y) {
      for (int x = 0; x < stored.cols; ++x) {
        const int i = x * stored.channels() + c;
        histogram[bytes ? stored.ptr<std::uint8_t>(y)[i] : stored.ptr<std::uint16_t>(y)[i]] += 1;
      }
    }
    PileUp found = BrightPileUp(histogram, static_cast<double>(stored.total()));
    // Where the noise is below the steps of the file, every plateau piles up on one value: only
    // full scale counts there.
    if (found.level < 1 && !(noise_sigma * static_cast<double>(levels - 1) > 0.5)) found = {};
    if (found.fraction > worst.fraction) worst = found;
  }
  return worst;
}

// Standard deviation of a pixel: in 16 x 16 blocks the rms of (p00 - p10 - p01 + p11)/2, which
// cancels any slope; of these the 25th percentile, where the target is flat.
double NoiseSigma(const cv::Mat& grey) {
  constexpr int kBlock = 16;
  std::vector<double> blocks;
  for (int y0 = 0; y0 + kBlock < grey.rows; y0 += kBlock) {
    for (int x0 = 0; x0 + kBlock < grey.cols; x0 += kBlock) {
      double sum = 0;
      for (int y = y0; y < y0 + kBlock; ++y) {
        const auto* a = grey.ptr<float>(y);
        const auto* b = grey.ptr<float>(y + 1);
        for (int x = x0; x < x0 + kBlock; ++x) {
          const double d = 0.5 * (a[x] - a[x + 1] - b[x] + b[x + 1]);
          sum += d * d;
        }
      }
      blocks.push_back(std::sqrt(sum / (kBlock * kBlock)));
    }
  }
  if (blocks.empty()) return 0;
  const auto quarter = blocks.begin() + static_cast<std::ptrdiff_t>(blocks.size() / 4);
  std::nth_element(blocks.begin(), quarter, blocks.end());
  return *quarter;
}

}  // namespace

FrameStatistics MeasureFrame(const cv::Mat& stored, const cv::Mat& linear_grey) {
  FrameStatistics result;
  const double full_scale = stored.depth() == CV_8U ? 255 : 65535;
  const cv::Scalar means = cv::mean(stored);
  const int channels = stored.channels() == 4 ? 3 : stored.channels();
  for (int c = 0; c < channels; ++c) result.mean_stored += means[c] / (channels * full_scale);
  result.mean_linear = cv::mean(linear_grey)[0];
  result.noise_sigma = NoiseSigma(linear_grey);

  const PileUp saturation = Saturation(stored, result.noise_sigma);
  result.saturated_fraction = saturation.fraction;
  result.saturation_level = saturation.level * full_scale;

  const cv::Mat smoothed = Smoothed(linear_grey, 1);
  result.top_gradient = Quantile(CentralGradient(smoothed).magnitude, 0.995);
  if (result.mean_linear > 0) {
    // What a lamp, a vignette or a shadow does over a sizeable part of the field is no texture.
    const cv::Mat slow =
        Smoothed(linear_grey, std::max(4.0, std::min(linear_grey.cols, linear_grey.rows) / 25.0));
    cv::Scalar mean, deviation;
    cv::meanStdDev(smoothed - slow, mean, deviation);
    result.contrast = deviation[0] / result.mean_linear;
  }
  return result;
}

std::optional<std::string> RejectionReason(const FrameStatistics& frame, double median_contrast,
                                           const GateOptions& options) {
  if (!(frame.mean_stored >= options.min_mean_stored)) {
    return fmt::format("dark: mean {:.3f} of full scale, at least {:.3f} is needed",
                       frame.mean_stored, options.min_mean_stored);
  }
  if (!(frame.saturated_fraction <= options.max_saturated_fraction)) {
    return fmt::format("saturated: {:.0f} % of the pixels pile up at {:.0f}, at most {:.0f} % may",
                       100 * frame.saturated_fraction, frame.saturation_level,
                       100 * options.max_saturated_fraction);
  }
  // White noise of standard deviation n, smoothed by sigma 1 px: derivative n/sqrt(8 pi) per axis.
  const double noise_gradient = frame.noise_sigma / std::sqrt(8 * CV_PI);
  if (!(frame.top_gradient > options.min_gradient_to_noise * noise_gradient)) {
    return fmt::format(
        "no texture above the noise: steepest gradients {:.1f} x the noise's, {:.1f} is needed",
        noise_gradient > 0 ? frame.top_gradient / noise_gradient : 0.0,
        options.min_gradient_to_noise);
  }
  if (!(frame.contrast >= options.min_relative_contrast * median_contrast)) {
    return fmt::format("blank: contrast {:.4f} against the sweep's median {:.4f}", frame.contrast,
                       median_contrast);
  }
  return std::nullopt;
}

}  // namespace thicklens::calib

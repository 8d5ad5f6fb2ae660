#include "calib/response/processing_traces.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace thicklens::calib {
namespace {

constexpr double kMinTraceBlurPx = 6;
constexpr int kCoarse = 4;  // px, side of the blocks of the coarse noise
constexpr std::size_t kTraceFrames = 8, kMinTraceFrames = 3;
constexpr int kGrid = 8;  // px

// Variance of a pixel by second differences along both axes, whose gain for white noise is 1.
double NoisePower(const cv::Mat& image) {
  const float a = static_cast<float>(1 / std::sqrt(6.0));
  const cv::Mat kernel = (cv::Mat_<float>(1, 3) << a, -2 * a, a);
  cv::Mat rest;
  cv::sepFilter2D(image, rest, CV_32F, kernel, kernel);
  const cv::Mat inside = rest(cv::Rect(1, 1, rest.cols - 2, rest.rows - 2));
  return inside.dot(inside) / static_cast<double>(inside.total());
}

// The mean of the frames' values, with the standard error of their scatter.
std::optional<model::Estimate> MeanOf(const std::vector<double>& values) {
  if (values.size() < kMinTraceFrames) return std::nullopt;
  const auto n = static_cast<double>(values.size());
  double mean = 0, spread = 0;
  for (const double value : values) mean += value / n;
  for (const double value : values) spread += std::pow(value - mean, 2);
  return model::Estimate{mean, std::sqrt(spread / (n - 1) / n)};
}

// Excess of the mean absolute second difference at the phase of the grid where it is largest, over
// those of the other phases, along the rows of the image.
double GridExcess(const cv::Mat& image) {
  std::array<double, kGrid> sums{}, counts{};
  for (int y = 0; y < image.rows; ++y) {
    const auto* row = image.ptr<float>(y);
    for (int x = 1; x + 2 < image.cols; ++x) {
      // The step between x and x + 1, without the slope on both of its sides.
      const auto phase = static_cast<std::size_t>(x % kGrid);
      sums[phase] += std::abs(row[x + 1] - row[x] - 0.5F * (row[x] - row[x - 1]) -
                              0.5F * (row[x + 2] - row[x + 1]));
      counts[phase] += 1;
    }
  }
  double largest = 0;
  for (std::size_t phase = 0; phase < sums.size(); ++phase) {
    sums[phase] /= std::max(1.0, counts[phase]);
    largest = std::max(largest, sums[phase]);
  }
  // The two neighbours of a step contain half of it.
  std::array<double, kGrid> sorted = sums;
  std::sort(sorted.begin(), sorted.end());
  const double others = 0.5 * (sorted[2] + sorted[3]);
  return others > 0 ? largest / others - 1 : 0;
}

}  // namespace

std::optional<model::Estimate> MeasureNoiseRise(const ResponseFrames& frames, cv::Size size,
                                                double least_noise) {
  const ResponseCrop crop(frames, size);
  std::vector<std::size_t> blurred;
  for (const std::size_t i : BySharpness(frames)) {
    if (frames.frames[i].variance_px2 > kMinTraceBlurPx * kMinTraceBlurPx) blurred.push_back(i);
  }
  std::vector<double> rises;
  if (std::min(crop.size().width, crop.size().height) < 8 * kCoarse) return std::nullopt;
  for (const std::size_t i : Spread(blurred, kTraceFrames)) {
    const cv::Mat image = crop.Read(i);
    cv::Mat coarse;
    const cv::Rect whole(0, 0, image.cols / kCoarse * kCoarse, image.rows / kCoarse * kCoarse);
    cv::resize(image(whole), coarse, whole.size() / kCoarse, 0, 0, cv::INTER_AREA);
    const double fine_power = NoisePower(image);
    if (!(fine_power > least_noise * least_noise)) continue;
    const double coarse_power = kCoarse * kCoarse * NoisePower(coarse);
    if (coarse_power > 0) rises.push_back(fine_power / coarse_power - 1);
  }
  return MeanOf(rises);
}

std::optional<model::Estimate> MeasureNoiseSmoothness(const ResponseFrames& frames, cv::Size size,
                                                      double step) {
  constexpr double kAboveRounding = 4;  // ratio of the noise power of 4 x 4 px to that of rounding
  // Largest ratio of the power of 8 x 8 px, where the target may still be seen, to that of 4 x 4
  // px. Of what is left of the target a disc passes 1/64 from there to 4 x 4 px, and a Gaussian
  // nothing.
  const double max_of_target = frames.psf == model::Psf::kDisc ? 10 : 50;
  const ResponseCrop crop(frames, size);
  if (std::min(crop.size().width, crop.size().height) < 16 * kCoarse) return std::nullopt;
  const double rounding = step * step / 12;
  std::vector<std::size_t> blurred;
  for (const std::size_t i : BySharpness(frames)) {
    if (frames.frames[i].variance_px2 > kMinTraceBlurPx * kMinTraceBlurPx) blurred.push_back(i);
  }
  std::vector<double> ratios;
  for (const std::size_t i : Spread(blurred, kTraceFrames)) {
    const cv::Mat image = crop.Read(i);
    const auto power_of = [&](int side) {
      cv::Mat coarse;
      const cv::Rect whole(0, 0, image.cols / side * side, image.rows / side * side);
      cv::resize(image(whole), coarse, whole.size() / side, 0, 0, cv::INTER_AREA);
      return side * side * NoisePower(coarse);
    };
    const double of_two = power_of(2), of_four = power_of(kCoarse),
                 of_eight = power_of(2 * kCoarse);
    if (!(of_four > kAboveRounding * rounding) || !(of_eight < max_of_target * of_four)) continue;
    ratios.push_back(std::max(0.0, of_two - rounding) / (of_four - rounding));
  }
  return MeanOf(ratios);
}

std::optional<model::Estimate> MeasureBlockGrid(const ResponseFrames& frames, cv::Size size) {
  const ResponseCrop crop(frames, size);
  if (std::min(crop.size().width, crop.size().height) < 8 * kGrid) return std::nullopt;
  std::vector<double> excesses;
  for (const std::size_t i : Spread(BySharpness(frames), kTraceFrames)) {
    const cv::Mat image = crop.Read(i);
    excesses.push_back(std::min(GridExcess(image), GridExcess(image.t())));
  }
  return MeanOf(excesses);
}

}  // namespace thicklens::calib

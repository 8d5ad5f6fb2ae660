#include "thicklens/calib/frame_average.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/statistics.h"
#include "thicklens/base/validity.h"

namespace thicklens::calib {
namespace {

constexpr double kSigmaOfMad = 1.4826;  // a Gaussian's standard deviation over its median deviation
constexpr double kClipSigmas = 4;
// Statistics over the pixels need no more of them than this.
constexpr int kMaxSamples = 100'000;

void RequireAlike(const cv::Mat& light, const cv::Mat& first, std::size_t index) {
  if (light.type() == first.type() && light.size() == first.size()) return;
  throw Error(fmt::format(
      "exposure {}: {} x {} px with {} channel(s) are expected as in the first one, found {} x {} "
      "px with {}",
      index, first.cols, first.rows, first.channels(), light.cols, light.rows, light.channels()));
}

cv::Mat ReadLight(const LightReader& read, std::size_t index) {
  cv::Mat light = read(index);
  if (light.empty() || light.depth() != CV_32F ||
      (light.channels() != 1 && light.channels() != 3)) {
    throw Error(
        fmt::format("exposure {}: linear light as floats with 1 or 3 channels is expected", index));
  }
  return light.isContinuous() ? light : light.clone();
}

// Every n-th value, so that at most kMaxSamples remain.
std::vector<double> Samples(const cv::Mat& values) {
  std::vector<double> samples;
  const auto all = static_cast<std::ptrdiff_t>(values.total()) * values.channels();
  const std::ptrdiff_t step = std::max<std::ptrdiff_t>(1, all / kMaxSamples) | 1;
  const auto* value = values.ptr<float>();
  for (std::ptrdiff_t i = 0; i < all; i += step) samples.push_back(static_cast<double>(value[i]));
  return samples;
}

double RobustSigma(std::vector<double> values) {
  const double middle = Median(values);
  for (double& value : values) value = std::abs(value - middle);
  return kSigmaOfMad * Median(std::move(values));
}

// The noise of one exposure, from the second differences of neighbouring pixels, which cancel any
// slope. Their variance is 4/4 of the pixels'.
double NoiseOfOne(const cv::Mat& light) {
  if (light.cols < 2 || light.rows < 2) return 0;
  const cv::Rect left(0, 0, light.cols - 1, light.rows - 1);
  const auto at = [&](int dx, int dy) { return light(left + cv::Point(dx, dy)); };
  const cv::Mat second = 0.5 * (at(0, 0) - at(1, 0) - at(0, 1) + at(1, 1));
  return RobustSigma(Samples(second));
}

// Sum and sum of squares of what exposures differ from the first one, which keeps the digits.
class Moments {
 public:
  void Add(const cv::Mat& light) {
    if (count_++ == 0) {
      first_ = light.clone();
      sum_ = cv::Mat::zeros(light.size(), light.type());
      squares_ = sum_.clone();
      return;
    }
    const cv::Mat difference = light - first_;
    sum_ += difference;
    squares_ += difference.mul(difference);
  }
  cv::Mat Mean() const { return first_ + sum_ / static_cast<double>(count_); }
  // The variance of a pixel of one exposure.
  cv::Mat Variance() const {
    const auto n = static_cast<double>(count_);
    return (squares_ - sum_.mul(sum_) / n) / (n - 1);
  }

 private:
  std::size_t count_ = 0;
  cv::Mat first_, sum_, squares_;
};

// The median over pixels of their variance is below the mean, which is what counts: for n values
// of a Gaussian, by the median of chi^2/(n - 1), about (1 - 2/(9 (n - 1)))^3.
double NoiseOfVariance(const cv::Mat& variance, std::size_t count) {
  const auto dof = static_cast<double>(count - 1);
  const double median_of_chi2 = std::pow(1 - 2 / (9 * dof), 3);
  const double median = Median(Samples(variance));
  // Where noise is below the steps of the values, most pixels do not vary, and a few do.
  if (!(median > 0)) return std::sqrt(std::max(0.0, cv::mean(variance.reshape(1))[0]));
  return std::sqrt(median / median_of_chi2);
}

// The values of one pixel in all exposures, whose average is taken.
double MedianOf(std::vector<float>* values) {
  const auto middle = values->begin() + static_cast<std::ptrdiff_t>(values->size() / 2);
  std::nth_element(values->begin(), middle, values->end());
  const auto upper = static_cast<double>(*middle);
  if (values->size() % 2 != 0) return upper;
  return 0.5 * (upper + static_cast<double>(*std::max_element(values->begin(), middle)));
}

// The mean of the values within kClipSigmas of their median. The standard deviation is the larger
// of the pixel's own, which few values determine badly, and that of the whole frame.
double ClippedMean(std::vector<float>* values, double noise_sigma, std::size_t* left_out) {
  const double middle = MedianOf(values);
  thread_local std::vector<float> deviations;
  deviations.clear();
  for (const float value : *values)
    deviations.push_back(static_cast<float>(std::abs(static_cast<double>(value) - middle)));
  const double sigma = std::max(noise_sigma, kSigmaOfMad * MedianOf(&deviations));
  double sum = 0;
  std::size_t count = 0;
  for (const float value : *values) {
    if (std::abs(static_cast<double>(value) - middle) > kClipSigmas * sigma) continue;
    sum += static_cast<double>(value);
    ++count;
  }
  *left_out += values->size() - count;
  return count > 0 ? sum / static_cast<double>(count) : middle;
}

// Averages a band of rows of all exposures.
void AverageBand(const std::vector<cv::Mat>& bands, FrameAveraging method, double noise_sigma,
                 cv::Mat* average, std::size_t* left_out) {
  std::vector<float> values(bands.size());
  for (int y = 0; y < average->rows; ++y) {
    ThrowIfCancelled();
    auto* out = average->ptr<float>(y);
    for (int i = 0; i < average->cols * average->channels(); ++i) {
      for (std::size_t k = 0; k < bands.size(); ++k) values[k] = bands[k].ptr<float>(y)[i];
      out[i] = static_cast<float>(method == FrameAveraging::kMedian
                                      ? MedianOf(&values)
                                      : ClippedMean(&values, noise_sigma, left_out));
    }
  }
}

// The structure of a channel between the scales of pixels and of shading, in blocks of 4 x 4 px.
cv::Mat MiddleScales(const cv::Mat& channel) {
  constexpr int kBlock = 4;
  cv::Mat coarse, slow;
  cv::resize(channel, coarse, cv::Size(channel.cols / kBlock, channel.rows / kBlock), 0, 0,
             cv::INTER_AREA);
  constexpr double kShadingSigma = 4;
  cv::GaussianBlur(coarse, slow, cv::Size(), kShadingSigma, kShadingSigma, cv::BORDER_REFLECT_101);
  // Twice smoothed, shading shows how much of its bend a smoothing loses.
  cv::Mat slower;
  cv::GaussianBlur(slow, slower, cv::Size(), kShadingSigma, kShadingSigma, cv::BORDER_REFLECT_101);
  const cv::Mat structure = coarse - (2 * slow - slower);
  const int margin =
      std::min({static_cast<int>(2 * kShadingSigma), structure.cols / 4, structure.rows / 4});
  return structure(
             cv::Rect(margin, margin, structure.cols - 2 * margin, structure.rows - 2 * margin))
      .clone();
}

cv::Mat FromNeighbours(const cv::Mat& channel) {
  cv::Mat typical;
  cv::medianBlur(channel, typical, 5);
  return channel - typical;
}

std::vector<cv::Mat> Channels(const cv::Mat& image) {
  std::vector<cv::Mat> channels;
  cv::split(image, channels);
  return channels;
}

void RequireLightImage(const cv::Mat& image, const char* name) {
  if (image.depth() == CV_32F && (image.channels() == 1 || image.channels() == 3)) return;
  throw Error(fmt::format("{}: linear light as floats with 1 or 3 channels is expected", name));
}

}  // namespace

std::string FrameAveragingName(FrameAveraging method) {
  switch (method) {
    case FrameAveraging::kMedian:
      return "median";
    case FrameAveraging::kMean:
      return "mean";
    default:
      return "clipped-mean";
  }
}

FrameAverage AverageFrames(std::size_t count, const LightReader& read, FrameAveraging method,
                           std::size_t byte_limit) {
  if (count == 0) throw Error("no exposure is given: at least one is needed for an average");
  FrameAverage average;
  average.frames = count;
  const cv::Mat first = ReadLight(read, 0);
  if (count == 1) {
    average.light = first.clone();
    average.noise_sigma = NoiseOfOne(first);
    average.mean_level = cv::mean(average.light.reshape(1))[0];
    return average;
  }
  constexpr std::size_t kFewest = 3;
  Moments moments;
  for (std::size_t i = 0; i < count; ++i) {
    const cv::Mat light = i == 0 ? first : ReadLight(read, i);
    RequireAlike(light, first, i);
    moments.Add(light);
  }
  average.noise_sigma = NoiseOfVariance(moments.Variance(), count);
  if (method == FrameAveraging::kMean || count < kFewest) {
    average.light = moments.Mean();
  } else {
    average.light.create(first.size(), first.type());
    const std::size_t row_bytes = first.elemSize() * static_cast<std::size_t>(first.cols) * count;
    const int rows = static_cast<int>(
        std::clamp<std::size_t>(byte_limit / row_bytes, 1, static_cast<std::size_t>(first.rows)));
    std::size_t left_out = 0;
    for (int y = 0; y < first.rows; y += rows) {
      const cv::Range band(y, std::min(y + rows, first.rows));
      std::vector<cv::Mat> bands;
      for (std::size_t i = 0; i < count; ++i)
        bands.push_back(ReadLight(read, i).rowRange(band).clone());
      cv::Mat out = average.light.rowRange(band);
      AverageBand(bands, method, average.noise_sigma, &out, &left_out);
    }
    average.left_out =
        static_cast<double>(left_out) /
        static_cast<double>(count * first.total() * static_cast<std::size_t>(first.channels()));
  }
  average.mean_level = cv::mean(average.light.reshape(1))[0];
  return average;
}

bool DefectOptions::IsValid(std::string* why) const {
  const std::pair<const char*, double> positive[] = {
      {"hot_sigmas", hot_sigmas}, {"least_hot", least_hot}, {"flat_deviation", flat_deviation}};
  for (const auto& [field, value] : positive) {
    if (value > 0 && std::isfinite(value)) continue;
    return Fail(why, fmt::format("{} is {}: it must be finite and > 0", field, value));
  }
  if (flat_deviation < 1) return true;
  return Fail(why, fmt::format("flat_deviation is {}: it must be below 1", flat_deviation));
}

Defects FindDefects(const cv::Mat& dark, const cv::Mat& flat, const DefectOptions& options) {
  std::string why;
  if (!options.IsValid(&why)) throw Error(why);
  if (dark.empty() && flat.empty()) throw Error("a dark or a flat is needed to find defects");
  if (!dark.empty()) RequireLightImage(dark, "dark");
  if (!flat.empty()) RequireLightImage(flat, "flat");
  if (!dark.empty() && !flat.empty() && (dark.type() != flat.type() || dark.size() != flat.size()))
    throw Error("dark and flat must have one size and one number of channels");
  const cv::Size size = dark.empty() ? flat.size() : dark.size();
  cv::Mat hot = cv::Mat::zeros(size, CV_8U), dead = hot.clone();
  if (!dark.empty()) {
    for (const cv::Mat& channel : Channels(dark)) {
      const cv::Mat difference = FromNeighbours(channel);
      const double limit =
          std::max(options.least_hot, options.hot_sigmas * RobustSigma(Samples(difference)));
      hot |= difference > limit;
    }
  }
  if (!flat.empty()) {
    for (const cv::Mat& channel : Channels(dark.empty() ? flat : cv::Mat(flat - dark))) {
      cv::Mat typical;
      cv::medianBlur(channel, typical, 5);
      dead |= cv::abs(channel - typical) > options.flat_deviation * cv::abs(typical);
    }
    dead.setTo(0, hot);
  }
  Defects found;
  found.hot = static_cast<std::size_t>(cv::countNonZero(hot));
  found.dead = static_cast<std::size_t>(cv::countNonZero(dead));
  found.mask = hot | dead;
  return found;
}

FlatStructure StructureOf(const cv::Mat& flat) {
  RequireLightImage(flat, "flat");
  constexpr int kSmallest = 32;
  FlatStructure largest;
  if (flat.cols < kSmallest || flat.rows < kSmallest) return largest;
  for (const cv::Mat& channel : Channels(flat)) {
    const double mean = cv::mean(channel)[0];
    if (!(mean > 0)) continue;
    constexpr double kPixelsOfBlockSide = 4;
    const double structure = RobustSigma(Samples(MiddleScales(channel))) / mean;
    if (structure <= largest.relative) continue;
    largest.relative = structure;
    largest.of_noise = NoiseOfOne(channel) / mean / kPixelsOfBlockSide;
  }
  return largest;
}

}  // namespace thicklens::calib

#include "calib/edges/edge_finder.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "thicklens/base/cancel.h"

namespace thicklens::calib {
namespace {

constexpr int kSmallestSide = 24;
constexpr int kMaxScales = 4;
constexpr double kSmoothingSigma = 1;

// Noise of a gradient component, measured at quiet places. The magnitude of a gradient that
// contains only noise follows the Rayleigh distribution, of which a fifth lies below 0.668 standard
// deviations of a component. Only a part of the pixels is sampled.
double GradientNoise(const cv::Mat& magnitude) {
  cv::Mat part;
  const cv::Size size(std::min(magnitude.cols, 128), std::min(magnitude.rows, 128));
  cv::resize(magnitude, part, size, 0, 0, cv::INTER_NEAREST);
  return Quantile(part, 0.2) / 0.668;
}

// Grows the regions one after the other. A pixel belongs to at most one region.
class RegionGrower {
 public:
  RegionGrower(const Gradient& gradient, double threshold)
      : gradient_(gradient), taken_(gradient.magnitude.size(), CV_8U, cv::Scalar(1)) {
    // The outermost pixels of the frame have no gradient.
    for (int y = 1; y + 1 < taken_.rows; ++y) {
      const auto* magnitude = gradient.magnitude.ptr<float>(y);
      auto* taken = taken_.ptr<uchar>(y);
      for (int x = 1; x + 1 < taken_.cols; ++x) taken[x] = magnitude[x] > threshold ? 0 : 1;
    }
  }

  // Pixels that belong to no region, in about descending order of magnitude.
  std::vector<cv::Point> Seeds() const {
    constexpr int kBins = 64;
    double largest = 0;
    cv::minMaxLoc(gradient_.magnitude, nullptr, &largest);
    std::vector<std::vector<cv::Point>> bins(kBins + 1);
    for (int y = 0; y < taken_.rows; ++y) {
      ThrowIfCancelled();
      for (int x = 0; x < taken_.cols; ++x) {
        if (taken_.at<uchar>(y, x) != 0) continue;
        const double share = gradient_.magnitude.at<float>(y, x) / largest;
        bins[static_cast<std::size_t>(kBins * (1 - share))].emplace_back(x, y);
      }
    }
    std::vector<cv::Point> seeds;
    for (const auto& bin : bins) seeds.insert(seeds.end(), bin.begin(), bin.end());
    return seeds;
  }

  bool IsFree(cv::Point at) const { return taken_.at<uchar>(at) == 0; }

  const std::vector<cv::Point>& Grow(cv::Point seed) {
    constexpr float kCosine = 0.94F;  // 20 degrees
    pixels_.clear();
    Take(seed);
    cv::Point2f mean = Direction(seed);
    for (std::size_t next = 0; next < pixels_.size(); ++next) {
      const cv::Point from = pixels_[next];
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          const cv::Point at(from.x + dx, from.y + dy);
          if (!IsFree(at)) continue;
          const cv::Point2f direction = Direction(at);
          const float length = std::sqrt(mean.dot(mean));
          if (!(direction.dot(mean) > kCosine * length)) continue;
          mean += direction;
          Take(at);
        }
      }
    }
    return pixels_;
  }

 private:
  cv::Point2f Direction(cv::Point at) const {
    const float m = gradient_.magnitude.at<float>(at);
    return {gradient_.x.at<float>(at) / m, gradient_.y.at<float>(at) / m};
  }
  void Take(cv::Point at) {
    taken_.at<uchar>(at) = 1;
    pixels_.push_back(at);
  }

  const Gradient& gradient_;
  cv::Mat taken_;
  std::vector<cv::Point> pixels_;
};

// Fits the line through the weighted pixels. Returns std::nullopt if they do not form an elongated
// streak.
std::optional<StraightRegion> LineThrough(const std::vector<cv::Point>& pixels,
                                          const Gradient& gradient) {
  constexpr double kShortest = 8;
  if (pixels.size() < 16) return std::nullopt;
  StraightRegion region;
  Eigen::Vector2d towards_bright(0, 0);
  Eigen::Matrix2d moments = Eigen::Matrix2d::Zero();
  for (const cv::Point& pixel : pixels) {
    const double m = gradient.magnitude.at<float>(pixel);
    const Eigen::Vector2d at(pixel.x, pixel.y);
    region.weight += m;
    region.centre += m * at;
    moments += m * at * at.transpose();
    towards_bright += Eigen::Vector2d(gradient.x.at<float>(pixel), gradient.y.at<float>(pixel));
  }
  region.centre /= region.weight;
  moments = moments / region.weight - region.centre * region.centre.transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(moments);
  // A uniform streak of length l has the variance l^2/12 along its axis.
  const double length = std::sqrt(12 * std::max(axes.eigenvalues()[1], 0.0));
  const double width = std::sqrt(12 * std::max(axes.eigenvalues()[0], 0.0));
  if (!(length >= kShortest) || !(length >= 1.5 * width)) return std::nullopt;
  region.half_length = length / 2;
  // The frame and the streak's own ends cut wide and short streaks obliquely. The gradients then
  // determine the direction better.
  Eigen::Vector2d normal = length > 6 * width ? Eigen::Vector2d(axes.eigenvectors().col(0))
                                              : towards_bright.normalized();
  if (normal.dot(towards_bright) < 0) normal = -normal;
  region.normal_rad = std::atan2(normal.y(), normal.x());
  return region;
}

}  // namespace

std::vector<FrameScale> FrameScales(const cv::Mat& grey) {
  std::vector<FrameScale> scales;
  cv::Mat reduced = grey;
  double factor = 1;
  while (static_cast<int>(scales.size()) < kMaxScales &&
         std::min(reduced.cols, reduced.rows) >= kSmallestSide) {
    FrameScale scale;
    scale.factor = factor;
    scale.smoothed = Smoothed(reduced, kSmoothingSigma);
    scale.gradient = CentralGradient(scale.smoothed);
    scale.gradient_noise = GradientNoise(scale.gradient.magnitude);
    scales.push_back(scale);
    const cv::Mat even = reduced(cv::Rect(0, 0, reduced.cols & ~1, reduced.rows & ~1));
    cv::Mat half;
    cv::resize(even, half, cv::Size(even.cols / 2, even.rows / 2), 0, 0, cv::INTER_AREA);
    reduced = half;
    factor *= 2;
  }
  return scales;
}

std::vector<StraightRegion> StraightRegions(const Gradient& gradient, double threshold, int most) {
  std::vector<StraightRegion> regions;
  RegionGrower grower(gradient, threshold);
  for (const cv::Point& seed : grower.Seeds()) {
    if (!grower.IsFree(seed)) continue;
    const auto region = LineThrough(grower.Grow(seed), gradient);
    if (region) regions.push_back(*region);
  }
  std::stable_sort(regions.begin(), regions.end(),
                   [](const auto& a, const auto& b) { return a.weight > b.weight; });
  if (regions.size() > static_cast<std::size_t>(most)) {
    regions.resize(static_cast<std::size_t>(most));
  }
  return regions;
}

std::vector<FeatureCandidate> EdgeCandidates(const FrameScale& scale, int most) {
  double largest = 0;
  cv::minMaxLoc(scale.gradient.magnitude, nullptr, &largest);
  const double threshold = std::max(4.5 * scale.gradient_noise, 0.1 * largest);
  std::vector<FeatureCandidate> candidates;
  if (!(threshold > 0) || !(largest > threshold)) return candidates;
  for (const StraightRegion& region : StraightRegions(scale.gradient, threshold, most)) {
    const auto candidate = UndisturbedStep(scale, region);
    if (candidate) candidates.push_back(*candidate);
  }
  return candidates;
}

}  // namespace thicklens::calib

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calib/edges/edge_finder.h"

namespace thicklens::calib {
namespace {

constexpr double kSmallestRadius = 5;  // px of the scale
constexpr double kLargestRadius = 40;
constexpr int kSamples = 72;

// Grey values on a circle about a corner, minus their mean.
using Circle = std::array<double, kSamples>;

std::optional<Circle> SampleCircle(const cv::Mat& grey, const Eigen::Vector2d& centre,
                                   double radius) {
  Circle circle;
  double mean = 0;
  for (int i = 0; i < kSamples; ++i) {
    const double angle = 2 * CV_PI * i / kSamples;
    const double value =
        SampleAt(grey, centre + radius * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
    if (!std::isfinite(value)) return std::nullopt;
    circle[static_cast<std::size_t>(i)] = value;
    mean += value / kSamples;
  }
  for (double& value : circle) value -= mean;
  return circle;
}

// The directions in which the two edges leave the corner, from 0 to pi, and the contrast.
struct Crossing {
  double first_rad = 0, second_rad = 0;
  double contrast = 0;
};

double Between(double a_rad, double b_rad) {
  return std::abs(std::remainder(a_rad - b_rad, CV_PI));
}

// Finds a crossing: four changes of sign, of which opposite ones are in line, and four sectors of
// about the same height.
std::optional<Crossing> CrossingOn(const Circle& circle) {
  std::vector<double> changes;
  std::array<double, 4> peaks{};
  for (int i = 0; i < kSamples; ++i) {
    const double here = circle[static_cast<std::size_t>(i)];
    const double next = circle[static_cast<std::size_t>((i + 1) % kSamples)];
    const std::size_t sector = changes.size() % 4;
    peaks[sector] = std::max(peaks[sector], std::abs(here));
    if ((here > 0) == (next > 0)) continue;
    if (changes.size() == 4) return std::nullopt;
    changes.push_back(2 * CV_PI * (i + here / (here - next)) / kSamples);
  }
  if (changes.size() != 4) return std::nullopt;
  constexpr double kInLine = 0.2;
  if (Between(changes[0], changes[2]) > kInLine || Between(changes[1], changes[3]) > kInLine) {
    return std::nullopt;
  }
  const auto [low, high] = std::minmax_element(peaks.begin(), peaks.end());
  if (!(*low > 0.5 * *high)) return std::nullopt;
  const auto mean_of = [](double a, double b) { return a + std::remainder(b - a, CV_PI) / 2; };
  Crossing crossing{mean_of(changes[0], changes[2]), mean_of(changes[1], changes[3]), *low + *high};
  if (Between(crossing.first_rad, crossing.second_rad) < 1) return std::nullopt;
  return crossing;
}

// Minus the determinant of the Hessian, which is large at saddles.
cv::Mat SaddleStrength(const cv::Mat& grey) {
  cv::Mat xx, yy, xy;
  cv::Sobel(grey, xx, CV_32F, 2, 0);
  cv::Sobel(grey, yy, CV_32F, 0, 2);
  cv::Sobel(grey, xy, CV_32F, 1, 1);
  return xy.mul(xy) - xx.mul(yy);
}

// Widens the circle as long as it shows the same crossing.
std::optional<FeatureCandidate> CornerAt(const FrameScale& scale, const Eigen::Vector2d& centre) {
  std::optional<Crossing> crossing;
  double reached = 0;
  for (double radius = kSmallestRadius; radius <= kLargestRadius; radius *= 1.15) {
    const auto circle = SampleCircle(scale.smoothed, centre, radius);
    const auto found = circle ? CrossingOn(*circle) : std::nullopt;
    if (!found) break;
    if (crossing && (Between(found->first_rad, crossing->first_rad) > 0.25 ||
                     Between(found->second_rad, crossing->second_rad) > 0.25)) {
      // Counted from another start, the two edges may have changed places.
      if (Between(found->first_rad, crossing->second_rad) > 0.25 ||
          Between(found->second_rad, crossing->first_rad) > 0.25) {
        break;
      }
    }
    crossing = found;
    reached = radius;
  }
  if (reached < 1.5 * kSmallestRadius || !(crossing->contrast > 12 * scale.gradient_noise)) {
    return std::nullopt;
  }
  // The more vertical edge is the one whose direction is nearer to the y axis.
  const bool first =
      std::abs(std::sin(crossing->first_rad)) >= std::abs(std::sin(crossing->second_rad));
  const double direction = first ? crossing->first_rad : crossing->second_rad;
  FeatureCandidate candidate;
  EdgeFeature& feature = candidate.feature;
  feature.kind = EdgeFeature::Kind::kCorner;
  feature.centre_px = (centre.array() + 0.5) * scale.factor - 0.5;
  feature.angle_rad = std::remainder(direction - CV_PI / 2, CV_PI);
  // The circle meets the next squares at a radius of one side length. Only the half of that radius
  // belongs to this corner alone.
  feature.half_width_px = feature.half_length_px = reached * scale.factor / 2;
  candidate.strength = crossing->contrast * std::sqrt(2 * feature.half_length_px);
  return candidate;
}

}  // namespace

std::vector<FeatureCandidate> CornerCandidates(const FrameScale& scale, int most) {
  const cv::Mat strength = SaddleStrength(scale.smoothed);
  cv::Mat crest;
  cv::dilate(strength, crest, cv::getStructuringElement(cv::MORPH_RECT, cv::Size(7, 7)));
  double largest = 0;
  cv::minMaxLoc(strength, nullptr, &largest);
  std::vector<std::pair<float, cv::Point>> saddles;
  const int margin = static_cast<int>(kSmallestRadius);
  for (int y = margin; y + margin < strength.rows; ++y) {
    for (int x = margin; x + margin < strength.cols; ++x) {
      const float here = strength.at<float>(y, x);
      if (here > 0.05 * largest && here >= crest.at<float>(y, x)) {
        saddles.emplace_back(here, cv::Point(x, y));
      }
    }
  }
  std::stable_sort(saddles.begin(), saddles.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  // The saddles after the strongest ones are noise.
  if (saddles.size() > static_cast<std::size_t>(2 * most)) {
    saddles.resize(static_cast<std::size_t>(2 * most));
  }
  std::vector<FeatureCandidate> candidates;
  for (const auto& [here, at] : saddles) {
    const auto candidate = CornerAt(scale, Eigen::Vector2d(at.x, at.y));
    if (candidate) candidates.push_back(*candidate);
    if (candidates.size() >= static_cast<std::size_t>(most)) break;
  }
  return candidates;
}

}  // namespace thicklens::calib

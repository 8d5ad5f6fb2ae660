#include "calib/edges/edge_spread.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "calib/edges/edge_finder.h"
#include "calib/edges/step_fit.h"
#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

// Maximum number of candidates in one scale. A frame full of texture has hundreds of false
// candidates.
constexpr int kMaxCandidates = 96;
constexpr int kMaxMeasured = 32;

// Whether a and b show the same line, side by side, or the same corner.
bool IsSame(const EdgeFeature& a, const EdgeFeature& b) {
  const Eigen::Vector2d offset = b.centre_px - a.centre_px;
  if (a.kind != b.kind) return false;
  if (a.kind == EdgeFeature::Kind::kCorner) {
    return offset.norm() < std::max(a.half_width_px, b.half_width_px) / 2;
  }
  if (std::abs(std::remainder(a.angle_rad - b.angle_rad, 2 * CV_PI)) > 0.3) return false;
  const Eigen::Vector2d normal(std::cos(a.angle_rad), std::sin(a.angle_rad));
  const double across = normal.dot(offset);
  const double along = normal.x() * offset.y() - normal.y() * offset.x();
  return std::abs(across) < std::max(a.half_width_px, b.half_width_px) &&
         std::abs(along) < a.half_length_px + b.half_length_px;
}

// Takes over the wider plateau that a coarser scale finds, because it extends further to the sides.
void Widen(const EdgeFeature& seen_again, EdgeFeature* feature) {
  if (feature->kind == EdgeFeature::Kind::kEdge &&
      seen_again.half_length_px > 0.9 * feature->half_length_px) {
    feature->half_width_px = std::max(feature->half_width_px, seen_again.half_width_px);
  }
}

struct Reading {
  BlurSigma blur;
  double weight = 0;
};

// Value below which half of the weight lies, interpolated linearly between the middles of the
// readings.
double WeightedMedian(const std::vector<Reading>& sorted, double total) {
  double below = 0, last_at = 0, last_value = sorted.front().blur.sigma_px;
  for (const Reading& reading : sorted) {
    const double at = below + reading.weight / 2;
    if (at >= total / 2) {
      const double t = at > last_at ? (total / 2 - last_at) / (at - last_at) : 1;
      return last_value + t * (reading.blur.sigma_px - last_value);
    }
    below += reading.weight;
    last_at = at;
    last_value = reading.blur.sigma_px;
  }
  return last_value;
}

std::optional<BlurSigma> RobustMean(const std::vector<BlurSigma>& blurs) {
  if (blurs.empty()) return std::nullopt;
  std::vector<double> errors;
  for (const BlurSigma& blur : blurs) errors.push_back(blur.error_px);
  // The minimum error prevents one reading from dominating because of its own small error estimate.
  const double least_error = 0.3 * Median(errors) + 1e-6;
  std::vector<Reading> readings;
  double total = 0;
  for (const BlurSigma& blur : blurs) {
    const double error = std::max(blur.error_px, least_error);
    readings.push_back({blur, 1 / (error * error)});
    total += readings.back().weight;
  }
  std::sort(readings.begin(), readings.end(),
            [](const Reading& a, const Reading& b) { return a.blur.sigma_px < b.blur.sigma_px; });
  BlurSigma mean{WeightedMedian(readings, total), 1 / std::sqrt(total)};
  std::vector<double> squares;
  double chi2 = 0;
  for (const Reading& reading : readings) {
    squares.push_back(std::pow(reading.blur.sigma_px - mean.sigma_px, 2) * reading.weight);
    chi2 += squares.back();
  }
  if (readings.size() < 3) {
    mean.error_px *= std::sqrt(std::max(1.0, chi2));
    return mean;
  }
  // The median of a chi^2 with one degree of freedom is 0.455; a median scatters by the factor
  // sqrt(pi/2) more than a mean.
  const double scatter = std::sqrt(std::max(1.0, Median(squares) / 0.455));
  mean.error_px *= std::sqrt(CV_PI / 2) * scatter;
  return mean;
}

// One sigma for both axes: the root of the mean of the variances.
BlurSigma Both(const BlurSigma& x, const BlurSigma& y) {
  BlurSigma both;
  both.sigma_px = std::sqrt((x.sigma_px * x.sigma_px + y.sigma_px * y.sigma_px) / 2);
  both.error_px = both.sigma_px > 0 ? std::hypot(x.sigma_px * x.error_px, y.sigma_px * y.error_px) /
                                          (2 * both.sigma_px)
                                    : std::hypot(x.error_px, y.error_px) / 2;
  return both;
}

}  // namespace

std::vector<EdgeFeature> FindEdges(const cv::Mat& grey, int most) {
  std::vector<FeatureCandidate> candidates;
  for (const FrameScale& scale : FrameScales(grey)) {
    for (const auto& found :
         {EdgeCandidates(scale, kMaxCandidates), CornerCandidates(scale, kMaxCandidates)}) {
      candidates.insert(candidates.end(), found.begin(), found.end());
    }
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const auto& a, const auto& b) { return a.strength > b.strength; });
  std::vector<EdgeFeature> features;
  for (const FeatureCandidate& candidate : candidates) {
    const auto shows_it = [&](const EdgeFeature& other) {
      return IsSame(other, candidate.feature);
    };
    const auto same = std::find_if(features.begin(), features.end(), shows_it);
    if (same != features.end()) {
      Widen(candidate.feature, &*same);
    } else if (static_cast<int>(features.size()) < most) {
      features.push_back(candidate.feature);
    }
  }
  return features;
}

std::optional<EdgeSpreadFit> FitEdgeSpread(const cv::Mat& grey, const EdgeFeature& feature,
                                           model::Psf psf, double floor_px, bool want_profile) {
  return feature.kind == EdgeFeature::Kind::kCorner
             ? FitCorner(grey, feature, psf, floor_px)
             : FitEdge(grey, feature, psf, floor_px, want_profile);
}

std::optional<FrameEdgeSpread> MeasureEdgeSpread(const cv::Mat& grey, model::Psf psf,
                                                 double floor_px) {
  std::vector<BlurSigma> x, y;
  FrameEdgeSpread frame;
  for (const EdgeFeature& feature : FindEdges(grey, kMaxMeasured)) {
    const auto fit = FitEdgeSpread(grey, feature, psf, floor_px, false);
    if (!fit) continue;
    if (fit->across_x) x.push_back(*fit->across_x);
    if (fit->across_y) y.push_back(*fit->across_y);
    ++frame.features;
  }
  frame.across_x = RobustMean(x);
  frame.across_y = RobustMean(y);
  if (!frame.across_x && !frame.across_y) return std::nullopt;
  frame.both = frame.across_x && frame.across_y ? Both(*frame.across_x, *frame.across_y)
               : frame.across_x                 ? *frame.across_x
                                                : *frame.across_y;
  return frame;
}

}  // namespace thicklens::calib

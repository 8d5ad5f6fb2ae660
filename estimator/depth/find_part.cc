#include "thicklens/estimator/find_part.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "estimator/depth/depth_surfaces.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/index.h"
#include "thicklens/base/pi.h"

namespace thicklens::estimator {
namespace {

constexpr double kEdgeSigma = 1;     // of the smoothing of both edge images, samples of the map
constexpr double kMinShare = 0.5;    // of the photograph's width or height
constexpr double kScaleStep = 0.01;  // from one size to the next, relative
constexpr double kApart = 3;         // between different parts, samples of the map
constexpr int kMaxSide = 192;        // likewise, of those that are compared
constexpr int kMinSide = 16;         // of the map, samples

// Where one surface of the map ends: 1 beside neighbours that are not of one surface, smoothed.
cv::Mat EdgesOf(const DepthSampling& map) {
  const DepthSurfaces surfaces(map);
  cv::Mat edges = cv::Mat::zeros(map.height_px, map.width_px, CV_32F);
  for (int y = 0; y < map.height_px; ++y) {
    for (int x = 0; x < map.width_px; ++x) {
      for (std::size_t n = 0; n < 2; ++n) {
        const int to_x = x + DepthSurfaces::kSteps[n][0], to_y = y + DepthSurfaces::kSteps[n][1];
        if (to_x >= map.width_px || to_y >= map.height_px || surfaces.IsLinked(x, y, n)) continue;
        if (std::isnan(surfaces.value(x, y)) || std::isnan(surfaces.value(to_x, to_y))) continue;
        edges.at<float>(y, x) = 1;
        edges.at<float>(to_y, to_x) = 1;
      }
    }
  }
  cv::GaussianBlur(edges, edges, {}, kEdgeSigma, kEdgeSigma, cv::BORDER_REPLICATE);
  return edges;
}

// The magnitude of the gradient of the photograph in samples of `step` px, limited to three times
// its mean, so that a few strong edges do not decide alone.
cv::Mat EdgesOf(const cv::Mat& photo, int width, int height) {
  cv::Mat small, along_x, along_y, edges;
  cv::resize(photo, small, {width, height}, 0, 0, cv::INTER_AREA);
  cv::Sobel(small, along_x, CV_32F, 1, 0, 3, 1, 0, cv::BORDER_REPLICATE);
  cv::Sobel(small, along_y, CV_32F, 0, 1, 3, 1, 0, cv::BORDER_REPLICATE);
  cv::magnitude(along_x, along_y, edges);
  cv::min(edges, 3 * cv::mean(edges)[0], edges);
  cv::GaussianBlur(edges, edges, {}, kEdgeSigma, kEdgeSigma, cv::BORDER_REPLICATE);
  return edges;
}

// One size of the part, with the correlation at each place.
struct Trial {
  double step_x = 1, step_y = 1;  // px of the photograph per sample
  cv::Mat correlation;
};

}  // namespace

FoundPart FindPart(const DepthSampling& map, const model::LinearImage& photo) {
  if (map.width_px < 1 || map.height_px < 1 ||
      map.values.size() != Index(map.width_px) * Index(map.height_px) || photo.width_px < 1 ||
      photo.height_px < 1 ||
      photo.values.size() !=
          Index(photo.width_px) * Index(photo.height_px) * Index(photo.channels)) {
    throw Error("the part of a photograph that a depth map shows needs both with their values");
  }
  const int longer = std::max(map.width_px, map.height_px);
  if (longer > kMaxSide) {
    // The middle of each n x n samples: enough to find the part, in a time that large maps allow.
    const int n = (longer + kMaxSide - 1) / kMaxSide;
    DepthSampling small{map.width_px / n, map.height_px / n, {}, {}};
    if (small.width_px < 1 || small.height_px < 1) return {};
    for (int y = 0; y < small.height_px; ++y) {
      for (int x = 0; x < small.width_px; ++x) {
        small.values.push_back(
            map.values[Index(y * n + n / 2) * Index(map.width_px) + Index(x * n + n / 2)]);
      }
    }
    FoundPart found = FindPart(small, photo);
    found.size_px.x() *= static_cast<double>(map.width_px) / (small.width_px * n);
    found.size_px.y() *= static_cast<double>(map.height_px) / (small.height_px * n);
    return found;
  }
  FoundPart best;
  if (std::min(map.width_px, map.height_px) < kMinSide) return best;
  const cv::Mat of_map = EdgesOf(map);
  if (!(cv::norm(of_map) > 0)) return best;
  cv::Mat grey(photo.height_px, photo.width_px, CV_32F);
  for (int y = 0; y < photo.height_px; ++y) {
    for (int x = 0; x < photo.width_px; ++x) {
      float sum = 0;
      for (int c = 0; c < std::min(photo.channels, 3); ++c) sum += photo.at(x, y, c);
      grey.at<float>(y, x) = sum;
    }
  }
  const double most = std::min(static_cast<double>(photo.width_px) / map.width_px,
                               static_cast<double>(photo.height_px) / map.height_px);
  const double least = kMinShare * std::max(static_cast<double>(photo.width_px) / map.width_px,
                                            static_cast<double>(photo.height_px) / map.height_px);
  std::vector<Trial> trials;
  for (double step = most; step >= std::min(least, most); step /= 1 + kScaleStep) {
    ThrowIfCancelled();
    const int width = std::max(map.width_px, static_cast<int>(std::lround(photo.width_px / step)));
    const int height =
        std::max(map.height_px, static_cast<int>(std::lround(photo.height_px / step)));
    Trial trial;
    trial.step_x = static_cast<double>(photo.width_px) / width;
    trial.step_y = static_cast<double>(photo.height_px) / height;
    cv::matchTemplate(EdgesOf(grey, width, height), of_map, trial.correlation,
                      cv::TM_CCOEFF_NORMED);
    trials.push_back(std::move(trial));
  }
  const auto middle = [&](const Trial& trial, int x, int y) {
    return Eigen::Vector2d((x + map.width_px / 2.0) * trial.step_x,
                           (y + map.height_px / 2.0) * trial.step_y);
  };
  const Trial* found = nullptr;
  cv::Point at;
  for (const Trial& trial : trials) {
    double high = 0;
    cv::Point place;
    cv::minMaxLoc(trial.correlation, nullptr, &high, nullptr, &place);
    if (found != nullptr && high <= best.correlation) continue;
    found = &trial;
    best.correlation = high;
    at = place;
  }
  if (found == nullptr || !(best.correlation > 0)) return best;
  best.corner_px = {at.x * found->step_x, at.y * found->step_y};
  best.size_px = {map.width_px * found->step_x, map.height_px * found->step_y};
  double next = 0;
  for (const Trial& trial : trials) {
    const bool is_other_size =
        std::abs(trial.step_x / found->step_x - 1) * map.width_px > 2 * kApart;
    for (int y = 0; y < trial.correlation.rows; ++y) {
      for (int x = 0; x < trial.correlation.cols; ++x) {
        const Eigen::Vector2d off = middle(trial, x, y) - middle(*found, at.x, at.y);
        if (!is_other_size && off.norm() <= kApart * found->step_x) continue;
        next = std::max(next, static_cast<double>(trial.correlation.at<float>(y, x)));
      }
    }
  }
  // The smoothing makes 4 pi sigma^2 samples one; Fisher's transform has the error 1/sqrt(n - 3).
  const double independent =
      map.width_px * static_cast<double>(map.height_px) / (4 * kPi * kEdgeSigma * kEdgeSigma);
  constexpr double kMaximum = 0.999999;
  best.sigma =
      (std::atanh(std::min(best.correlation, kMaximum)) - std::atanh(std::min(next, kMaximum))) *
      std::sqrt(std::max(independent - 3, 0.0) / 2);
  return best;
}

}  // namespace thicklens::estimator

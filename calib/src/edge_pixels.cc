#include "edge_pixels.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace thicklens::calib {

Gradient CentralGradient(const cv::Mat& grey) {
  Gradient gradient;
  gradient.x = cv::Mat::zeros(grey.size(), CV_32F);
  gradient.y = cv::Mat::zeros(grey.size(), CV_32F);
  for (int y = 1; y + 1 < grey.rows; ++y) {
    const auto* above = grey.ptr<float>(y - 1);
    const auto* here = grey.ptr<float>(y);
    const auto* below = grey.ptr<float>(y + 1);
    auto* gx = gradient.x.ptr<float>(y);
    auto* gy = gradient.y.ptr<float>(y);
    for (int x = 1; x + 1 < grey.cols; ++x) {
      gx[x] = 0.5F * (here[x + 1] - here[x - 1]);
      gy[x] = 0.5F * (below[x] - above[x]);
    }
  }
  cv::magnitude(gradient.x, gradient.y, gradient.magnitude);
  return gradient;
}

std::vector<cv::Point> EdgePixels(const Gradient& gradient, double threshold, int margin_px) {
  std::vector<cv::Point> edges;
  const cv::Mat& m = gradient.magnitude;
  const int margin = std::max(margin_px, 2);
  for (int y = margin; y < m.rows - margin; ++y) {
    for (int x = margin; x < m.cols - margin; ++x) {
      const float here = m.at<float>(y, x);
      if (!(here > threshold)) continue;
      const float gx = gradient.x.at<float>(y, x);
      const float gy = gradient.y.at<float>(y, x);
      // The two neighbours along the gradient, interpolated between the grid points around them.
      const float ax = std::abs(gx);
      const float ay = std::abs(gy);
      const int sx = gx >= 0 ? 1 : -1;
      const int sy = gy >= 0 ? 1 : -1;
      float ahead = 0, behind = 0;
      if (ax >= ay) {
        const float t = ay / ax;
        ahead = (1 - t) * m.at<float>(y, x + sx) + t * m.at<float>(y + sy, x + sx);
        behind = (1 - t) * m.at<float>(y, x - sx) + t * m.at<float>(y - sy, x - sx);
      } else {
        const float t = ax / ay;
        ahead = (1 - t) * m.at<float>(y + sy, x) + t * m.at<float>(y + sy, x + sx);
        behind = (1 - t) * m.at<float>(y - sy, x) + t * m.at<float>(y - sy, x - sx);
      }
      // >= on one side only, so that a crest of two equal pixels counts once.
      if (here > ahead && here >= behind) edges.emplace_back(x, y);
    }
  }
  return edges;
}

double Quantile(const cv::Mat& values, double fraction) {
  std::vector<float> sorted;
  sorted.reserve(values.total());
  for (int y = 0; y < values.rows; ++y) {
    sorted.insert(sorted.end(), values.ptr<float>(y), values.ptr<float>(y) + values.cols);
  }
  if (sorted.empty()) return 0;
  const auto rank = static_cast<std::ptrdiff_t>(fraction * static_cast<double>(sorted.size() - 1));
  std::nth_element(sorted.begin(), sorted.begin() + rank, sorted.end());
  return sorted[static_cast<std::size_t>(rank)];
}

double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

cv::Mat Smoothed(const cv::Mat& grey, double sigma_px) {
  cv::Mat smoothed;
  const int radius = static_cast<int>(std::ceil(5 * sigma_px));
  cv::GaussianBlur(grey, smoothed, cv::Size(2 * radius + 1, 2 * radius + 1), sigma_px, sigma_px,
                   cv::BORDER_REFLECT_101);
  return smoothed;
}

}  // namespace thicklens::calib

#ifndef THICKLENS_TESTS_CALIB_DRAWN_EDGES_H_
#define THICKLENS_TESTS_CALIB_DRAWN_EDGES_H_

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <random>

namespace thicklens::testing {

// A straight edge through the middle of the frame, blurred by a Gaussian of `sigma_px` and
// integrated by square pixels: Phi(distance/sigma) averaged over each pixel by 5 x 5 Gauss-Legendre
// points. The angle between its normal and the x axis is `angle_deg`. This oracle is independent of
// the simulator.
inline cv::Mat DrawnEdge(int size_px, double angle_deg, double sigma_px, double dark,
                         double bright) {
  constexpr std::array<double, 5> kNode = {-0.4530899229693320, -0.2692346550528415, 0,
                                           0.2692346550528415, 0.4530899229693320};
  constexpr std::array<double, 5> kWeight = {0.1184634425280945, 0.2393143352496832,
                                             0.2844444444444444, 0.2393143352496832,
                                             0.1184634425280945};
  const double nx = std::cos(angle_deg * CV_PI / 180), ny = std::sin(angle_deg * CV_PI / 180);
  const double middle = 0.5 * (size_px - 1);
  cv::Mat edge(size_px, size_px, CV_32F);
  for (int y = 0; y < size_px; ++y) {
    for (int x = 0; x < size_px; ++x) {
      const double distance_px = (x - middle) * nx + (y - middle) * ny;
      double covered = distance_px > 0 ? 1 : 0;
      if (std::abs(distance_px) < 6 * sigma_px + 1) {
        covered = 0;
        for (std::size_t i = 0; i < kNode.size(); ++i) {
          for (std::size_t j = 0; j < kNode.size(); ++j) {
            const double d = distance_px + kNode[i] * nx + kNode[j] * ny;
            covered += kWeight[i] * kWeight[j] * 0.5 * std::erfc(-d / (std::sqrt(2) * sigma_px));
          }
        }
      }
      edge.at<float>(y, x) = static_cast<float>(dark + (bright - dark) * covered);
    }
  }
  return edge;
}

// Stores the image as a camera with `levels` grey values does, with Gaussian noise of
// `noise_levels` of them. The result is in [0, 1].
inline cv::Mat Stored(const cv::Mat& grey, double noise_levels, int levels, unsigned seed) {
  const double full_scale = levels - 1.0;
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, noise_levels > 0 ? noise_levels : 1);
  cv::Mat stored(grey.size(), CV_32F);
  for (int y = 0; y < grey.rows; ++y) {
    for (int x = 0; x < grey.cols; ++x) {
      const double value =
          grey.at<float>(y, x) * full_scale + (noise_levels > 0 ? noise(random) : 0.0);
      stored.at<float>(y, x) =
          static_cast<float>(std::clamp(std::round(value), 0.0, full_scale) / full_scale);
    }
  }
  return stored;
}

// Stores the image as 8-bit values.
inline cv::Mat EncodedBytes(const cv::Mat& grey, double noise_levels, unsigned seed) {
  cv::Mat bytes;
  Stored(grey, noise_levels, 256, seed).convertTo(bytes, CV_8U, 255);
  return bytes;
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_CALIB_DRAWN_EDGES_H_

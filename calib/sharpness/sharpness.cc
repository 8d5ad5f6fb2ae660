#include "calib/sharpness/sharpness.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "calib/sharpness/edge_pixels.h"

namespace thicklens::calib {
namespace {

struct Extremum {
  double distance_px = 0;
  double value = 0;
};

// The grey along a straight line from a pixel, in unit steps.
class Ray {
 public:
  Ray(const cv::Mat& image, cv::Point start, double dx, double dy)
      : image_(image),
        origin_(image.ptr<float>(start.y) + start.x),
        stride_(static_cast<int>(image.step1())),
        start_(start),
        dx_(dx),
        dy_(dy) {}

  bool IsInside(int step) const {
    const double x = start_.x + step * dx_;
    const double y = start_.y + step * dy_;
    return x >= 0 && y >= 0 && x < image_.cols - 1 && y < image_.rows - 1;
  }

  // Computes the values of `count` steps in a row, all inside the image, interpolated between the
  // four pixels around each. The loops over the steps become vector operations.
  template <std::size_t count>
  void Values(int first_step, float* values) const {
    std::array<float, count> fx{}, fy{};
    std::array<int, count> index{};
    for (std::size_t k = 0; k < count; ++k) {
      const int step = first_step + static_cast<int>(k);
      const double x = step * dx_, y = step * dy_;
      const int x0 = RoundedDown(x), y0 = RoundedDown(y);
      fx[k] = static_cast<float>(x - x0);
      fy[k] = static_cast<float>(y - y0);
      index[k] = y0 * stride_ + x0;
    }
    std::array<float, count> upper{}, upper_right{}, lower{}, lower_right{};
    for (std::size_t k = 0; k < count; ++k) {
      const float* at = origin_ + index[k];
      upper[k] = at[0];
      upper_right[k] = at[1];
      lower[k] = at[stride_];
      lower_right[k] = at[stride_ + 1];
    }
    for (std::size_t k = 0; k < count; ++k) {
      const float above = (1 - fx[k]) * upper[k] + fx[k] * upper_right[k];
      const float below = (1 - fx[k]) * lower[k] + fx[k] * lower_right[k];
      values[k] = (1 - fy[k]) * above + fy[k] * below;
    }
  }

 private:
  static int RoundedDown(double x) {
    const int cut = static_cast<int>(x);
    return cut - static_cast<int>(x < cut);
  }

  const cv::Mat& image_;
  const float* origin_;
  int stride_;
  cv::Point start_;
  double dx_, dy_;
};

// Walks from an edge pixel while the grey rises (sign +1) or falls (-1). On a texture every walk
// ends after a few steps. A wrong branch prediction costs more than the values of some unused
// pixels, so steps are computed in groups where the frame has room for them.
Extremum Walk(const Ray& ray, float start, float sign, int max_px) {
  constexpr int kGroup = 4;
  int step = 0;
  float value = start;
  std::array<float, kGroup + 1> values{};
  for (; step + kGroup <= max_px && ray.IsInside(step + kGroup); step += kGroup) {
    values[0] = value;
    ray.Values<kGroup>(step + 1, &values[1]);
    int taken = 0, goes_on = 1;
    for (std::size_t k = 0; k < kGroup; ++k) {
      goes_on &= static_cast<int>(sign * (values[k + 1] - values[k]) > 0);
      taken += goes_on;
    }
    value = values[static_cast<std::size_t>(taken)];
    if (taken < kGroup) return {static_cast<double>(step + taken), value};
  }
  for (; step < max_px && ray.IsInside(step + 1); ++step) {
    float next = 0;
    ray.Values<1>(step + 1, &next);
    if (!(sign * (next - value) > 0)) break;
    value = next;
  }
  return {static_cast<double>(step), value};
}

}  // namespace

std::vector<SharpnessIndex> MeanEdgeSlopes(const cv::Mat& grey, const SharpnessOptions& options,
                                           const std::vector<double>& thresholds) {
  const cv::Mat smoothed = Smoothed(grey, options.smoothing_sigma_px);
  const cv::Mat magnitudes = GradientMagnitude(smoothed);
  std::vector<SharpnessIndex> indices(thresholds.size());
  if (thresholds.empty()) return indices;
  const double lowest = *std::min_element(thresholds.begin(), thresholds.end());
  for (const cv::Point& edge : EdgePixels(smoothed, magnitudes, lowest, 2)) {
    const double magnitude = magnitudes.at<float>(edge);
    const cv::Point2f gradient = GradientAt(smoothed, edge);
    const double dx = gradient.x / magnitude, dy = gradient.y / magnitude;
    const float here = smoothed.at<float>(edge);
    const Extremum up = Walk(Ray(smoothed, edge, dx, dy), here, 1, options.max_search_px);
    const Extremum down = Walk(Ray(smoothed, edge, -dx, -dy), here, -1, options.max_search_px);
    const double distance_px = up.distance_px + down.distance_px;
    if (!(distance_px > 0)) continue;
    const double slope = std::abs(up.value - down.value) / distance_px;
    for (std::size_t i = 0; i < thresholds.size(); ++i) {
      if (!(magnitude > thresholds[i])) continue;
      indices[i].mean_edge_slope += slope;
      ++indices[i].edge_count;
    }
  }
  for (SharpnessIndex& index : indices) {
    if (index.edge_count > 0) index.mean_edge_slope /= index.edge_count;
  }
  return indices;
}

SharpnessIndex MeanEdgeSlope(const cv::Mat& grey, const SharpnessOptions& options) {
  return MeanEdgeSlopes(grey, options, {options.edge_threshold}).front();
}

}  // namespace thicklens::calib

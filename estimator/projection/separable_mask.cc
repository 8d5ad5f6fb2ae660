#include "estimator/projection/separable_mask.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "estimator/views/surface_taps.h"
#include "thicklens/base/cancel.h"

namespace thicklens::estimator {
namespace {

// A ray reads pixels up to this far beside its source.
constexpr int kTapsPx = 2;

// Applies filter(from, to, size) to rectangles of that reach around each pixel, for filters that
// are separable into rows and columns. It works in strips because one call for a whole image may
// take long.
template <typename Filter>
cv::Mat InStrips(const cv::Mat& values, const cv::Size& reach_px, const Filter& filter) {
  constexpr int kStripPx = 64;
  cv::Mat along_rows(values.size(), values.type()), both(values.size(), values.type());
  for (int y = 0; y < values.rows; y += kStripPx) {
    ThrowIfCancelled();
    const cv::Range strip(y, std::min(y + kStripPx, values.rows));
    filter(values.rowRange(strip), along_rows.rowRange(strip), cv::Size(2 * reach_px.width + 1, 1));
  }
  for (int x = 0; x < values.cols; x += kStripPx) {
    ThrowIfCancelled();
    const cv::Range strip(x, std::min(x + kStripPx, values.cols));
    filter(along_rows.colRange(strip), both.colRange(strip), cv::Size(1, 2 * reach_px.height + 1));
  }
  return both;
}

// Returns the maximum within a reach of each pixel.
cv::Mat MostAround(const cv::Mat& values, const cv::Size& reach_px) {
  return InStrips(values, reach_px, [](const cv::Mat& from, cv::Mat to, const cv::Size& size) {
    cv::dilate(from, to, cv::getStructuringElement(cv::MORPH_RECT, size));
  });
}

// Returns the differences to the next pixel; 0 for the last.
cv::Mat StepsTo(const cv::Mat& values, int right, int down) {
  cv::Mat steps = cv::Mat::zeros(values.size(), CV_32F);
  const cv::Rect from(0, 0, values.cols - right, values.rows - down);
  const cv::Rect to(right, down, from.width, from.height);
  if (!from.empty()) cv::absdiff(values(from), values(to), steps(from));
  return steps;
}

std::vector<unsigned char> Flags(const cv::Mat& mask) { return {mask.datastart, mask.dataend}; }

}  // namespace

SeparableMask FindSeparablePixels(const DisparityMap& disparity, int u_count, int v_count,
                                  double tolerance_px) {
  const int width_px = disparity.width_px, height_px = disparity.height_px;
  const double across = (u_count - 1) / 2.0 * std::abs(disparity.step.x());
  const double down = (v_count - 1) / 2.0 * std::abs(disparity.step.y());
  const double beside_middle = v_count % 2 == 0 ? std::abs(disparity.step.y()) / 2 : 0;
  const cv::Mat map(height_px, width_px, CV_32F, const_cast<float*>(disparity.disparity.data()));
  const cv::Mat size = cv::abs(map);
  double largest = 0;
  cv::minMaxLoc(size, nullptr, &largest);

  cv::Mat is_product = cv::Mat::zeros(height_px, width_px, CV_8U);
  const double reach_x = std::ceil(across * largest) + kTapsPx;
  const double reach_y = std::ceil((down + beside_middle) * largest) + kTapsPx;
  if (!(2 * reach_x < width_px && 2 * reach_y < height_px)) {
    return {Flags(is_product), Flags(is_product)};
  }
  const cv::Size reach_px(static_cast<int>(reach_x), static_cast<int>(reach_y));
  const cv::Mat most = MostAround(size, reach_px);
  const cv::Mat step_x = MostAround(StepsTo(map, 1, 0), reach_px);
  const cv::Mat step_y = MostAround(StepsTo(map, 0, 1), reach_px);
  const double same_surface = SurfaceTolerance(disparity);
  for (int y = reach_px.height; y < height_px - reach_px.height; ++y) {
    ThrowIfCancelled();
    for (int x = reach_px.width; x < width_px - reach_px.width; ++x) {
      const double g = step_x.at<float>(y, x), h = step_y.at<float>(y, x);
      const double d = most.at<float>(y, x);
      const double e = across * g * d / (1 - down * h);
      const double f = h * (1 + down * e + beside_middle * d) / (1 - across * g);
      // The pixels that are read are less than three pixels from the pixel that they are compared
      // with.
      is_product.at<unsigned char>(y, x) = across * g + down * h < 0.5 &&
                                           down * e <= tolerance_px && across * f <= tolerance_px &&
                                           3 * (g + h) <= same_surface;
    }
  }
  const cv::Mat is_visible =
      InStrips(is_product, reach_px, [](const cv::Mat& from, cv::Mat to, const cv::Size& box) {
        cv::erode(from, to, cv::getStructuringElement(cv::MORPH_RECT, box));
      });
  return {Flags(is_product), Flags(is_visible)};
}

}  // namespace thicklens::estimator

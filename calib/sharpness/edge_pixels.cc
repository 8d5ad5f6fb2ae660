#include "calib/sharpness/edge_pixels.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <opencv2/imgproc.hpp>

#include "thicklens/base/cancel.h"

namespace thicklens::calib {
namespace {

constexpr int kLeadingBits = 14;

// The leading bits of a number, in the order of the numbers: those of a negative one are inverted.
std::size_t LeadingBits(float value) {
  std::uint32_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  const std::uint32_t flip = (bits >> 31) != 0 ? 0xFFFFFFFFU : 0x80000000U;
  return (bits ^ flip) >> (32 - kLeadingBits);
}

}  // namespace

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

cv::Mat GradientMagnitude(const cv::Mat& grey) {
  cv::Mat magnitude(grey.size(), CV_32F);
  std::vector<float> gx(static_cast<std::size_t>(grey.cols)), gy(gx.size());
  for (int y = 0; y < grey.rows; ++y) {
    cv::Mat row = magnitude.row(y);
    if (y == 0 || y + 1 == grey.rows || grey.cols < 3) {
      row.setTo(0);
      continue;
    }
    const auto* above = grey.ptr<float>(y - 1);
    const auto* here = grey.ptr<float>(y);
    const auto* below = grey.ptr<float>(y + 1);
    for (std::size_t x = 1; x + 1 < gx.size(); ++x) {
      gx[x] = 0.5F * (here[x + 1] - here[x - 1]);
      gy[x] = 0.5F * (below[x] - above[x]);
    }
    cv::magnitude(cv::Mat(1, grey.cols, CV_32F, gx.data()),
                  cv::Mat(1, grey.cols, CV_32F, gy.data()), row);
  }
  return magnitude;
}

cv::Point2f GradientAt(const cv::Mat& grey, cv::Point pixel) {
  const auto* here = grey.ptr<float>(pixel.y) + pixel.x;
  return {0.5F * (here[1] - here[-1]),
          0.5F * (grey.ptr<float>(pixel.y + 1)[pixel.x] - grey.ptr<float>(pixel.y - 1)[pixel.x])};
}

std::vector<cv::Point> EdgePixels(const cv::Mat& grey, const cv::Mat& magnitude, double threshold,
                                  int margin_px) {
  std::vector<cv::Point> edges;
  const cv::Mat& m = magnitude;
  const int margin = std::max(margin_px, 2);
  const auto least = static_cast<float>(threshold);
  // On a texture no branch is predictable, so the neighbours are chosen without branches.
  for (int y = margin; y < m.rows - margin; ++y) {
    ThrowIfCancelled();
    const auto* above = m.ptr<float>(y - 1);
    const auto* here = m.ptr<float>(y);
    const auto* below = m.ptr<float>(y + 1);
    for (int x = margin; x < m.cols - margin; ++x) {
      if (!(here[x] > least)) continue;
      const cv::Point2f gradient = GradientAt(grey, {x, y});
      // The two neighbours along the gradient, interpolated between the grid points around them.
      const float ax = std::abs(gradient.x);
      const float ay = std::abs(gradient.y);
      const int sx = gradient.x >= 0 ? 1 : -1;
      const auto* row_ahead = gradient.y >= 0 ? below : above;
      const auto* row_behind = gradient.y >= 0 ? above : below;
      const bool along_x = ax >= ay;
      const float t = (along_x ? ay : ax) / (along_x ? ax : ay);
      const float straight_ahead = along_x ? here[x + sx] : row_ahead[x];
      const float straight_behind = along_x ? here[x - sx] : row_behind[x];
      const float ahead = (1 - t) * straight_ahead + t * row_ahead[x + sx];
      const float behind = (1 - t) * straight_behind + t * row_behind[x - sx];
      // The comparison is >= on one side only, so that a crest of two equal pixels counts once.
      const bool is_crest = static_cast<int>(here[x] > ahead) & static_cast<int>(here[x] >= behind);
      if (is_crest) edges.emplace_back(x, y);
    }
  }
  return edges;
}

double Quantile(const cv::Mat& values, double fraction) {
  if (values.empty()) return 0;
  const auto count = static_cast<std::ptrdiff_t>(values.total());
  const auto rank = static_cast<std::ptrdiff_t>(fraction * static_cast<double>(count - 1));
  const auto nth = [](std::vector<float>* of, std::ptrdiff_t n) {
    std::nth_element(of->begin(), of->begin() + n, of->end());
    return static_cast<double>((*of)[static_cast<std::size_t>(n)]);
  };
  // A high quantile needs only the values at the top. A sample gives an estimate of where they
  // begin. The estimate is discarded if it leaves too few of them, for example where one value
  // fills the matrix.
  std::vector<float> sorted;
  if (fraction > 0.9 && count > 4096) {
    for (int y = 0; y < values.rows; y += 4) {
      const auto* row = values.ptr<float>(y);
      for (int x = y / 4 % 8; x < values.cols; x += 8) sorted.push_back(row[x]);
    }
    const auto last = static_cast<double>(sorted.size() - 1);
    const double guess = nth(&sorted, static_cast<std::ptrdiff_t>((2 * fraction - 1) * last));
    sorted.clear();
    for (int y = 0; y < values.rows; ++y) {
      ThrowIfCancelled();
      const auto* row = values.ptr<float>(y);
      for (int x = 0; x < values.cols; ++x) {
        if (row[x] > guess) sorted.push_back(row[x]);
      }
    }
    const std::ptrdiff_t left_out = count - static_cast<std::ptrdiff_t>(sorted.size());
    if (rank >= left_out) return nth(&sorted, rank - left_out);
    sorted.clear();
  }
  // Only the values that share their leading bits with the one that is sought are sorted.
  std::vector<std::ptrdiff_t> counts(std::size_t{1} << kLeadingBits, 0);
  for (int y = 0; y < values.rows; ++y) {
    ThrowIfCancelled();
    const auto* row = values.ptr<float>(y);
    for (int x = 0; x < values.cols; ++x) ++counts[LeadingBits(row[x])];
  }
  std::size_t group = 0;
  std::ptrdiff_t below = 0;
  while (below + counts[group] <= rank) below += counts[group++];
  sorted.reserve(static_cast<std::size_t>(counts[group]));
  for (int y = 0; y < values.rows; ++y) {
    ThrowIfCancelled();
    const auto* row = values.ptr<float>(y);
    for (int x = 0; x < values.cols; ++x) {
      if (LeadingBits(row[x]) == group) sorted.push_back(row[x]);
    }
  }
  return nth(&sorted, rank - below);
}

cv::Mat Smoothed(const cv::Mat& grey, double sigma_px) {
  cv::Mat smoothed;
  const int radius = static_cast<int>(std::ceil(5 * sigma_px));
  cv::GaussianBlur(grey, smoothed, cv::Size(2 * radius + 1, 2 * radius + 1), sigma_px, sigma_px,
                   cv::BORDER_REFLECT_101);
  return smoothed;
}

}  // namespace thicklens::calib

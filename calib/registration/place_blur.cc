#include "calib/registration/place_blur.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "thicklens/base/cancel.h"

namespace thicklens::calib {
namespace {

// Between two levels of the variance the blur is a mixture of both. Its transfer function is wrong
// by at most 0.07 times the square of the relative distance of the levels.
constexpr double kLevelRatio = 0.25, kLevelStepPx2 = 0.2;
constexpr double kNoBlurPx2 = 1e-3;

// The image with Gaussians of the given levels, each applied to the light of the places that have
// it. `light` has the light of every place, and `variance` its level (CV_32F).
cv::Mat SpreadByLevels(const cv::Mat& light, const cv::Mat& variance,
                       const std::vector<double>& levels) {
  cv::Mat sum = cv::Mat::zeros(light.size(), CV_32F);
  for (std::size_t k = 0; k < levels.size(); ++k) {
    ThrowIfCancelled();
    const bool has_lower = k > 0, has_higher = k + 1 < levels.size();
    const double lower = has_lower ? levels[k - 1] : 0, higher = has_higher ? levels[k + 1] : 0;
    cv::Mat part(light.size(), CV_32F);
    for (int y = 0; y < light.rows; ++y) {
      const float* v = variance.ptr<float>(y);
      const float* from = light.ptr<float>(y);
      float* to = part.ptr<float>(y);
      for (int x = 0; x < light.cols; ++x) {
        const auto at = static_cast<double>(v[x]);
        double weight = 1;
        if (at < levels[k] && has_lower)
          weight = std::max(0.0, (at - lower) / (levels[k] - lower));
        else if (at > levels[k] && has_higher)
          weight = std::max(0.0, (higher - at) / (higher - levels[k]));
        to[x] = static_cast<float>(weight) * from[x];
      }
    }
    const double sigma_px = std::sqrt(levels[k]);
    if (levels[k] > kNoBlurPx2)
      cv::GaussianBlur(part, part, cv::Size(), sigma_px, sigma_px, cv::BORDER_REPLICATE);
    sum += part;
  }
  return sum;
}

cv::Mat SecondDerivative(const cv::Mat& image, bool along_x, bool along_y) {
  const cv::Mat straight = (cv::Mat_<float>(1, 3) << 1, -2, 1);
  const cv::Mat slope = (cv::Mat_<float>(1, 3) << -0.5F, 0, 0.5F);
  const cv::Mat none = cv::Mat::ones(1, 1, CV_32F);
  cv::Mat result;
  if (along_x && along_y)
    cv::sepFilter2D(image, result, CV_32F, slope, slope, {-1, -1}, 0, cv::BORDER_REPLICATE);
  else
    cv::sepFilter2D(image, result, CV_32F, along_x ? straight : none, along_x ? none : straight,
                    {-1, -1}, 0, cv::BORDER_REPLICATE);
  return result;
}

}  // namespace

double PlaceBlur::Least(cv::Size size) const {
  const Eigen::Vector2d last(size.width - 1, size.height - 1);
  const Eigen::Vector2d farthest = centre_px.cwiseAbs().cwiseMax((last - centre_px).cwiseAbs());
  const double slope = curvature - std::abs(astigmatism);
  return at_centre_px2 + std::min(0.0, slope * farthest.squaredNorm());
}

// A Gaussian of the variance matrix v I + Q is, to first order in the traceless Q, (1 + sum of
// Q_ij/2 d_i d_j) times the Gaussian of the variance v. The derivatives act on what has been
// spread, because Q belongs to the place that the light comes from. Derived here [D175].
cv::Mat SpreadByPlace(const cv::Mat& image, const PlaceBlur& blur) {
  cv::Mat variance(image.size(), CV_32F);
  double least = HUGE_VAL, most = 0;
  for (int y = 0; y < image.rows; ++y) {
    float* row = variance.ptr<float>(y);
    for (int x = 0; x < image.cols; ++x) {
      const double r2 = (Eigen::Vector2d(x, y) - blur.centre_px).squaredNorm();
      const double at = std::max(0.0, blur.at_centre_px2 + blur.curvature * r2);
      least = std::min(least, at);
      most = std::max(most, at);
      row[x] = static_cast<float>(at);
    }
  }
  std::vector<double> levels = {least};
  while (levels.back() < most)
    levels.push_back(
        std::min(most, levels.back() + std::max(kLevelStepPx2, kLevelRatio * levels.back())));
  cv::Mat result = SpreadByLevels(image, variance, levels);
  if (blur.astigmatism == 0) return result;
  // Half of Q_xx = -Q_yy, and Q_xy.
  cv::Mat along_axes(image.size(), CV_32F), mixed(image.size(), CV_32F);
  for (int y = 0; y < image.rows; ++y) {
    const float* from = image.ptr<float>(y);
    for (int x = 0; x < image.cols; ++x) {
      const Eigen::Vector2d q = Eigen::Vector2d(x, y) - blur.centre_px;
      const double half = 0.5 * blur.astigmatism * (q.x() * q.x() - q.y() * q.y());
      along_axes.at<float>(y, x) = static_cast<float>(half) * from[x];
      mixed.at<float>(y, x) = static_cast<float>(2 * blur.astigmatism * q.x() * q.y()) * from[x];
    }
  }
  along_axes = SpreadByLevels(along_axes, variance, levels);
  mixed = SpreadByLevels(mixed, variance, levels);
  result += SecondDerivative(along_axes, true, false) - SecondDerivative(along_axes, false, true) +
            SecondDerivative(mixed, true, true);
  return result;
}

}  // namespace thicklens::calib

#include "calib/registration/axis_contrast.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "thicklens/base/cancel.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinFramesOfContrast = 7;
constexpr double kDoubtlessChange = 5;  // standard deviations
constexpr double kVisibleChange = 0.1;
constexpr double kSmoothingPx = 1;  // so that noise does not hide the change

// ln of the mean square of the slopes along x over that along y.
double AxisContrast(const cv::Mat& grey) {
  cv::Mat smooth, along_x, along_y;
  cv::GaussianBlur(grey, smooth, {}, kSmoothingPx);
  cv::Sobel(smooth, along_x, CV_32F, 1, 0);
  cv::Sobel(smooth, along_y, CV_32F, 0, 1);
  return std::log((along_x.dot(along_x) + 1e-30) / (along_y.dot(along_y) + 1e-30));
}

}  // namespace

std::optional<model::Estimate> ChangeOfAxisContrast(
    const std::vector<ScaleSample>& samples, const std::function<cv::Mat(std::size_t)>& read_grey) {
  if (samples.size() < kMinFramesOfContrast) return std::nullopt;
  double low_mm = samples.front().reading_mm, high_mm = low_mm, sharpest_mm = low_mm;
  for (const ScaleSample& sample : samples) {
    low_mm = std::min(low_mm, sample.reading_mm);
    high_mm = std::max(high_mm, sample.reading_mm);
    if (sample.scale == 1) sharpest_mm = sample.reading_mm;
  }
  if (!(high_mm > low_mm)) return std::nullopt;
  // The even part is that of an isotropic blur on an uneven texture.
  const auto n = static_cast<Eigen::Index>(samples.size());
  Eigen::MatrixXd design(n, 4);
  Eigen::VectorXd values(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    ThrowIfCancelled();
    const ScaleSample& sample = samples[static_cast<std::size_t>(i)];
    const double x = (sample.reading_mm - sharpest_mm) / (high_mm - low_mm);
    design.row(i) << 1, x, x * x, x * x * x * x;
    values[i] = AxisContrast(read_grey(sample.frame));
  }
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> solver(design);
  if (solver.rank() < design.cols()) return std::nullopt;
  const Eigen::VectorXd line = solver.solve(values);
  const double variance =
      (values - design * line).squaredNorm() / static_cast<double>(n - design.cols());
  const Eigen::MatrixXd inverse = (design.transpose() * design).inverse();
  return model::Estimate{line[1], std::sqrt(std::max(0.0, variance * inverse(1, 1)))};
}

bool ShowsAstigmatism(const std::optional<model::Estimate>& change) {
  return change &&
         std::abs(change->value) > std::max(kVisibleChange, kDoubtlessChange * change->sigma);
}

}  // namespace thicklens::calib

#include "estimator/scene/guided_shading.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <opencv2/imgproc.hpp>

#include "thicklens/base/cancel.h"
#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"

namespace thicklens::estimator {
namespace {

// These values were chosen on one rendered scene and are confirmed by others (tests).
constexpr double kSteepest = 0.15;  // px per view step and px: a larger slope is a jump
constexpr double kShallow = 0.02;
constexpr double kSlopeSmoothingPx = 0.5, kNormalSmoothingPx = 0.7;
constexpr int kWindowReachPx = 10;
constexpr double kFinestPx = 2;
constexpr double kRegularisation = 2.5e-4;
constexpr double kDoubt = 4;  // factor of the unexplained share

constexpr int kStripRows = 64;

template <typename Real>
constexpr int kDepthOf = cv::DataType<Real>::depth;

int ReachOf(double sigma_px) { return static_cast<int>(std::ceil(3 * sigma_px)); }

cv::Mat Blurred(const cv::Mat& from, double sigma_px) {
  const int size = 2 * ReachOf(sigma_px) + 1;
  cv::Mat to;
  cv::GaussianBlur(from, to, {size, size}, sigma_px, sigma_px, cv::BORDER_REPLICATE);
  return to;
}

// The slopes at a pixel; at the border the slope is the difference to the only neighbour.
struct Slope {
  float x = 0, y = 0;
  bool is_jump = false;
};
class Slopes {
 public:
  explicit Slopes(const DisparityMap& map)
      : map_(map), step_(static_cast<float>(map.step.cwiseAbs().maxCoeff())) {}

  Slope At(int x, int y) const {
    Slope slope;
    const bool jumps_x = Along(x, map_.width_px, Pixel(x, y), 1, &slope.x);
    const bool jumps_y = Along(y, map_.height_px, Pixel(x, y), Index(map_.width_px), &slope.y);
    slope.is_jump = jumps_x || jumps_y;
    return slope;
  }

 private:
  std::size_t Pixel(int x, int y) const { return Index(y) * Index(map_.width_px) + Index(x); }

  bool Along(int at, int count, std::size_t pixel, std::size_t stride, float* slope) const {
    const auto difference = [&](std::size_t from) {
      return step_ * (map_.disparity[from + stride] - map_.disparity[from]);
    };
    if (count == 1) return false;
    const float before = difference(at > 0 ? pixel - stride : pixel);
    const float after = difference(at + 1 < count ? pixel : pixel - stride);
    constexpr auto kMax = static_cast<float>(kSteepest);
    *slope = std::clamp(std::abs(after) < std::abs(before) ? after : before, -kMax, kMax);
    return std::max(std::abs(before), std::abs(after)) > kMax;
  }

  const DisparityMap& map_;
  const float step_;
};

// Means over windows of the smooth pixels of a strip.
class WindowMeans {
 public:
  explicit WindowMeans(const cv::Mat& is_smooth) : is_smooth_(is_smooth) {
    around_ = Box(is_smooth) + kNone;
    near_ = Blurred(is_smooth, kFinestPx) + kNone;
  }

  cv::Mat Of(const cv::Mat& values) const {
    cv::Mat mean = Box(values.mul(is_smooth_));
    cv::divide(mean, around_, mean);
    return mean;
  }
  cv::Mat Covariance(const cv::Mat& a, const cv::Mat& b) const {
    return Of(a.mul(b)) - Of(a).mul(Of(b));
  }
  // Removes all detail that is coarser than the finest.
  cv::Mat Finest(const cv::Mat& values) const {
    cv::Mat coarse = Blurred(values.mul(is_smooth_), kFinestPx);
    cv::divide(coarse, near_, coarse);
    return values - coarse;
  }

  static constexpr int ReachPx() { return 2 * kWindowReachPx + static_cast<int>(3 * kFinestPx); }

 private:
  static constexpr double kNone = 1e-4;  // for a window without smooth pixels

  static cv::Mat Box(const cv::Mat& values) {
    constexpr int kSize = 2 * kWindowReachPx + 1;
    cv::Mat mean;
    cv::blur(values, mean, {kSize, kSize}, {-1, -1}, cv::BORDER_REPLICATE);
    return mean;
  }

  const cv::Mat is_smooth_;
  cv::Mat around_, near_;
};

using PerNormal = std::array<cv::Mat, kNormals>;

// Returns a of one colour after the other, for a strip.
template <typename Real>
std::vector<PerNormal> Coefficients(const WindowMeans& means, const PerNormal& estimated,
                                    const std::vector<cv::Mat>& colours) {
  PerNormal fine;
  for (std::size_t k = 0; k < kNormals; ++k) fine[k] = means.Finest(estimated[k]);
  std::array<PerNormal, kNormals> covariance;
  for (std::size_t k = 0; k < kNormals; ++k) {
    for (std::size_t l = 0; l <= k; ++l) covariance[k][l] = means.Covariance(fine[k], fine[l]);
  }
  std::vector<PerNormal> with_colour;
  std::vector<cv::Mat> variance;
  for (const cv::Mat& colour : colours) {
    const cv::Mat finest = means.Finest(colour);
    variance.push_back(means.Covariance(finest, finest));
    with_colour.emplace_back();
    for (std::size_t k = 0; k < kNormals; ++k) {
      with_colour.back()[k] = means.Covariance(fine[k], finest);
    }
  }
  const cv::Mat& first = colours.front();
  const auto at = [](const cv::Mat& plane, int y, int x) {
    return static_cast<double>(plane.at<Real>(y, x));
  };
  for (int y = 0; y < first.rows; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < first.cols; ++x) {
      Eigen::Matrix3d normal;  // the Cholesky factor reads its lower half
      for (std::size_t k = 0; k < kNormals; ++k) {
        const auto row = static_cast<Eigen::Index>(k);
        for (std::size_t l = 0; l <= k; ++l) {
          normal(row, static_cast<Eigen::Index>(l)) = at(covariance[k][l], y, x);
        }
        normal(row, row) += kRegularisation;
      }
      const auto factor = normal.selfadjointView<Eigen::Lower>().llt();
      double all = 1e-12, explained = 0;
      for (std::size_t c = 0; c < colours.size(); ++c) {
        all += std::max(0.0, at(variance[c], y, x));
        PerNormal& planes = with_colour[c];
        const Eigen::Vector3d right(at(planes[0], y, x), at(planes[1], y, x), at(planes[2], y, x));
        const Eigen::Vector3d fit = factor.solve(right);
        explained += fit.dot(right);
        for (std::size_t k = 0; k < kNormals; ++k) {
          planes[k].at<Real>(y, x) = static_cast<Real>(fit[static_cast<Eigen::Index>(k)]);
        }
      }
      explained = std::clamp(explained / all, 0.0, 1.0);
      const auto share = static_cast<Real>(explained / (explained + kDoubt * (1 - explained)));
      for (PerNormal& planes : with_colour) {
        for (cv::Mat& plane : planes) plane.at<Real>(y, x) *= share;
      }
    }
  }
  return with_colour;
}

}  // namespace

double ShadingGuideSlope(const DisparityMap& disparity) {
  const Slopes slopes(disparity);
  double sum_x = 0, sum_y = 0, squares = 0, count = 0;
  for (int y = 0; y < disparity.height_px; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < disparity.width_px; ++x) {
      const Slope slope = slopes.At(x, y);
      if (slope.is_jump) continue;
      const auto across = static_cast<double>(slope.x), down = static_cast<double>(slope.y);
      sum_x += across;
      sum_y += down;
      squares += across * across + down * down;
      ++count;
    }
  }
  if (count == 0) return 0;
  const double mean_x = sum_x / count, mean_y = sum_y / count;
  return std::sqrt(std::max(0.0, squares / count - mean_x * mean_x - mean_y * mean_y));
}

template <typename Real>
ShadingGuide<Real> ShadingGuideOf(const DisparityMap& disparity, double slope) {
  const double c = std::max(slope, kShallow);
  const int width = disparity.width_px, height = disparity.height_px;
  const std::size_t pixels = Index(width) * Index(height);
  ShadingGuide<Real> guide;
  guide.normals.resize(kNormals * pixels);
  guide.is_smooth.resize(pixels);
  cv::Mat along_x(height, width, CV_32F), along_y(height, width, CV_32F);
  const Slopes slopes(disparity);
  for (int y = 0; y < height; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < width; ++x) {
      const Slope here = slopes.At(x, y);
      along_x.at<float>(y, x) = here.x;
      along_y.at<float>(y, x) = here.y;
      guide.is_smooth[Index(y) * Index(width) + Index(x)] = here.is_jump ? 0.0F : 1.0F;
    }
  }
  along_x = Blurred(along_x, kSlopeSmoothingPx);
  along_y = Blurred(along_y, kSlopeSmoothingPx);
  cv::Mat toward = along_x.mul(along_x) + along_y.mul(along_y) + c * c;
  cv::sqrt(toward, toward);
  cv::divide(1.0, toward, toward);
  const PerNormal normals = {along_x.mul(toward), along_y.mul(toward), toward * c};
  for (std::size_t k = 0; k < kNormals; ++k) {
    cv::Mat plane(height, width, kDepthOf<Real>, guide.normals.data() + k * pixels);
    const cv::Mat smooth = Blurred(normals[k], kNormalSmoothingPx);
    smooth.convertTo(plane, plane.type(), 1, -cv::mean(smooth)[0]);
  }
  return guide;
}

template <typename Real>
GuidedShading<Real> FitShading(const ShadingGuide<Real>& guide, const std::vector<Real>& estimated,
                               const std::vector<Real>& radiance, int width_px, int height_px,
                               int threads) {
  const std::size_t pixels = Index(width_px) * Index(height_px);
  const std::size_t channels = radiance.size() / pixels;
  GuidedShading<Real> shading;
  shading.sharp.resize(radiance.size());
  shading.already.resize(radiance.size());
  const int strips = (height_px + kStripRows - 1) / kStripRows;
  ParallelFor(strips, threads, [&](int strip) {
    const int first = strip * kStripRows, last = std::min(first + kStripRows, height_px);
    const int from = std::max(0, first - WindowMeans::ReachPx());
    const int to = std::min(height_px, last + WindowMeans::ReachPx());
    const auto rows_of = [&](const auto& planes, std::size_t plane) {
      cv::Mat rows(to - from, width_px, kDepthOf<Real>);
      for (int y = from; y < to; ++y) {
        std::copy_n(planes.data() + plane * pixels + Index(y) * Index(width_px), width_px,
                    rows.ptr<Real>(y - from));
      }
      return rows;
    };
    const cv::Mat is_smooth = rows_of(guide.is_smooth, 0);
    const WindowMeans means(is_smooth);
    PerNormal normals, already;
    std::vector<cv::Mat> colours;
    for (std::size_t k = 0; k < kNormals; ++k) {
      normals[k] = rows_of(guide.normals, k);
      already[k] = rows_of(estimated, k);
    }
    for (std::size_t c = 0; c < channels; ++c) colours.push_back(rows_of(radiance, c));
    const std::vector<PerNormal> coefficients = Coefficients<Real>(means, already, colours);
    for (std::size_t k = 0; k < kNormals; ++k) {
      const cv::Mat mean = means.Of(already[k]);
      normals[k] -= mean;
      already[k] -= mean;
    }
    for (std::size_t c = 0; c < channels; ++c) {
      cv::Mat sharp = cv::Mat::zeros(to - from, width_px, kDepthOf<Real>), now = sharp.clone();
      for (std::size_t k = 0; k < kNormals; ++k) {
        const cv::Mat coefficient = means.Of(coefficients[c][k]);
        sharp += coefficient.mul(normals[k]);
        now += coefficient.mul(already[k]);
      }
      sharp = sharp.mul(is_smooth);
      now = now.mul(is_smooth);
      for (int y = first; y < last; ++y) {
        const std::size_t row = c * pixels + Index(y) * Index(width_px);
        std::copy_n(sharp.ptr<Real>(y - from), width_px, shading.sharp.data() + row);
        std::copy_n(now.ptr<Real>(y - from), width_px, shading.already.data() + row);
      }
    }
  });
  return shading;
}

#define THICKLENS_RELIEF(Real)                                                                 \
  template struct ShadingGuide<Real>;                                                          \
  template ShadingGuide<Real> ShadingGuideOf(const DisparityMap&, double);                     \
  template GuidedShading<Real> FitShading(const ShadingGuide<Real>&, const std::vector<Real>&, \
                                          const std::vector<Real>&, int, int, int);
THICKLENS_RELIEF(float)
THICKLENS_RELIEF(double)
#undef THICKLENS_RELIEF

double ShadingBytes(int width_px, int rows, int channels, int threads, double real_bytes) {
  // The sum covers the normals, as they are and as estimated, and the finest detail of the
  // estimated ones; their covariances, and those with colours, which become the coefficients; the
  // colours and their finest detail; the smooth pixels, near and around; and means in the making.
  const double planes = 3.0 * kNormals + 6 + channels * (kNormals + 2.0) + 3 + 6;
  const int strips = (rows + kStripRows - 1) / kStripRows;
  const int rows_of_strip = std::min(rows, kStripRows + 2 * WindowMeans::ReachPx());
  return std::min(threads, strips) * static_cast<double>(rows_of_strip) * width_px * planes *
         real_bytes;
}

}  // namespace thicklens::estimator

#ifndef THICKLENS_TESTS_CALIB_EDGES_DRAWN_SCENE_H_
#define THICKLENS_TESTS_CALIB_EDGES_DRAWN_SCENE_H_

#include <algorithm>
#include <cmath>
#include <functional>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace thicklens::testing {

// Any scene blurred by a Gaussian, which may differ along x and y, or by a disc. It is drawn with
// many samples per pixel and averaged over each pixel. The second moments are exact: the size of
// the samples adds as much as the average of so many samples lacks of the pixel's 1/12 px^2.
struct DrawnBlur {
  double sigma_x_px = 0, sigma_y_px = 0;  // Gaussian, not 0
  double disc_sigma_px = 0;  // sigma of a disc of twice that radius, which is applied first
};

inline cv::Mat DiscKernel(double radius) {
  constexpr int kParts = 8;
  const int half = static_cast<int>(std::ceil(radius)) + 1;
  cv::Mat kernel(2 * half + 1, 2 * half + 1, CV_32F);
  for (int y = -half; y <= half; ++y) {
    for (int x = -half; x <= half; ++x) {
      int covered = 0;
      for (int i = 0; i < kParts * kParts; ++i) {
        const double u = x + (i % kParts + 0.5) / kParts - 0.5;
        const double v = y + (i / kParts + 0.5) / kParts - 0.5;
        if (u * u + v * v < radius * radius) ++covered;
      }
      kernel.at<float>(y + half, x + half) = static_cast<float>(covered);
    }
  }
  return kernel / cv::sum(kernel)[0];
}

// `scene(x, y)` is the light at a position, px.
inline cv::Mat DrawnScene(int size_px, const DrawnBlur& blur,
                          const std::function<double(double, double)>& scene) {
  // The variance of a sampled Gaussian is accurate for a sigma of at least 3 samples.
  const double narrowest = std::min(blur.sigma_x_px, blur.sigma_y_px);
  const int samples_per_px = std::max(2, static_cast<int>(std::ceil(3 / narrowest)));
  const double widest = std::max({blur.sigma_x_px, blur.sigma_y_px, blur.disc_sigma_px});
  const int margin_px = static_cast<int>(std::ceil(5 * widest)) + 2;
  const int side = (size_px + 2 * margin_px) * samples_per_px;
  const bool has_disc = blur.disc_sigma_px > 0;
  const int parts = has_disc ? 1 : 3;  // the kernel of the disc includes the size of the samples
  cv::Mat fine(side, side, CV_32F);
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      double sum = 0;
      for (int i = 0; i < parts * parts; ++i) {
        const double u = x + (i % parts + 0.5) / parts, v = y + (i / parts + 0.5) / parts;
        sum += scene(u / samples_per_px - margin_px - 0.5, v / samples_per_px - margin_px - 0.5);
      }
      fine.at<float>(y, x) = static_cast<float>(sum / (parts * parts));
    }
  }
  if (has_disc) {
    cv::filter2D(fine.clone(), fine, CV_32F, DiscKernel(2 * blur.disc_sigma_px * samples_per_px));
  }
  const double sx = blur.sigma_x_px * samples_per_px, sy = blur.sigma_y_px * samples_per_px;
  const cv::Size size(2 * static_cast<int>(6 * sx) + 1, 2 * static_cast<int>(6 * sy) + 1);
  cv::GaussianBlur(fine.clone(), fine, size, sx, sy);
  cv::Mat frame;
  cv::resize(fine, frame, cv::Size(size_px + 2 * margin_px, size_px + 2 * margin_px), 0, 0,
             cv::INTER_AREA);
  return frame(cv::Rect(margin_px, margin_px, size_px, size_px)).clone();
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_CALIB_EDGES_DRAWN_SCENE_H_

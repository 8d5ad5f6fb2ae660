#ifndef THICKLENS_TESTS_CALIB_KNOWN_TEXTURE_H_
#define THICKLENS_TESTS_CALIB_KNOWN_TEXTURE_H_

#include <Eigen/Core>
#include <cmath>
#include <complex>
#include <functional>
#include <opencv2/core.hpp>
#include <random>
#include <vector>

namespace thicklens::testing {

// The position at which a frame shows a point of the target: p_frame = origin + shift + scale R
// (p_target - origin).
struct TextureView {
  double scale = 1, rotation_rad = 0;
  Eigen::Vector2d shift_px{0, 0};
  double contrast = 1, mean = 0.4;
};

// Transfer function of a frame's blur at |nu|, or at nu, cycles per target px.
using Transfer = std::function<double(double nu)>;
using PlaneTransfer = std::function<double(const Eigen::Vector2d& nu)>;

inline Transfer GaussianOf(double variance_px2) {
  return [variance_px2](double nu) {
    return std::exp(-2 * 9.869604401089358 * variance_px2 * nu * nu);
  };
}

// A dense texture that is known everywhere: many waves whose amplitude falls with frequency. Each
// frame is rendered in closed form with its blur and the box of its pixels, without resampling.
class KnownTexture {
 public:
  explicit KnownTexture(unsigned seed, double highest = 0.4, int count = 500) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> unit(0, 1);
    while (static_cast<int>(waves_.size()) < count) {
      const Eigen::Vector2d nu(highest * unit(random), highest * (2 * unit(random) - 1));
      const double size = nu.norm();
      if (size < 0.01 || size > highest) continue;
      waves_.push_back({nu, kTurn * unit(random), 0.0025 * (0.5 + unit(random)) / (size + 0.06)});
    }
  }

  cv::Mat Render(int width_px, int height_px, const Eigen::Vector2d& origin_px,
                 const TextureView& view, const Transfer& transfer) const {
    return RenderPlane(width_px, height_px, origin_px, view,
                       [&](const Eigen::Vector2d& nu) { return transfer(nu.norm()); });
  }
  // Makes such a texture with a blur that depends on the direction.
  cv::Mat RenderPlane(int width_px, int height_px, const Eigen::Vector2d& origin_px,
                      const TextureView& view, const PlaneTransfer& transfer) const {
    cv::Mat_<double> sum(height_px, width_px, view.mean);
    const double c = std::cos(view.rotation_rad), s = std::sin(view.rotation_rad);
    for (const Wave& wave : waves_) {
      // The frequency is in cycles per frame px.
      const Eigen::Vector2d nu(c * wave.nu.x() - s * wave.nu.y(),
                               s * wave.nu.x() + c * wave.nu.y());
      const Eigen::Vector2d in_frame = nu / view.scale;
      const double amplitude = view.mean * view.contrast * wave.amplitude * transfer(wave.nu) *
                               Sinc(in_frame.x()) * Sinc(in_frame.y());
      const std::complex<double> step = std::polar(1.0, kTurn * in_frame.x());
      const Eigen::Vector2d first = -origin_px - view.shift_px;
      for (int y = 0; y < height_px; ++y) {
        // The amplitude may be negative.
        std::complex<double> value =
            amplitude *
            std::polar(1.0, kTurn * (in_frame.x() * first.x() + in_frame.y() * (first.y() + y)) +
                                wave.phase);
        for (int x = 0; x < width_px; ++x) {
          sum(y, x) += value.real();
          value = {value.real() * step.real() - value.imag() * step.imag(),
                   value.real() * step.imag() + value.imag() * step.real()};
        }
      }
    }
    cv::Mat grey;
    sum.convertTo(grey, CV_32F);
    return grey;
  }

 private:
  static constexpr double kTurn = 6.283185307179586;
  static double Sinc(double x) {
    const double angle = 0.5 * kTurn * x;
    return std::abs(angle) < 1e-9 ? 1 : std::sin(angle) / angle;
  }
  struct Wave {
    Eigen::Vector2d nu;  // cycles per target px
    double phase, amplitude;
  };
  std::vector<Wave> waves_;
};

inline cv::Mat WithWhiteNoise(const cv::Mat& grey, double sigma, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, 1);
  cv::Mat noisy = grey.clone();
  for (int y = 0; y < noisy.rows; ++y) {
    for (int x = 0; x < noisy.cols; ++x)
      noisy.at<float>(y, x) += static_cast<float>(sigma * normal(random));
  }
  return noisy;
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_CALIB_KNOWN_TEXTURE_H_

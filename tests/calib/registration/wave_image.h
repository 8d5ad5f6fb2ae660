#ifndef THICKLENS_TESTS_CALIB_REGISTRATION_WAVE_IMAGE_H_
#define THICKLENS_TESTS_CALIB_REGISTRATION_WAVE_IMAGE_H_

#include <algorithm>
#include <cmath>
#include <complex>
#include <opencv2/core.hpp>
#include <random>
#include <vector>

namespace thicklens::testing {

// Parameters of a view of an image of waves.
struct View {
  double scale = 1, rotation_rad = 0, shift_x = 0, shift_y = 0;  // about the centre of the image
  double stretch_x = 1;   // in addition to the scale, along x
  double distortion = 0;  // k of x' = X (1 + k X^2), X from the centre of the image, px^-2
  double blur_px = 0;     // sigma of a Gaussian, applied exactly, wave by wave
  double disc_px = 0;     // radius of an additional disc, applied in the same way
  double gain = 1, offset = 0;
  double slope = 0;  // relative change of the illumination per px, along x
  double noise = 0;
};

// A texture that is known everywhere: a sum of waves, so that it can be rotated, scaled, distorted
// and blurred in closed form, without resampling.
class WaveImage {
 public:
  explicit WaveImage(unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> unit(0, 1);
    for (int i = 0; i < 120; ++i) {
      const double k = 0.01 + 0.16 * unit(random) * unit(random);  // cycles per px
      const double angle = 3.14159265358979 * unit(random);
      waves_.push_back({kTurn * k * std::cos(angle), kTurn * k * std::sin(angle),
                        kTurn * unit(random), 0.02 / std::sqrt(k / 0.02)});
    }
  }

  cv::Mat Render(int size_px, const View& view, unsigned noise_seed = 1) const {
    std::mt19937 random(noise_seed);
    std::normal_distribution<double> noise(0, 1);
    const double centre = 0.5 * (size_px - 1);
    std::vector<double> amplitudes;
    for (const Wave& w : waves_) {
      const double k = std::hypot(w.x, w.y) / view.scale;  // radians per px
      const double x = k * view.disc_px;
      const double disc = x > 1e-6 ? 2 * std::cyl_bessel_j(1, x) / x : 1;
      amplitudes.push_back(w.amplitude * disc *
                           std::exp(-0.5 * k * k * view.blur_px * view.blur_px));
    }
    cv::Mat image(size_px, size_px, CV_32F);
    const double c = std::cos(view.rotation_rad), s = std::sin(view.rotation_rad);
    std::vector<double> row(static_cast<std::size_t>(size_px));
    for (int y = 0; y < size_px; ++y) {
      std::fill(row.begin(), row.end(), 0.4);
      // Positions that the pixels of the row show: the distortion is inverted by a fixed-point
      // iteration, then the map.
      std::vector<double> px, py;
      for (int x = 0; x < size_px; ++x) {
        const double dx = x - centre, dy = y - centre;
        double ux = dx, uy = dy;
        for (int i = 0; i < 8 && view.distortion != 0; ++i) {
          const double grow = 1 + view.distortion * (ux * ux + uy * uy);
          ux = dx / grow;
          uy = dy / grow;
        }
        ux -= view.shift_x;
        uy -= view.shift_y;
        px.push_back((c * ux + s * uy) / (view.scale * view.stretch_x));
        py.push_back((-s * ux + c * uy) / view.scale);
      }
      for (std::size_t i = 0; i < waves_.size(); ++i) {
        if (!(std::abs(amplitudes[i]) > 1e-7)) continue;
        const Wave& w = waves_[i];
        const auto phase = [&](std::size_t x) { return w.x * px[x] + w.y * py[x] + w.phase; };
        if (view.distortion != 0) {
          for (std::size_t x = 0; x < row.size(); ++x) row[x] += amplitudes[i] * std::cos(phase(x));
          continue;
        }
        // The steps are equal, so the phase is rotated from pixel to pixel.
        std::complex<double> wave = amplitudes[i] * std::polar(1.0, phase(0));
        const std::complex<double> step = std::polar(1.0, phase(1) - phase(0));
        for (double& value : row) {
          value += wave.real();
          wave = {wave.real() * step.real() - wave.imag() * step.imag(),
                  wave.real() * step.imag() + wave.imag() * step.real()};
        }
      }
      for (int x = 0; x < size_px; ++x) {
        double value = view.offset + view.gain * (1 + view.slope * (x - centre)) *
                                         row[static_cast<std::size_t>(x)];
        if (view.noise > 0) value += view.noise * noise(random);
        image.at<float>(y, x) = static_cast<float>(value);
      }
    }
    return image;
  }

 private:
  static constexpr double kTurn = 6.283185307179586;
  struct Wave {
    double x, y, phase, amplitude;  // x, y: radians per px
  };
  std::vector<Wave> waves_;
};

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_CALIB_REGISTRATION_WAVE_IMAGE_H_

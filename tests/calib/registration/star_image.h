#ifndef THICKLENS_TESTS_CALIB_REGISTRATION_STAR_IMAGE_H_
#define THICKLENS_TESTS_CALIB_REGISTRATION_STAR_IMAGE_H_

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <random>
#include <vector>

namespace thicklens::testing {

// Parameters of a view of a star, which looks the same at every scale.
struct StarView {
  // Rotation, and shift of the star's centre relative to that of the image.
  double rotation_rad = 0, shift_x = 0, shift_y = 0;
  double blur_px = 0.6;  // sigma of a Gaussian
  double gain = 1, offset = 0;
  double slope = 0;  // relative change of the illumination per px, along x
  double noise = 0;
};

// A star of sinusoidal spokes that is known everywhere, without resampling: a round blur keeps
// cos(spokes angle) and multiplies it by a function of the radius alone.
class StarImage {
 public:
  explicit StarImage(int spokes) : spokes_(spokes) {}

  cv::Mat Render(int size_px, const StarView& view, unsigned noise_seed = 1) const {
    const std::vector<double> contrasts = Contrasts(size_px, view.blur_px);
    std::mt19937 random(noise_seed);
    std::normal_distribution<double> noise(0, 1);
    const double centre = 0.5 * (size_px - 1);
    cv::Mat image(size_px, size_px, CV_32F);
    for (int y = 0; y < size_px; ++y) {
      for (int x = 0; x < size_px; ++x) {
        const double dx = x - centre - view.shift_x, dy = y - centre - view.shift_y;
        const double place = std::hypot(dx, dy) / kStepPx;
        const auto i = std::min(static_cast<std::size_t>(place), contrasts.size() - 2);
        const double t = place - static_cast<double>(i);
        const double contrast = (1 - t) * contrasts[i] + t * contrasts[i + 1];
        const double wave = contrast * std::cos(spokes_ * (std::atan2(dy, dx) - view.rotation_rad));
        const double light = (0.4 + 0.25 * wave) * (1 + view.slope * (x - centre));
        image.at<float>(y, x) =
            static_cast<float>(view.gain * light + view.offset + view.noise * noise(random));
      }
    }
    return image;
  }

 private:
  static constexpr double kStepPx = 0.25;

  // The mean of cos(spokes angle) about a point at angle 0 for steps of the radius, as a plain sum
  // over a Gaussian.
  std::vector<double> Contrasts(int size_px, double blur_px) const {
    constexpr int kReach = 16;
    constexpr double kSigmas = 4;
    std::vector<double> contrasts;
    for (double radius = 0; radius < size_px; radius += kStepPx) {
      double sum = 0, total = 0;
      for (int j = -kReach; j <= kReach; ++j) {
        for (int i = -kReach; i <= kReach; ++i) {
          const double u = kSigmas * i / kReach, v = kSigmas * j / kReach;
          const double weight = std::exp(-0.5 * (u * u + v * v));
          sum += weight * std::cos(spokes_ * std::atan2(blur_px * v, radius + blur_px * u));
          total += weight;
        }
      }
      contrasts.push_back(sum / total);
    }
    return contrasts;
  }

  int spokes_;
};

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_CALIB_REGISTRATION_STAR_IMAGE_H_

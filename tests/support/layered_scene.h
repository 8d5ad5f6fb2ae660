#ifndef THICKLENS_TESTS_SUPPORT_LAYERED_SCENE_H_
#define THICKLENS_TESTS_SUPPORT_LAYERED_SCENE_H_

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

#include "thicklens/estimator/estimate_input.h"

namespace thicklens::testing {

// A scene of textured discs at depths of their own before a background, and its photograph. The
// photograph is made without the estimator: views in which each disc moves by its
// disparity are painted from far to near, and averaged.
class LayeredScene {
 public:
  static constexpr int kViews = 5;
  static constexpr double kFarPx = -1.2;  // disparity of the background, px per view step

  LayeredScene(unsigned seed, int width_px, int height_px, double noise_levels = 1,
               double aperture = 1)
      : width_px_(width_px), height_px_(height_px) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> unit(0, 1);
    MakeTexture(&random);
    constexpr int kThings = 12;
    for (int i = 0; i < kThings; ++i) {
      Layer layer;
      layer.width = (0.15 + 0.2 * unit(random)) * width_px;
      layer.height = (0.15 + 0.2 * unit(random)) * height_px;
      layer.x = unit(random) * (width_px - layer.width);
      layer.y = unit(random) * (height_px - layer.height);
      layer.disparity = kFarPx + 0.5 + 2.3 * (i + 1) / kThings;
      layer.texture = static_cast<int>(unit(random) * kSide);
      layers_.push_back(layer);
    }
    std::normal_distribution<double> noise(0, noise_levels / 255);
    input_.weights = Eigen::ArrayXXd::Constant(kViews, kViews, 1.0 / (kViews * kViews));
    input_.transfer = model::TransferCurve::Linear();
    input_.image = {width_px, height_px, 1, {}};
    input_.disparity = {width_px, height_px, {}, {1, 1}};
    for (int y = 0; y < height_px; ++y) {
      for (int x = 0; x < width_px; ++x) {
        double sum = 0;
        for (int view = 0; view < kViews * kViews; ++view) {
          sum += At(x, y, aperture * (view % kViews - kViews / 2),
                    aperture * (view / kViews - kViews / 2));
        }
        const double stored = std::clamp(sum / (kViews * kViews) + noise(random), 0.0, 1.0);
        input_.image.values.push_back(static_cast<float>(std::round(255 * stored) / 255));
        const Layer* const seen = SeenAt(x, y, 0, 0);
        input_.disparity.disparity.push_back(
            static_cast<float>(seen == nullptr ? kFarPx : seen->disparity));
      }
    }
  }

  // The photograph, and the map of its depth.
  const estimator::EstimateInput& input() const { return input_; }

 private:
  static constexpr int kSide = 256;
  struct Layer {
    double x = 0, y = 0, width = 0, height = 0, disparity = 0;
    int texture = 0;
  };

  // Discs of many sizes before each other, as the surfaces of things have details of all sizes.
  void MakeTexture(std::mt19937* random) {
    std::uniform_real_distribution<double> unit(0, 1);
    texture_.assign(static_cast<std::size_t>(kSide) * kSide, 0.5F);
    constexpr int kDiscs = 5000;
    for (int disc = 0; disc < kDiscs; ++disc) {
      const double radius = 1.2 / std::sqrt(2e-3 + unit(*random));
      const double x = kSide * unit(*random), y = kSide * unit(*random);
      const double value = 0.2 + 0.6 * unit(*random);
      const int reach = static_cast<int>(radius) + 2;
      for (int j = static_cast<int>(y) - reach; j <= static_cast<int>(y) + reach; ++j) {
        for (int i = static_cast<int>(x) - reach; i <= static_cast<int>(x) + reach; ++i) {
          const double cover = std::clamp(radius + 0.5 - std::hypot(i - x, j - y), 0.0, 1.0);
          float& at = texture_[Place(i, j)];
          at += static_cast<float>(cover * (value - static_cast<double>(at)));
        }
      }
    }
  }
  static std::size_t Place(int i, int j) {
    return static_cast<std::size_t>((j % kSide + kSide) % kSide) * kSide +
           static_cast<std::size_t>((i % kSide + kSide) % kSide);
  }
  double Texture(double x, double y) const {
    const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y));
    const double a = x - i, b = y - j;
    const auto at = [this](int s, int t) { return static_cast<double>(texture_[Place(s, t)]); };
    return (1 - b) * ((1 - a) * at(i, j) + a * at(i + 1, j)) +
           b * ((1 - a) * at(i, j + 1) + a * at(i + 1, j + 1));
  }
  // The nearest disc at a pixel of the view (a, b); null: the background.
  const Layer* SeenAt(double x, double y, double a, double b) const {
    for (auto layer = layers_.rbegin(); layer != layers_.rend(); ++layer) {
      const double s = x + layer->disparity * a - layer->x;
      const double t = y + layer->disparity * b - layer->y;
      if (std::hypot(2 * s / layer->width - 1, 2 * t / layer->height - 1) <= 1) return &*layer;
    }
    return nullptr;
  }
  double At(double x, double y, double a, double b) const {
    const Layer* const seen = SeenAt(x, y, a, b);
    if (seen == nullptr) return 0.15 + 0.6 * Texture(x + kFarPx * a, y + kFarPx * b);
    // Surfaces differ in brightness, as those of things do.
    return 0.1 + 0.05 * (seen->texture % 9) +
           0.4 * Texture(x + seen->disparity * a + seen->texture, y + seen->disparity * b);
  }

  int width_px_, height_px_;
  std::vector<Layer> layers_;
  std::vector<float> texture_;
  estimator::EstimateInput input_;
};

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_SUPPORT_LAYERED_SCENE_H_

#ifndef THICKLENS_TESTS_SUPPORT_STEPPED_SCENE_H_
#define THICKLENS_TESTS_SUPPORT_STEPPED_SCENE_H_

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <random>
#include <utility>
#include <vector>

#include "thicklens/estimator/estimate_input.h"

namespace thicklens::testing {

// A scene of textured squares whose disparities are whole numbers of px per view step, and its
// photograph: the mean of views in which each pixel is a pixel of a texture. Nothing is
// interpolated, which would be a blur of its own that differs between the views.
class SteppedScene {
 public:
  static constexpr int kViews = 5;
  static constexpr int kSquarePx = 64;

  // `weights`: of the views of the photograph; those of the input are equal nevertheless.
  SteppedScene(unsigned seed, int size_px, std::vector<int> depths_px, double noise_levels,
               const Eigen::ArrayXXd& weights = UniformViews())
      : depths_px_(std::move(depths_px)) {
    std::mt19937 random(seed);
    MakeTexture(&random);
    const int across = size_px / kSquarePx;
    for (int i = 0; i < across * across; ++i) {
      order_.push_back(
          depths_px_[static_cast<std::size_t>(i * 7 + i / across) % depths_px_.size()]);
    }
    // Near squares are before far ones.
    std::sort(depths_px_.begin(), depths_px_.end());
    std::normal_distribution<double> noise(0, noise_levels / 255);
    input_.weights = UniformViews();
    input_.transfer = model::TransferCurve::Linear();
    input_.image = {size_px, size_px, 1, {}};
    input_.disparity = {size_px, size_px, {}, {1, 1}};
    for (int y = 0; y < size_px; ++y) {
      for (int x = 0; x < size_px; ++x) {
        double sum = 0;
        for (int b = 0; b < kViews; ++b) {
          for (int a = 0; a < kViews; ++a) {
            if (weights(b, a) != 0)
              sum += weights(b, a) * At(x, y, a - kViews / 2, b - kViews / 2, across);
          }
        }
        const double stored = std::clamp(sum + noise(random), 0.0, 1.0);
        input_.image.values.push_back(static_cast<float>(std::round(255 * stored) / 255));
        input_.disparity.disparity.push_back(static_cast<float>(SquareAt(x, y, across).first));
      }
    }
  }

  static Eigen::ArrayXXd UniformViews() {
    return Eigen::ArrayXXd::Constant(kViews, kViews, 1.0 / (kViews * kViews));
  }
  // Only the view in the middle.
  static Eigen::ArrayXXd Pinhole() {
    Eigen::ArrayXXd weights = Eigen::ArrayXXd::Zero(kViews, kViews);
    weights(kViews / 2, kViews / 2) = 1;
    return weights;
  }
  const estimator::EstimateInput& input() const { return input_; }

 private:
  static constexpr int kSide = 256;

  // Discs of many sizes before each other.
  void MakeTexture(std::mt19937* random) {
    std::uniform_real_distribution<double> unit(0, 1);
    texture_.assign(static_cast<std::size_t>(kSide) * kSide, 0.5F);
    constexpr int kDiscs = 5000;
    for (int disc = 0; disc < kDiscs; ++disc) {
      const double radius = 1.2 / std::sqrt(2e-3 + unit(*random));
      const double x = kSide * unit(*random), y = kSide * unit(*random);
      const double value = 0.15 + 0.7 * unit(*random);
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
  // Disparity and number of the square of the view in the middle.
  std::pair<int, int> SquareAt(int x, int y, int across) const {
    const int column = std::clamp(x / kSquarePx, 0, across - 1);
    const int row = std::clamp(y / kSquarePx, 0, across - 1);
    const int square = row * across + column;
    return {order_[static_cast<std::size_t>(square)], square};
  }
  double At(int x, int y, int a, int b, int across) const {
    for (auto depth = depths_px_.rbegin(); depth != depths_px_.rend(); ++depth) {
      const int s = x + *depth * a, t = y + *depth * b;
      const auto [disparity, square] = SquareAt(s, t, across);
      if (disparity != *depth && depth + 1 != depths_px_.rend()) continue;
      return static_cast<double>(texture_[Place(s + 37 * square, t + 11 * square)]);
    }
    return 0;
  }

  std::vector<int> depths_px_, order_;
  std::vector<float> texture_;
  estimator::EstimateInput input_;
};

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_SUPPORT_STEPPED_SCENE_H_

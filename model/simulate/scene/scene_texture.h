#ifndef THICKLENS_MODEL_SIMULATE_SCENE_SCENE_TEXTURE_H_
#define THICKLENS_MODEL_SIMULATE_SCENE_SCENE_TEXTURE_H_

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "model/base/random_draws.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::model {

// Requirements for a layer's texture. Positions are (X, Y), mm from the optical axis. For a height
// field they are positions of the image, and px replace mm.
struct TextureRequest {
  Eigen::Vector2d low_mm{0, 0}, high_mm{0, 0};  // the visible part of the layer
  Eigen::Vector2d centre_mm{0, 0};              // of an edge, a star or an image
  double pixel_mm = 0;                          // one px at the layer's depth on the axis
  double coarsest_pixel_mm = 0;                 // the largest px on the layer
};

// The painted plane: RGB radiance at every position. Uniform, sine and edge have a closed form; the
// other kinds are tiles. A tile repeats itself, an image (kImage) after mirroring. A tile has
// four samples per coarsest px and is linear between them. The samples are corrected so that
// frequencies below half a cycle per px keep their full amplitude.
class SceneTexture {
 public:
  // Throws Error for a feature size that the layer cannot show, or an empty image. The result does
  // not depend on `threads` (0: one per core).
  SceneTexture(const TextureOptions& options, const TextureRequest& request,
               const LinearImage& image, RandomDraws* draws, int threads = 1);

  // Lower and upper bounds of R, G and B.
  Eigen::Array4f Darkest() const {
    return tile_.empty() ? colour_ * static_cast<float>(1 - amplitude_) : darkest_;
  }
  Eigen::Array4f Brightest() const {
    return tile_.empty() ? colour_ * static_cast<float>(1 + amplitude_) : brightest_;
  }

  // Returns R, G, B and a 0.
  Eigen::Array4f At(double x_mm, double y_mm) const {
    if (!tile_.empty()) return TileAt(x_mm, y_mm);
    if (amplitude_ == 0) return colour_;
    const double phase = wave_.x() * x_mm + wave_.y() * y_mm;
    return colour_ * static_cast<float>(1 + amplitude_ * (is_edge_ ? std::erf(phase - edge_at_)
                                                                   : std::cos(phase)));
  }

  // Returns the sum of weight_i At(centre + (x_i, y_i)), i < count <= kMaxAtOnce.
  static constexpr int kMaxAtOnce = 64;
  Eigen::Array4f SumAround(const Eigen::Vector2d& centre_mm, const float* x_mm, const float* y_mm,
                           const float* weight, int count) const;

 private:
  // Sets the parameters of a sine or an edge.
  void SetWave(const TextureOptions& options, const TextureRequest& request);

  Eigen::Array4f TileAt(double x_mm, double y_mm) const {
    const double x = (x_mm - origin_mm_.x()) * per_mm_.x();
    const double y = (y_mm - origin_mm_.y()) * per_mm_.y();
    const std::int64_t column = WholeBelow(x);
    const std::int64_t row = WholeBelow(y);
    const auto fx = static_cast<float>(x - static_cast<double>(column));
    const auto fy = static_cast<float>(y - static_cast<double>(row));
    const int left = Wrapped(column, columns_);
    const int right = left + 1 == columns_ ? 0 : left + 1;
    const int above = Wrapped(row, rows_);
    const int below = above + 1 == rows_ ? 0 : above + 1;
    return (1 - fy) * ((1 - fx) * Sample(above, left) + fx * Sample(above, right)) +
           fy * ((1 - fx) * Sample(below, left) + fx * Sample(below, right));
  }

  const Eigen::Array4f& Sample(int row, int column) const {
    return tile_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                 static_cast<std::size_t>(column)];
  }

  // Equals std::floor, which is a function call if the target processor has no instruction for it.
  static std::int64_t WholeBelow(double x) {
    const auto toward_zero = static_cast<std::int64_t>(x);
    return static_cast<double>(toward_zero) > x ? toward_zero - 1 : toward_zero;
  }

  // A position may be far away where a plane extends to great depths.
  static int Wrapped(std::int64_t index, int count) {
    if (index >= 0 && index < count) return static_cast<int>(index);
    const auto inside = static_cast<int>(index % count);
    return inside < 0 ? inside + count : inside;
  }

  Eigen::Array4f colour_{0, 0, 0, 0};
  double amplitude_ = 0;  // of a sine or an edge
  bool is_edge_ = false;
  Eigen::Vector2d wave_{0, 0};        // radians per mm; for an edge direction/(sqrt(2) sigma)
  double edge_at_ = 0;                // value of wave_ . middle
  std::vector<Eigen::Array4f> tile_;  // empty: closed form
  Eigen::Array4f darkest_{0, 0, 0, 0}, brightest_{0, 0, 0, 0};
  int columns_ = 0, rows_ = 0;
  Eigen::Vector2d origin_mm_{0, 0};  // position of the sample (0, 0)
  Eigen::Vector2d per_mm_{0, 0};     // samples per mm
};

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SCENE_SCENE_TEXTURE_H_

#ifndef THICKLENS_ESTIMATOR_DEPTH_DEPTH_SURFACES_H_
#define THICKLENS_ESTIMATOR_DEPTH_DEPTH_SURFACES_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "thicklens/base/index.h"
#include "thicklens/estimator/resample_depth.h"

namespace thicklens::estimator {

// The samples of a depth map, and which neighbours among them are of one surface: those that differ
// by little, or as much as the samples beside them, as on a slope.
class DepthSurfaces {
 public:
  // The neighbours of a sample to the right and below; the others follow by symmetry.
  static constexpr std::array<std::array<int, 2>, 4> kSteps = {{{1, 0}, {0, 1}, {1, 1}, {-1, 1}}};

  explicit DepthSurfaces(const DepthSampling& map);

  // A sample; NaN is a hole.
  float value(int x, int y) const { return values_[At(x, y)]; }
  float weight(int x, int y) const { return weights_[At(x, y)]; }
  // Differences up to this are of one surface.
  float jump() const { return jump_; }
  std::size_t mixed() const { return mixed_; }
  int width() const { return width_; }
  int height() const { return height_; }
  // Whether the samples at (x, y) and in direction n of kSteps are of one surface.
  bool IsLinked(int x, int y, std::size_t n) const { return linked_[n][At(x, y)] != 0; }

 private:
  std::size_t At(int x, int y) const { return Index(y) * Index(width_) + Index(x); }
  float ValueOrHole(int x, int y) const;  // NaN beyond the map
  void FindJump();
  void GiveMixedSamplesAway();
  bool AreLinked(int x, int y, int dx, int dy) const;

  int width_, height_;
  std::vector<float> values_, weights_;
  std::array<std::vector<std::uint8_t>, 4> linked_;
  float jump_ = 0;
  std::size_t mixed_ = 0;
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_DEPTH_DEPTH_SURFACES_H_

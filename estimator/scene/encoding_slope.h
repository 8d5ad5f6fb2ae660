#ifndef THICKLENS_ESTIMATOR_SCENE_ENCODING_SLOPE_H_
#define THICKLENS_ESTIMATOR_SCENE_ENCODING_SLOPE_H_

#include <cmath>
#include <cstddef>
#include <vector>

#include "thicklens/model/scene.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::estimator {

// A table of TransferCurve::Encode for many values: within 2e-5 of it in [0, 1], exact outside.
class EncodedValueTable {
 public:
  explicit EncodedValueTable(const model::TransferCurve& transfer);
  float Encode(float light) const {
    if (!(light > 0) || !(light < 1)) return static_cast<float>(transfer_.Encode(light));
    const float at = std::sqrt(light) * kCells;
    const int cell = static_cast<int>(at);
    const float share = at - static_cast<float>(cell);
    return stored_[static_cast<std::size_t>(cell)] * (1 - share) +
           stored_[static_cast<std::size_t>(cell) + 1] * share;
  }

 private:
  static constexpr int kCells = 4096;
  model::TransferCurve transfer_;
  std::vector<float> stored_;
};

// Returns s of each pixel: the slope of the transfer curve, d stored/d light, at the grey of the
// image smoothed by a Gaussian of `smoothing_px`. The light is limited to 1 and to at least the
// light stored as kDarkest; below it gamma curves become infinitely steep and noise dominates the
// light.
constexpr double kDarkest = 0.04;
std::vector<double> EncodingSlopes(const model::LinearImage& image,
                                   const model::TransferCurve& transfer, double smoothing_px);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_ENCODING_SLOPE_H_

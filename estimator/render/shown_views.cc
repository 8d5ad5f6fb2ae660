#include "estimator/render/shown_views.h"

#include <fmt/format.h>

#include <cstddef>
#include <string>
#include <vector>

#include "thicklens/base/error.h"

namespace thicklens::estimator {

void CheckLightField(const model::LightField& light_field) {
  std::string why;
  if (!light_field.IsValid(&why)) throw Error("light field: " + why);
}

Eigen::ArrayXXd PresentWeights(const model::LightField& light_field,
                               const Eigen::ArrayXXd& weights) {
  if (weights.cols() != light_field.u_count || weights.rows() != light_field.v_count) {
    throw Error(fmt::format("weights are {}x{} for {}x{} views: the counts must be equal",
                            weights.cols(), weights.rows(), light_field.u_count,
                            light_field.v_count));
  }
  if (!(weights >= 0).all() || !weights.allFinite()) {
    throw Error("weights of the views: each must be finite and >= 0");
  }
  Eigen::ArrayXXd present = weights;
  for (int l = 0; l < light_field.v_count; ++l) {
    for (int k = 0; k < light_field.u_count; ++k) {
      if (!light_field.IsPresent(k, l)) present(l, k) = 0;
    }
  }
  if (!(present.sum() > 0)) {
    throw Error("weights of the views: at least one view that is present must have a weight > 0");
  }
  return present;
}

model::LinearImage BlackImage(int width_px, int height_px, int channels) {
  return {
      width_px, height_px, channels,
      std::vector<float>(static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px) *
                             static_cast<std::size_t>(channels),
                         0.0F)};
}

}  // namespace thicklens::estimator

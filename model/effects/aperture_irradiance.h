#ifndef THICKLENS_MODEL_EFFECTS_APERTURE_IRRADIANCE_H_
#define THICKLENS_MODEL_EFFECTS_APERTURE_IRRADIANCE_H_

#include <Eigen/Core>
#include <vector>

#include "model/effects/effect_bounds.h"
#include "thicklens/model/effects.h"

namespace thicklens::model {

enum class Aperture { kPinhole, kGaussian, kDisc };

// Of a picture with these effects.
Aperture ApertureOf(const EffectOptics& optics, const EffectSet& effects);

// Points of an aperture of standard deviation 1 whose mean is exact up to the fifth order.
struct AperturePoint {
  double x, y, weight;
};
const std::vector<AperturePoint>& AperturePoints(Aperture aperture);

// What rays through the points of an aperture bring to a position of the image of a uniform
// radiance, each by [S12] relative to what the same point of the aperture brings to the principal
// point: the calibrated blur of a point on the axis contains the fall-off there. Their mean, which
// is 1 at the principal point, and each over that mean.
struct Irradiance {
  double mean = 0;
  std::vector<double> over_mean;
};
Irradiance IrradianceAt(const EffectOptics& optics, const Eigen::Vector2d& position_px,
                        double image_distance_mm, Aperture aperture);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_EFFECTS_APERTURE_IRRADIANCE_H_

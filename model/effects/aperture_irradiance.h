#ifndef THICKLENS_MODEL_EFFECTS_APERTURE_IRRADIANCE_H_
#define THICKLENS_MODEL_EFFECTS_APERTURE_IRRADIANCE_H_

#include <Eigen/Core>
#include <vector>

#include "model/effects/effect_bounds.h"
#include "thicklens/model/effects.h"

namespace thicklens::model {

enum class Aperture { kPinhole, kGaussian, kDisc };

// The aperture of an image with these effects.
Aperture ApertureOf(const EffectOptics& optics, const EffectSet& effects);

// Points and weights of an aperture of standard deviation 1. Their weighted mean is exact up to the
// fifth order.
struct AperturePoint {
  double x, y, weight;
};
const std::vector<AperturePoint>& AperturePoints(Aperture aperture);

// Irradiance at a position of the image of a uniform radiance, by the rays through the points of an
// aperture. Each value is [S12] relative to the value of the same aperture point at the principal
// point, because the calibrated blur of a point on the axis contains the fall-off there.
struct Irradiance {
  double mean = 0;                // weighted mean over the aperture; 1 at the principal point
  std::vector<double> over_mean;  // the value of each point divided by the mean
};
Irradiance IrradianceAt(const EffectOptics& optics, const Eigen::Vector2d& position_px,
                        double image_distance_mm, Aperture aperture);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_EFFECTS_APERTURE_IRRADIANCE_H_

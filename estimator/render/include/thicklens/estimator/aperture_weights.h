#ifndef THICKLENS_ESTIMATOR_APERTURE_WEIGHTS_H_
#define THICKLENS_ESTIMATOR_APERTURE_WEIGHTS_H_

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "thicklens/model/light_field.h"

namespace thicklens::estimator {

// The weights of a smaller aperture over the same views, V x U, sum 1: the light field's own ones,
// those of the captured aperture of radius r, times what radius R leaves of each:
// exp(-|a|^2/2 (1/(kappa R)^2 - 1/(kappa r)^2)) for a Gaussian, 1 within 2 kappa R for a disc, a
// the view's place on the aperture; derived here [D23]. R = r gives the captured aperture. R is in
// mm with a camera, and must be at most r; without one the aperture is a disc of R view steps. R =
// 0, and an aperture that meets no view, is the view (or views) nearest to the centre. Absent views
// have 0.
Eigen::ArrayXXd WeightsForRadius(const model::LightField& light_field, double radius);

// Whether the light field's UV plane lies off the aperture.
bool IsOffAperture(const model::LightField& light_field);

// The shape whose ApertureWeights the light field's own weights are, to 1e-6 and but for views that
// are not present; none: of no shape. Few views may fit several: then that of the camera's PSF.
std::optional<model::ApertureShape> ShapeOfWeights(const model::LightField& light_field);

// How far the rays of a pixel wander over the aperture at most, over half of what the views of one
// pixel cover there: so much of their light is missing on one side. Needs a grid and a camera.
double LargestWander(const model::LightField& light_field);

// How an aperture weighs a ray by where it crosses: as the weight of that shape there, in steps of
// the views on the aperture, times what the smaller aperture of WeightsForRadius leaves. An axis
// along which the views have no step has no say. Not for `radius_mm` 0, which is one view.
struct Vignetting {
  model::ApertureShape shape = model::ApertureShape::kGaussian;
  std::optional<double> radius_mm;
};

// Of every ray of the view (k, l), T x S row by row, 1 in the middle of the aperture. From [S10]:
// the ray (s, t, u, v) crosses at a = ((zl + d0) u - zl s)/d0; a step of the views is that of
// model::ApertureStepsMm. Needs a grid and a camera.
std::vector<float> PassedRays(const model::LightField& light_field, const Vignetting& vignetting,
                              int k, int l);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_APERTURE_WEIGHTS_H_

#ifndef THICKLENS_ESTIMATOR_APERTURE_WEIGHTS_H_
#define THICKLENS_ESTIMATOR_APERTURE_WEIGHTS_H_

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/light_field.h"

namespace thicklens::estimator {

// Returns the weights of a smaller aperture over the same views, V x U, with sum 1. The light
// field's own weights are those of the captured aperture of radius r. Each is multiplied by the
// share that the radius R leaves of it: exp(-|a|^2/2 (1/(kappa R)^2 - 1/(kappa r)^2)) for a
// Gaussian, and 1 within 2 kappa R for a disc, where a is the position of the view on the aperture;
// derived here [D23]. R = r gives the captured aperture.
//
// R is in mm with a camera, and must then be at most r; without a camera the aperture is a disc of
// R view steps. For R = 0, and for an aperture that meets no view, the weight goes to the view (or
// views) nearest to the centre. Absent views have the weight 0. Throws Error for an invalid light
// field and for a radius that is negative, not finite or, with a camera, larger than r.
THICKLENS_EXPORT Eigen::ArrayXXd WeightsForRadius(const model::LightField& light_field,
                                                  double radius);

// Whether the light field's UV plane lies off the aperture.
THICKLENS_EXPORT bool IsOffAperture(const model::LightField& light_field);

// Returns the shape whose model::ApertureWeights equal the light field's own weights within 1e-6,
// apart from absent views, or nothing if no shape fits. Several shapes may fit a few views; the
// shape of the camera's PSF is then preferred.
THICKLENS_EXPORT std::optional<model::ApertureShape> ShapeOfWeights(
    const model::LightField& light_field);

// Returns how far the centre of the rays of a pixel moves across the aperture at most, relative to
// half of the width that the views of one pixel cover there: this share of their light is missing
// on one side. Needs a grid and a camera.
THICKLENS_EXPORT double MaxPupilShift(const model::LightField& light_field);

// Weighting of a ray by the place where it crosses the aperture: the weight of `shape` at that
// place, in view steps on the aperture, times the share that the smaller aperture of
// WeightsForRadius leaves. An axis along which the views have no step has no influence. `radius_mm`
// must not be 0, which is a single view; without a value the aperture is the captured one.
struct Vignetting {
  model::ApertureShape shape = model::ApertureShape::kGaussian;  // shape of the captured aperture
  std::optional<double> radius_mm;                               // R of the smaller aperture, mm
};

// Returns the weight of every ray of the view (k, l), T x S numbers row by row, 1 in the middle of
// the aperture. From [S10]: the ray (s, t, u, v) crosses at a = ((zl + d0) u - zl s)/d0. A view
// step is that of model::ApertureStepsMm. Needs a grid and a camera.
THICKLENS_EXPORT std::vector<float> ApertureTransmissionMap(const model::LightField& light_field,
                                                            const Vignetting& vignetting, int k,
                                                            int l);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_APERTURE_WEIGHTS_H_

#ifndef THICKLENS_MODEL_MEASURED_APERTURE_H_
#define THICKLENS_MODEL_MEASURED_APERTURE_H_

#include "thicklens/base/export.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/measured_psf.h"

namespace thicklens::model {

// The directional samples of a light field for a measured PSF [D172]. The views cover twice its
// sigma on each side of its middle along each axis, as those of the two shapes do
// (ApertureWeights): the nominal step is 4 sigma/U. The weight of a view is the light of the PSF in
// the cell of one step about it. The step is then corrected so that the weighted second moment
// about the centroid is that of the PSF along each axis, scaled so that the mean of both is (kappa
// r)^2, as in [D14]. For a PSF with the same sigma along both axes these are the steps of
// SampleAperture for its weights. Throws Error unless the PSF is valid, both counts are >= 1, and
// blur_ratio and aperture_radius_mm are finite and >= 0.
THICKLENS_EXPORT ApertureSamples SampleAperture(const MeasuredPsf& psf, double blur_ratio,
                                                double aperture_radius_mm, int u_count,
                                                int v_count);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_MEASURED_APERTURE_H_

#ifndef THICKLENS_CALIB_UNCERTAINTY_FIELD_ASTIGMATISM_H_
#define THICKLENS_CALIB_UNCERTAINTY_FIELD_ASTIGMATISM_H_

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/fit/axial_focus.h"
#include "calib/fit/blur_fit.h"
#include "calib/spectrum/spectral_estimator.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::calib {

// The foci of one tile of the field, for the blur along the tangent (sagittal focus) and along the
// radius (tangential focus).
struct TileFoci {
  // Middle of the tile, px of the image from the principal point.
  Eigen::Vector2d from_axis_px{0, 0};
  AxisFocus sagittal, tangential;
  model::Estimate difference_mm;  // sagittal minus tangential zf
};

// Measures the blur of a measured region along its radius and along its tangent, as
// FitRegionAlongAxes does along x and y, and the plane of focus of each. `readings` has a frame for
// each of setup.frames, with the readings and the floor held. On the axis, where no radius exists,
// x takes its place. Absent where the texture or the frames do not determine both.
std::optional<TileFoci> FociOfTile(const SpectralEstimatorSetup& setup,
                                   const EstimatorRegion& region, const BlurFitSetup& readings,
                                   const RelativeBlurOptions& options);

// The astigmatism over the field: a part that is proportional to the square of the distance from
// the axis, and one that is the same everywhere.
struct FieldAstigmatism {
  model::Estimate at_corner_mm;  // sagittal minus tangential zf at the corner
  model::Estimate along_x_mm;    // everywhere: zf of the blur along x minus that along y
  double chi2_per_dof = 0;       // of the tiles about this law
};

// [D194] Fits the differences d of the tiles' foci at the azimuth phi from x towards y and at the
// relative distance rho from the axis: d = C rho^2 - a cos 2 phi - b sin 2 phi, where a and b are
// those of an astigmatism that is the same everywhere. A target's tilt displaces both foci alike
// and is no part of d. rho^2 is the mean of rho^2 cos 2(phi - phi_0) over the window of the tile,
// whose middle has the azimuth phi_0: that of the middle plus (m_x - m_y) cos 2 phi_0, where
// `moments_px2` are the second moments of the window along x and y about its middle. Errors are
// widened where chi^2 per degree of freedom is above 1. Absent for fewer than five tiles.
std::optional<FieldAstigmatism> FitFieldAstigmatism(const std::vector<TileFoci>& tiles,
                                                    double corner_px,
                                                    const Eigen::Vector2d& moments_px2);

// Where the field astigmatism of a calibration is beyond doubt: a warning, and intervals of zf, d1
// and kappa that contain the mean of both foci and of both ratios over the tiles, beside those of
// the tiles with one variance for all directions.
void WidenByFieldAstigmatism(const model::ThickLens& lens, Calibration* calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_UNCERTAINTY_FIELD_ASTIGMATISM_H_

#ifndef THICKLENS_ESTIMATOR_RENDER_H_
#define THICKLENS_ESTIMATOR_RENDER_H_

#include <Eigen/Core>

#include "thicklens/base/export.h"
#include "thicklens/estimator/aperture_weights.h"
#include "thicklens/model/light_field.h"

namespace thicklens::kernels {
template <typename Real>
class Kernels;
}  // namespace thicklens::kernels

namespace thicklens::estimator {

// Forms the photograph that the whole aperture would take of the light field, in linear light: the
// mean of the views with `weights` (V x U, >= 0; the sum need not be 1), each ray at the pixel
// where it lands. Absent views do not contribute.
//
// With `falloff` (may be null) the rays carry the irradiance of [S12], relative to that of a
// uniform radiance at the principal point. With UV off the aperture the rays of a view cross the
// aperture in different places. The rays that land at a pixel then have the weights of
// `vignetting`, with sum 1 over the present views, and `weights` are those of the principal point
// (with ST in the plane of focus). If `vignetting` is null, `weights` apply everywhere.
//
// If `kernels` is null, the photograph is computed on the processor with `threads` threads and
// vector instructions; the numbers equal those of the kernels except for rounding. Throws Error for
// an invalid light field, for weights that do not fit, and if all rays of a pixel are outside of
// the aperture.
THICKLENS_EXPORT model::LinearImage Photograph(const model::LightField& light_field,
                                               const Eigen::ArrayXXd& weights,
                                               const model::Camera* falloff,
                                               const Vignetting* vignetting,
                                               kernels::Kernels<float>* kernels, int threads);

// Refocuses the photograph [D98]: shifts the views so that points of the given disparity (px per
// view step) coincide, and averages them with `weights`. Interpolation is bicubic between samples.
// Where the shift moves some views out of the image, the mean is over the others; where it moves
// all of them out, the result is black. Throws Error for an invalid light field, for weights that
// do not fit, and for a disparity that is not finite.
THICKLENS_EXPORT model::LinearImage Refocus(const model::LightField& light_field,
                                            double disparity_u_px, double disparity_v_px,
                                            const Eigen::ArrayXXd& weights, int threads);
// Returns the disparity -m of the light field's grid at a depth from the aperture plane, for each
// axis, in px per view step. Throws Error without a camera and at the depth of the UV plane.
THICKLENS_EXPORT Eigen::Vector2d DisparityAtDepthPx(const model::LightField& light_field,
                                                    double depth_mm);

// Returns all views side by side, (0, 0) at the top left, with `gap_px` (>= 0) black pixels between
// them. Throws Error for an invalid light field and for a mosaic of more than 100000 px one way.
THICKLENS_EXPORT model::LinearImage Mosaic(const model::LightField& light_field, int gap_px);

// Return epipolar-plane images: row t of all views of the view row l, one above the other, each
// repeated to a height of `repeat_px` (>= 1); or column s of all views of the view column k, side
// by side. They throw Error for an invalid light field or index, and if the repeated lines need
// more than 100000 px.
THICKLENS_EXPORT model::LinearImage EpipolarRow(const model::LightField& light_field, int t, int l,
                                                int repeat_px);
// Returns column s of all views of the view column k, side by side, each repeated to a width of
// `repeat_px` (>= 1). Throws Error as EpipolarRow does.
THICKLENS_EXPORT model::LinearImage EpipolarColumn(const model::LightField& light_field, int s,
                                                   int k, int repeat_px);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_RENDER_H_

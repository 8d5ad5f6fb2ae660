#ifndef THICKLENS_ESTIMATOR_RENDER_H_
#define THICKLENS_ESTIMATOR_RENDER_H_

#include <Eigen/Core>

#include "thicklens/estimator/aperture_weights.h"
#include "thicklens/kernels/kernels.h"
#include "thicklens/model/light_field.h"

namespace thicklens::estimator {

// The photograph that the whole aperture would take of the light field, in linear light: the mean
// of the views with `weights` (V x U, >= 0; the sum need not be 1), each ray where it lands.
// Views that are not present have no share. Rays carry the irradiance of [S12] in `falloff`,
// relative to that of a uniform radiance at the principal point; null: none. With UV off the
// aperture the rays of a view cross it in different places: those that land at a pixel have the
// weights of `vignetting`, with sum 1 over the views that are present, `weights` being those of the
// principal point (with ST in the plane of focus); null: `weights` everywhere. Throws Error, too,
// if a pixel's rays are all outside of the aperture. Without `kernels` it is computed on the
// processor, vectorised on `threads` of them; the numbers are those of the kernels but for
// rounding.
model::LinearPicture Photograph(const model::LightField& light_field,
                                const Eigen::ArrayXXd& weights, const model::Camera* falloff,
                                const Vignetting* vignetting, kernels::Kernels<float>* kernels,
                                int threads);

// The photograph refocused [D98]: views shifted so that points of that disparity (px per view step)
// coincide, then averaged with `weights`; bicubic between samples. Where shifts leave a view, the
// others are averaged; black where they leave all.
model::LinearPicture Refocus(const model::LightField& light_field, double disparity_u_px,
                             double disparity_v_px, const Eigen::ArrayXXd& weights, int threads);
// -m of the light field's grid at that depth, per axis; throws Error without a camera.
Eigen::Vector2d DisparityAtDepthPx(const model::LightField& light_field, double depth_mm);

// All views side by side, (0, 0) at the top left, `gap_px` black between them.
model::LinearPicture Mosaic(const model::LightField& light_field, int gap_px);

// Epipolar pictures: row t of all views of the row l of views, one above the other, each
// `repeat_px` high; or column s of all views of the column k, side by side.
model::LinearPicture EpipolarRow(const model::LightField& light_field, int t, int l, int repeat_px);
model::LinearPicture EpipolarColumn(const model::LightField& light_field, int s, int k,
                                    int repeat_px);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_RENDER_H_

#ifndef THICKLENS_ESTIMATOR_RENDER_H_
#define THICKLENS_ESTIMATOR_RENDER_H_

#include <Eigen/Core>

#include "thicklens/kernels/kernels.h"
#include "thicklens/model/light_field.h"

namespace thicklens::estimator {

// The photograph that the whole aperture would take of the light field, in linear light: the mean
// of the views with `weights` (V x U, >= 0; the sum need not be 1), each ray where it lands.
// Views that are not present have no share. Rays carry the irradiance of (12) in `falloff`,
// relative to that of a uniform radiance at the principal point; null: none.
model::LinearPicture Photograph(const model::LightField& light_field,
                                const Eigen::ArrayXXd& weights, const model::Camera* falloff,
                                kernels::Kernels<float>* kernels, int threads);

// The weights of a smaller aperture over the same views, V x U, sum 1: the light field's own ones,
// those of the captured aperture of radius r, times what radius R leaves of each:
// exp(-|a|^2/2 (1/(kappa R)^2 - 1/(kappa r)^2)) for a Gaussian, 1 within 2 kappa R for a disc, a
// the view's place on the aperture; derived here. R = r gives the captured aperture. R is in mm
// with a camera, and must be at most r; without one the aperture is a disc of R view steps. R = 0,
// and an aperture that meets no view, is the view (or views) nearest to the centre. Absent views
// have 0.
Eigen::ArrayXXd WeightsForRadius(const model::LightField& light_field, double radius);

// The photograph refocused: views shifted so that points of that disparity (px per view step)
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

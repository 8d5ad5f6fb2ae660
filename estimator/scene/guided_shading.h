#ifndef THICKLENS_ESTIMATOR_SCENE_GUIDED_SHADING_H_
#define THICKLENS_ESTIMATOR_SCENE_GUIDED_SHADING_H_

#include <vector>

#include "thicklens/estimator/disparity_map.h"

namespace thicklens::estimator {

// The relief of a scene is visible in its shading: the light that a surface sends on depends on its
// orientation and, where the light comes from far away and the paint does not change, is a linear
// function of its normal (Lambert). So the depth shows fine folds that the photograph has lost to
// blur, once the remaining detail has shown how they are lit. The method is a guided filter (He,
// Sun and Tang 2010) [L15] whose guide is the normals of the depth, and which is fitted to the
// detail that both images show alike.

// Orientation of the surface at each pixel.
constexpr int kNormals = 3;
template <typename Real>
struct ShadingGuide {
  // kNormals planes (x, y, toward the lens), each less its mean: the unit vector along (gx, gy, c),
  // where gx and gy are the slopes of the disparity, px per view step and px. A slope is the
  // difference to one of the two neighbours, the one nearer to 0, so that edges have none, limited
  // to +-0.15. The vector is the surface's normal up to a stretch toward the lens: the size of
  // these px in mm is not known for every map, and c replaces it.
  std::vector<Real> normals;
  std::vector<float> is_smooth;  // 1, or 0 beside a jump of the depth
};

// Returns the root mean square of the slopes of a disparity beside no jump, less their mean (a
// plane has no relief), px per view step and px.
double ShadingGuideSlope(const DisparityMap& disparity);
// Below this slope the relief is no larger than the errors that the fit of its shading allows for.
constexpr double kMinShadingGuideSlope = 3e-4;

// Returns the relief. `slope`: the ShadingGuideSlope of the whole map, of which `disparity` may be
// a part. c is `slope`, but at least 0.02, so that shallow relief is not treated as steep.
template <typename Real>
ShadingGuide<Real> ShadingGuideOf(const DisparityMap& disparity, double slope);

// The contribution of shading to an image; each member has the image's size.
template <typename Real>
struct GuidedShading {
  std::vector<Real> sharp;    // shading by the relief itself
  std::vector<Real> already;  // the part of it that the image already contains
};

// Fits the shading of a radiance r (planar, of the relief's size) that was estimated from a
// photograph; `estimated` is the result of the same estimate for a photograph of the relief's
// normals. In windows of 21 x 21 px, without pixels beside jumps, each colour of r is fitted by
// least squares as a linear function of `estimated`, both less their mean over a Gaussian of 2 px:
//
//   a = (Cov + eps Id)^-1 cov, then times R^2/(R^2 + 4 (1 - R^2)),
//
// R^2 = sum of a cov over the variance of all colours, the share that the fit explains. The detail
// lost to blur is next to the finest remaining detail, so the fit uses that alone; where the errors
// of the depth are there as large as its relief, least squares makes a smaller by itself. The
// shading is sum_k a_k (n_k - mean of estimated n_k), with a averaged over the window. Derived here
// [D108]. The result does not depend on `threads`.
template <typename Real>
GuidedShading<Real> FitShading(const ShadingGuide<Real>& guide, const std::vector<Real>& estimated,
                               const std::vector<Real>& radiance, int width_px, int height_px,
                               int threads);
// Returns the memory that FitShading needs beside its input and output.
double ShadingBytes(int width_px, int rows, int channels, int threads, double real_bytes);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_GUIDED_SHADING_H_

#ifndef THICKLENS_ESTIMATOR_SCENE_SCENE_RELIEF_H_
#define THICKLENS_ESTIMATOR_SCENE_SCENE_RELIEF_H_

#include <vector>

#include "thicklens/estimator/view_geometry.h"

namespace thicklens::estimator {

// The relief of a scene shows in its shading: the light that a surface sends on depends on which
// way it faces, and where the light comes from far away and the paint does not change, by a linear
// law of its normal (Lambert). So the depth tells fine folds that the photograph has lost to blur,
// once what it shows still has told how they are lit. A guided filter (He, Sun and Tang 2010) [L15]
// whose guide are the normals of the depth, and which learns on what both pictures show alike.

// Which way surfaces face, of each pixel.
constexpr int kNormals = 3;
template <typename Real>
struct Relief {
  // kNormals planes (x, y, toward the lens), each less its mean: the unit vector along (gx, gy, c),
  // where gx and gy are the slopes of the disparity, px per view step and px. Of the two
  // differences to neighbours the one nearer to 0, so that edges have none, cut at +-.15. It is the
  // surface's normal up to a stretch toward the lens: how many of these px are a mm is not known
  // for every map, and c stands for it.
  std::vector<Real> normals;
  std::vector<float> is_smooth;  // 1, or 0 beside a jump of the depth
};

// Root mean square of the slopes of a disparity beside no jump, less their mean (a plane has no
// relief), px per view step and px.
double ReliefSlope(const DisparityMap& disparity);
// Below it relief is no more than what the fit of its shading takes for errors.
constexpr double kLeastReliefSlope = 3e-4;

// `slope`: the ReliefSlope of the whole map, of which `disparity` may be a part. c is that, but at
// least .02: shallow relief is not taken for steep.
template <typename Real>
Relief<Real> ReliefOf(const DisparityMap& disparity, double slope);

// What shading makes of a picture, each as the picture.
template <typename Real>
struct ReliefShading {
  std::vector<Real> sharp;    // by the relief as it is
  std::vector<Real> already;  // the same, as far as the picture has it
};

// The shading of a radiance r (planar, of the relief's size) that was estimated from a photograph;
// `estimated` is what the same estimate makes of a photograph of the relief's normals. In windows
// of 21 x 21 px, without pixels beside jumps, each colour of r is fitted by least squares as a
// linear function of `estimated`, both less their mean over a Gaussian of 2 px:
//   a = (Cov + eps Id)^-1 cov, then times R^2/(R^2 + 4 (1 - R^2)),
// R^2 = sum of a cov over the variance of all colours, the share that the fit explains. What is
// lost to blur is next to the finest that is left: so the fit looks at that alone, and where the
// depth has errors as large as its relief there, least squares makes a smaller by itself. The
// shading is sum_k a_k (n_k - mean of estimated n_k), a averaged over the window. Derived here
// [D108]. The result does not depend on `threads`.
template <typename Real>
ReliefShading<Real> FitShading(const Relief<Real>& relief, const std::vector<Real>& estimated,
                               const std::vector<Real>& radiance, int width_px, int height_px,
                               int threads);
// What that needs beside its input and output.
double ShadingBytes(int width_px, int rows, int channels, int threads, double real_bytes);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_SCENE_RELIEF_H_

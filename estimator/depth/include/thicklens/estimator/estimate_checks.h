#ifndef THICKLENS_ESTIMATOR_ESTIMATE_CHECKS_H_
#define THICKLENS_ESTIMATOR_ESTIMATE_CHECKS_H_

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/estimator/view_geometry.h"

namespace thicklens::estimator {

// Displacement between neighbouring views above which the views sample the blur too coarsely, px.
constexpr double kLargestStepPx = 3;
// Noise of the depth above which it costs more than the estimate gains, px of disparity per view
// step.
constexpr double kLargestDepthNoisePx = 0.05;
// Blur from which details cannot be recovered, as sigma in px. A Gaussian blur leaves exp(-2 pi^2
// sigma^2/T^2) of a detail with a period of T px, derived here [D96]: at 3 px this is a twentieth
// for T = 7.7 px.
constexpr double kUnresolvedBlurSigmaPx = 3;

// How far apart neighbouring views land in the photograph.
struct StepCheck {
  double largest_px = 0;  // maximum of |D step - q| over the pixels and both axes
  double share = 0;       // share of the pixels beyond kLargestStepPx
};
// Measures how far apart neighbouring views of one point land in the photograph. D is the
// disparity, and q the distance between the sample and the landing point of a ray of the next view
// (LightField::landing_step_px). Holes are left out.
THICKLENS_EXPORT StepCheck CheckSteps(const DisparityMap& map,
                                      const Eigen::Vector2d& landing_step_px);

// Returns the standard deviation of the noise of a disparity from pixel to pixel, px per view step
// (the larger of the two steps), where the disparity is smooth. It is the median absolute second
// difference along rows and columns, divided by 0.6745 sqrt(6), its value for normal noise of unit
// variance; derived here [D93]. Slants have no second difference, a curvature of c px per px^2
// counts as 0.6 c, and edges are few. Maps with wide quantisation steps have a median of 0. Noise
// that is smooth over several pixels is not detected. Absent if the map is smaller than 3 px on
// both axes or holes leave no three neighbours.
THICKLENS_EXPORT std::optional<double> DepthNoisePx(const DisparityMap& map);

// A part of the photograph that the estimate does not explain; position and size in px.
struct ResidualPatch {
  int x = 0, y = 0, width_px = 0, height_px = 0;  // top-left pixel, and size
  double rms = 0;                                 // rms of the residual, in encoded values
};
// Returns the blocks of 32 x 32 px (less at the right and lower border) whose residual has an rms
// of more than four times the noise and more than four times the rms of the median block, sorted by
// descending rms. Left out are pixels where more than a hundredth of the aperture sees past an
// edge, and blocks of which less than a quarter remains. In these blocks the depth is most probably
// wrong, so that the blur is assumed too wide. (Too narrow a blur fits and is not detected.)
// `residual`: H r - I in encoded values; `occluded_fraction`: as in SceneMaps. Throws Error for
// sizes that do not fit.
THICKLENS_EXPORT std::vector<ResidualPatch> ResidualPatches(
    const std::vector<float>& residual, const std::vector<float>& occluded_fraction, int width_px,
    int height_px, double noise_sigma);

// Share of unexplained blocks (UnexplainedShare) above which the estimate as a whole does not
// explain the photograph.
constexpr double kMaxUnexplained = 0.2;
// Returns how much of the photograph the estimate leaves unexplained: the share of the blocks, as
// in ResidualPatches, whose residual has an rms of more than 1.5 times the noise, whatever the rms
// of the others. The residual of one channel has about the rms of the noise, and the mean of three
// channels less. Where many blocks have more, the photograph has details that the assumed blur
// would have removed. Absent if fewer than a tenth of all blocks count. Throws Error for sizes that
// do not fit.
THICKLENS_EXPORT std::optional<double> UnexplainedShare(const std::vector<float>& residual,
                                                        const std::vector<float>& occluded_fraction,
                                                        int width_px, int height_px,
                                                        double noise_sigma);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_ESTIMATE_CHECKS_H_

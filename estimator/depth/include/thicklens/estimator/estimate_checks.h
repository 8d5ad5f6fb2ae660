#ifndef THICKLENS_ESTIMATOR_ESTIMATE_CHECKS_H_
#define THICKLENS_ESTIMATOR_ESTIMATE_CHECKS_H_

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "thicklens/estimator/view_geometry.h"

namespace thicklens::estimator {

// Displacements between neighbouring views above which the views sample the blur too coarsely, px.
constexpr double kLargestStepPx = 3;
// Noise of the depth above which it costs more than the estimate gains, px of disparity per step.
constexpr double kLargestDepthNoisePx = 0.05;
// Blur from which details cannot be recovered, as sigma in px. Of a detail with a period of T px a
// Gaussian blur leaves exp(-2 pi^2 sigma^2/T^2), derived here [D96]: at 3 px a twentieth for T
// = 7.7 px.
constexpr double kUnresolvedBlurSigmaPx = 3;

struct StepCheck {
  double largest_px = 0;  // of |D step - q| over the pixels and both axes
  double share = 0;       // of the pixels, beyond kLargestStepPx
};
// How far apart neighbouring views of one point land in the photograph; q: how far beside its
// sample a ray of the next view lands (LightField::landing_step_px). Holes are left out.
StepCheck CheckSteps(const DisparityMap& map, const Eigen::Vector2d& landing_step_px);

// Standard deviation of the noise of a disparity from pixel to pixel, px per view step (the larger
// of the two steps), where it is smooth: of all second differences along rows and columns the
// median of the absolute value, over .6745 sqrt(6), what it would be of normal noise; derived here
// [D93]. Slants have none, a curvature of c px per px^2 counts as .6 c, and edges are few; maps
// whose steps of quantisation are wide have a median of 0. Noise that is smooth over several pixels
// is not seen. Absent if the map is smaller than 3 px both ways or holes leave no three neighbours.
std::optional<double> DepthNoisePx(const DisparityMap& map);

// A part of the photograph that the estimate does not explain.
struct ResidualPatch {
  int x = 0, y = 0, width_px = 0, height_px = 0;
  double rms = 0;  // of the residual, in stored values
};
// Blocks of 32 x 32 px (less at the right and lower border) whose residual has an rms of more than
// four times that of the noise and of the median block, the largest first. Pixels of which the
// aperture sees more than a hundredth past an edge are left out, and blocks that they leave less
// than a quarter. There, most likely, the depth is wrong: too much blur is assumed. (Too little
// blur fits, and does not show.)
// `residual`: H r - I in stored values; `hidden_share`: as in SceneMaps. Throws Error for sizes
// that do not fit.
std::vector<ResidualPatch> ResidualPatches(const std::vector<float>& residual,
                                           const std::vector<float>& hidden_share, int width_px,
                                           int height_px, double noise_sigma);

// Share of such blocks above which the estimate as a whole does not explain the photograph.
constexpr double kMostUnexplained = 0.2;
// How much of the photograph the estimate leaves unexplained: the share of those blocks whose
// residual has an rms of more than 1.5 times that of the noise, whatever the others have. The
// residual of one channel has about the rms of the noise, the mean of three less. Where many
// blocks have more, the photograph has details that the blur assumed would have left out. Absent
// if fewer than a tenth of all blocks count. Throws Error for sizes that do not fit.
std::optional<double> UnexplainedShare(const std::vector<float>& residual,
                                       const std::vector<float>& hidden_share, int width_px,
                                       int height_px, double noise_sigma);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_ESTIMATE_CHECKS_H_

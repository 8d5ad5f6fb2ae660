#ifndef THICKLENS_ESTIMATOR_RAY_CONFIDENCE_H_
#define THICKLENS_ESTIMATOR_RAY_CONFIDENCE_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/estimator/estimate_input.h"

namespace thicklens::estimator {

struct CompactView;

// How well a photograph shows one ray of its light field, as one byte:
//
//   0           filled in with the background beside it: the ray shows no point of the centre view;
//   1 .. 127    a point whose blur is too strong for details (kUnresolvedBlurSigmaPx);
//   129 .. 255  a point whose blur can be undone.
//
// In the last two ranges the distance from the lower end, divided by 126, is the share of the
// aperture that sees the point: points with 127 and 255 are seen by the whole aperture, and the
// others in part, past an edge or the image's border.
using Confidence = std::uint8_t;
// The confidence of a ray that shows no point of the centre view.
constexpr Confidence kFilledIn = 0;

// Returns the confidence of a point. `visible_fraction` is the share of the aperture by its
// weights, 0 to 1; `blur_sigma_px` is the standard deviation of its blur.
THICKLENS_EXPORT Confidence ConfidenceOfPoint(double visible_fraction, double blur_sigma_px);
// Returns the share to half a 126th; 0 for a ray that is filled in.
THICKLENS_EXPORT double VisibleFractionOf(Confidence confidence);
// Returns whether the blur of the point can be undone.
THICKLENS_EXPORT bool IsResolved(Confidence confidence);

// Shares of many rays, sum 1.
struct ConfidenceShares {
  double visible = 0;         // seen by more than 99 % of the aperture, and resolved
  double partly_visible = 0;  // seen by less, and resolved
  double blurred = 0;         // blurred too strongly for details
  double filled_in = 0;       // filled in with the background
};
// Converts counts to shares. `counts`: the number of rays with each confidence. All shares are 0 if
// there are no rays.
THICKLENS_EXPORT ConfidenceShares SharesOf(const std::array<std::size_t, 256>& counts);

// Returns the confidence of each point of the centre view from the depth alone, without a solver. A
// ray sees the point if the disparity rendered into its view agrees, to 0.3 px per view step, at a
// pixel around the place where the ray meets the photograph. Throws Error for inputs that do not
// fit.
THICKLENS_EXPORT std::vector<Confidence> PointConfidence(const EstimateInput& input, int threads);

// Returns the confidence of the rays of one rendered view from that of the points. A boundary
// sample has the confidence of the point at its middle.
THICKLENS_EXPORT std::vector<Confidence> RayConfidence(const std::vector<Confidence>& of_points,
                                                       const CompactView& view);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_RAY_CONFIDENCE_H_

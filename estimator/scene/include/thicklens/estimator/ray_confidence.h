#ifndef THICKLENS_ESTIMATOR_RAY_CONFIDENCE_H_
#define THICKLENS_ESTIMATOR_RAY_CONFIDENCE_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "thicklens/estimator/estimate_input.h"
#include "thicklens/estimator/view_geometry.h"

namespace thicklens::estimator {

// How well a photograph shows one ray of its light field, as one byte:
//   0           filled in with the background beside it: no point of the centre view is there;
//   1 .. 127    a point whose blur is too strong for details (kUnresolvedBlurSigmaPx);
//   129 .. 255  a point whose blur can be undone.
// Of the last two the distance from the lower end, over 126, is the share of the aperture that sees
// the point: 127 and 255 are seen whole, the others in part, past an edge or the picture's border.
using Confidence = std::uint8_t;
constexpr Confidence kFilledIn = 0;

// `seen_share` from 0 to 1, of the aperture by its weights.
Confidence ConfidenceOfPoint(double seen_share, double blur_sigma_px);
// To half a 126th; 0 for what is filled in.
double SeenShareOf(Confidence confidence);
bool IsResolved(Confidence confidence);

// Shares of many rays, sum 1.
struct ConfidenceShares {
  double seen = 0;         // by more than 99 % of the aperture, and resolved
  double partly_seen = 0;  // by less, and resolved
  double blurred = 0;      // too strongly for details
  double filled_in = 0;
};
// `counts`: how many rays have each confidence. All 0 if there are none.
ConfidenceShares SharesOf(const std::array<std::size_t, 256>& counts);

// Of each point of the centre view, by the depth alone; solvers have no part in it. A ray sees the
// point if the disparity rendered into its view agrees, to .3 px per view step, at a pixel around
// the place where it meets the photograph. Throws Error for inputs that do not fit.
std::vector<Confidence> PointConfidence(const EstimateInput& input, int threads);

// Of the rays of one view, whose disparity was rendered, from that of the points; of a mixed sample
// that of what its middle shows.
std::vector<Confidence> RayConfidence(const std::vector<Confidence>& of_points,
                                      const CompactView& view);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_RAY_CONFIDENCE_H_

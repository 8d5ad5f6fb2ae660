#ifndef THICKLENS_TOOLS_INTERFACE_BLUR_PROPOSAL_H_
#define THICKLENS_TOOLS_INTERFACE_BLUR_PROPOSAL_H_

#include <string>

#include "thicklens/estimate.h"
#include "tools/interface/run_scope.h"

namespace thicklens {

// Returns the numbers that a user can change for what a check of the blur found. A map of
// disparities is changed by its meaning, a map of depths by the camera.
BlurProposal ProposalOf(const estimator::BlurCheck& check, const estimator::EstimateInput& input,
                        const DepthMeaning& meaning);

// Returns one line about the proposal for the user of `run`; empty: nothing is proposed.
std::string BlurWarning(const estimator::BlurCheck& check, const BlurProposal& proposal,
                        const estimator::EstimateInput& input, const RunScope& run);

// Returns the depth of the plane of focus from the aperture, mm, for which every disparity is
// `offset_px` larger than with the camera's. With d(z) = da K (1/z - 1/zf)/p: 1/zf' = 1/zf - offset
// p/(da K); derived here [D21]. p is the pixel pitch and da the aperture step of a view, mm, both
// of the axis of the larger step; K is taken from the camera. The result is infinite if the plane
// in focus would lie beyond infinity.
double FocusDepthForOffsetMm(const estimator::EstimateInput& input, double offset_px);

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_BLUR_PROPOSAL_H_

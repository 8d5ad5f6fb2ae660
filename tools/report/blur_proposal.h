#ifndef THICKLENS_TOOLS_REPORT_BLUR_PROPOSAL_H_
#define THICKLENS_TOOLS_REPORT_BLUR_PROPOSAL_H_

#include <nlohmann/json.hpp>
#include <string>

#include "thicklens/estimator/blur_check.h"
#include "thicklens/estimator/estimate_input.h"
#include "tools/options/light_field_options.h"

namespace thicklens::tools {

// The finding of --check-blur, in numbers that the user can change: those of the camera's file, or
// the scale and offset of a map of disparities.
class BlurProposal {
 public:
  BlurProposal(const estimator::BlurCheck& check, const estimator::EstimateInput& input,
               const DepthOptions& depth);

  std::string Warning() const;  // one line; empty: nothing is proposed
  std::string Summary() const;  // one line of the summary, without its name
  // Returns {message, blocks, unexplained_blocks, size, halvings, seconds, evaluations: [..],
  // proposal: {..} or null}.
  nlohmann::json Json() const;

 private:
  std::string NarrowerBlur() const;
  std::string OtherFocus() const;

  estimator::BlurCheck check_;
  DepthOptions depth_;
  bool in_disparity_ = true;
  double blur_ratio_ = 0, focus_depth_mm_ = 0;      // of the camera
  double narrower_ratio_ = 0, other_depth_mm_ = 0;  // that are proposed
};

// Returns the depth of the plane of focus from the aperture, mm, for which every disparity is
// `offset_px` larger than with the camera's. With d(z) = da K (1/z - 1/zf)/p: 1/zf' = 1/zf - offset
// p/(da K); derived here [D21]. p is the pixel pitch and da the aperture step of a view, mm, both
// of the axis of the larger step; K is taken from the camera. The result is infinite if the plane
// in focus would lie beyond infinity.
double FocusDepthForOffsetMm(const estimator::EstimateInput& input, double offset_px);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_BLUR_PROPOSAL_H_

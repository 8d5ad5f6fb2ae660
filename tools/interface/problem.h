#ifndef THICKLENS_TOOLS_INTERFACE_PROBLEM_H_
#define THICKLENS_TOOLS_INTERFACE_PROBLEM_H_

#include <memory>
#include <optional>
#include <vector>

#include "thicklens/estimate.h"
#include "thicklens/estimator/estimate_input.h"
#include "tools/interface/run_scope.h"

namespace thicklens {

// The result of the steps before the solver.
struct PreparedProblem {
  std::shared_ptr<estimator::EstimateInput> input;
  model::EffectSelection effects;
  DepthMeaning depth_meaning;    // of the map, with the scale and the offset that were found
  std::vector<bool> was_hole;    // per pixel of the depth map
  std::string colour_profile;    // of the photograph, if its curve is that of the input
  double compression_sigma = 0;  // EstimateDiagnostics::compression_sigma; 0: none
};

// The steps of PrepareProblem. The options are valid.
PreparedProblem Prepare(Image photo, DepthMap map, const std::optional<Camera>& camera,
                        const EstimateOptions& options, EstimateDiagnostics* diagnostics,
                        RunScope* run);

// ---- Steps of it.

// Decides which effects of the photograph are taken into account. Fall-off and thickness are
// decided by their impact with the camera; the others are on unless they are left out. Without a
// camera the effects are defocus, aperture-shape and occlusion, and their impact is unknown. The
// functional solver has no occlusion. `depth` is the range of the map, if there is a camera. Throws
// OptionError if defocus or occlusion is left out, because an estimate is about them, and for
// effects that it does not have.
model::EffectSelection SelectEffects(const EstimateOptions& options,
                                     const std::optional<Camera>& camera,
                                     const std::optional<model::DepthStatistics>& depth);

// The disparity of a map on the grid of its light field, without holes.
struct PreparedDepth {
  estimator::DisparityMap disparity;
  std::size_t holes = 0;
  std::vector<bool> was_hole;
  model::DepthHoles found_holes;                // of the map, by reason
  std::optional<model::DepthStatistics> depth;  // mm from Ap, with a camera
};
// The map is not relative. `camera` and `grid` are both null or both set. `run`, which may be null,
// gets reports of holes and marks, also where the map is refused. Throws Error that names the map's
// source and, with `run`, what in the map may be the cause of impossible depths.
PreparedDepth PrepareDepth(const DepthMap& map, const model::LinearImage& image,
                           const Camera* camera, const model::LightFieldGrid* grid,
                           RunScope* run = nullptr);

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_PROBLEM_H_

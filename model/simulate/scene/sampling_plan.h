#ifndef THICKLENS_MODEL_SIMULATE_SCENE_SAMPLING_PLAN_H_
#define THICKLENS_MODEL_SIMULATE_SCENE_SAMPLING_PLAN_H_

#include "model/simulate/scene/scene_survey.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::model {

// What the rays of a block's pixels spread over, px per axis.
struct SamplingSpread {
  double defocus_px = 0;  // sigma, through the aperture
  double landing_px = 0;  // sigma of where they land, without diffraction by a disc
  double airy_px = 0;     // radius of that
  double irradiance = 0;  // relative sd of what rays through the aperture bring
};

// [D45] Rms error of stored values, 255 at full scale, of pixels that are the mean of `rays` rays.
// Measured with the sets of ray_set.h on leaves, noise and edges: of 16 rays
//   E = hypot(.02 slope landing, min(.06 slope defocus, .04 range), min(.1 slope airy, .05 range)),
// or of a place with jumps hypot(.026 range, min(.065 jump defocus, .08 range)), falling as
// (16/n)^.85, with jumps as (16/n)^.7; slope and range in stored values. To that comes .06 of the
// spread of the irradiance over the aperture. A quarter or more above what was
// measured; regular patterns can pass it by half.
double SamplingError(const SceneBlock& block, const SamplingSpread& spread,
                     const TransferCurve& transfer, int rays);

// The fewest of 16, 32, 64, .. and `most` whose error is within `limit`; `most` where none is, or
// the limit is 0.
int RaysWithin(const SceneBlock& block, const SamplingSpread& spread, const TransferCurve& transfer,
               double limit, int most);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SCENE_SAMPLING_PLAN_H_

#ifndef THICKLENS_MODEL_SIMULATE_SCENE_SAMPLING_PLAN_H_
#define THICKLENS_MODEL_SIMULATE_SCENE_SAMPLING_PLAN_H_

#include "model/simulate/scene/scene_survey.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::model {

// Spread of the rays of a block's pixels, px per axis.
struct SamplingSpread {
  double defocus_px = 0;  // sigma of the spread through the aperture
  double landing_px = 0;  // sigma of the landing points, without diffraction by a disc
  double airy_px = 0;     // radius of the diffraction by a disc
  double irradiance = 0;  // relative sd of the irradiance of rays through the aperture
};

// [D45] Returns the rms error of encoded values, 255 at full scale, of pixels that are the mean of
// `rays` rays. The formula was measured with the sets of ray_set.h on leaves, noise and edges. For
// 16 rays
//   E = hypot(0.02 slope landing, min(0.06 slope defocus, 0.04 range), min(0.1 slope airy, 0.05
//   range)).
// For a place with jumps it is hypot(0.026 range, min(0.065 jump defocus, 0.08 range)). The error
// decreases as (16/n)^0.85, with jumps as (16/n)^0.7; slope and range are in encoded values. A term
// of 0.06 times the spread of the irradiance over the aperture is added. The result is at least a
// quarter above the measured error, but regular patterns can exceed it by half.
double SamplingError(const SceneBlock& block, const SamplingSpread& spread,
                     const TransferCurve& transfer, int rays);

// Returns the smallest of 16, 32, 64, ... and `most` whose error is within `limit`, or `most` if
// none is or the limit is 0.
int RaysWithin(const SceneBlock& block, const SamplingSpread& spread, const TransferCurve& transfer,
               double limit, int most);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SCENE_SAMPLING_PLAN_H_

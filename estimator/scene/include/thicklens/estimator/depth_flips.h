#ifndef THICKLENS_ESTIMATOR_DEPTH_FLIPS_H_
#define THICKLENS_ESTIMATOR_DEPTH_FLIPS_H_

#include <optional>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/estimator/estimate_input.h"
#include "thicklens/model/scene.h"

namespace thicklens::estimator {

// The photograph as one order of the depth map explains it.
struct DepthFlipTrial {
  model::DepthFlip flip = model::DepthFlip::kNone;  // the order
  double residual_rms = 0;                          // rms of H r - I, in encoded values
};

// What CheckDepthFlips found.
struct DepthFlipCheck {
  // The noise of encoded values in the image that was checked, with
  // DepthFlipOptions::compression_sigma.
  double noise_sigma = 0;
  std::vector<DepthFlipTrial> trials;  // the map as it is first, then reversed
  // The order that explains the photograph instead. Absent if the map as it is does, or if none
  // does.
  std::optional<DepthFlipTrial> better;
};

// How CheckDepthFlips is run.
struct DepthFlipOptions {
  bool falloff = true;  // use the irradiance of [S12] if there is a camera
  // Error of the photograph's compression, in its encoded values, which its noise does not show.
  double compression_sigma = 0;
  double photo_aperture = 1;               // of SceneOptions
  int threads = 0;                         // 0: one per core
  std::optional<double> memory_limit_mib;  // for the whole process
};

// The order that explains the photograph instead of the first one, if there is one: its residual is
// at most twice the noise, and its excess variance over the noise at most 0.35 of the first one's.
// Absent where the first one explains it within the noise, where none does, and for fewer than two
// trials. Derived here [D121].
THICKLENS_EXPORT std::optional<DepthFlipTrial> BetterFlip(const std::vector<DepthFlipTrial>& trials,
                                                          double noise_sigma);

// Checks whether a photograph that its depth map does not explain fits the map in another order of
// rows or columns, by solving for the scene with each, as EstimateScene does, on the photograph
// reduced to less than a million pixels. All orders have the same disparities, so that only their
// place makes the difference: a wrong scale or focus leaves all of them unexplained. Throws Error
// for inputs that do not fit.
THICKLENS_EXPORT DepthFlipCheck CheckDepthFlips(const EstimateInput& input,
                                                const DepthFlipOptions& options);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_DEPTH_FLIPS_H_

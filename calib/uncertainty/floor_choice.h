#ifndef THICKLENS_CALIB_UNCERTAINTY_FLOOR_CHOICE_H_
#define THICKLENS_CALIB_UNCERTAINTY_FLOOR_CHOICE_H_

#include <optional>
#include <string>
#include <vector>

#include "calib/fit/blur_measurement.h"
#include "calib/uncertainty/systematic_parts.h"

namespace thicklens::calib {

// The assumption about the variance at focus: a value, or only an interval.
struct FloorChoice {
  std::optional<model::Estimate> variance_px2;  // nothing: fitted freely
  FloorInterval interval_px2;                   // (lo, hi), where only these are known
  bool is_measured = false;                     // the fit measures the blur floor itself
};

// Chooses the floor's constraint. In one sweep only knowledge of the target separates the lens
// floor from the softness of the target: a knife edge has none, and a print may have all of it. On
// a texture the floor cannot be found at all, but the spectrum gives an upper limit. Adds a warning
// where only an interval is known. The interval that is assumed of a lens, and the warning, have
// pixels of the sensor, of which `sensor_px_per_px` are one pixel of the frames; all other values
// have pixels of the frames.
FloorChoice ChooseFloor(const model::FloorKnowledge& known, const BlurEvidence& evidence,
                        std::vector<std::string>* warnings, int sensor_px_per_px = 1);

// Returns the largest blur (variance, px^2) of the region's reference image if the scene's own
// power nowhere rises with |nu|. It is the minimum of
//   ln(P(a)/P(b)) / (4 pi^2 (b^2 - a^2)) over frequencies a < b,
// where P is the mean power in rings without the noise, each at the end of its two-sigma interval
// that makes the bound larger. Derived here [D81]: P(nu) = S(nu) exp(-4 pi^2 sigma^2 nu^2),
// S(a) >= S(b). Returns nothing where no ring exceeds the noise.
std::optional<double> LargestBlurVariance(const SpectralEstimatorSetup& estimator,
                                          const EstimatorRegion& region);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_UNCERTAINTY_FLOOR_CHOICE_H_

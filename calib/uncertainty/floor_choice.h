#ifndef THICKLENS_CALIB_UNCERTAINTY_FLOOR_CHOICE_H_
#define THICKLENS_CALIB_UNCERTAINTY_FLOOR_CHOICE_H_

#include <optional>
#include <string>
#include <vector>

#include "calib/fit/blur_measurement.h"
#include "calib/uncertainty/systematic_parts.h"

namespace thicklens::calib {

// What may be assumed of the variance at focus: a value, or only an interval.
struct FloorChoice {
  std::optional<model::Estimate> variance_px2;  // nothing: fitted freely
  FloorInterval interval_px2;                   // (lo, hi): not known better
  bool is_measured = false;                     // the fit measures the lens floor itself
};

// In one sweep the lens floor and the softness of the target are told apart only by what is known
// of the target: a knife edge has none, a print may have all of it. On a texture the floor cannot
// be found at all; its spectrum tells what it cannot exceed. Adds a warning where only an interval
// is known.
FloorChoice ChooseFloor(const model::FloorKnowledge& known, const BlurEvidence& evidence,
                        std::vector<std::string>* warnings);

// The largest blur that a picture may have if the scene's own power nowhere rises with |nu|
// (variance, px^2): least of
//   ln(P(a)/P(b)) / (4 pi^2 (b^2 - a^2)) over frequencies a < b,
// P the mean power in rings, noise taken off, each at the end of its two-sigma interval that makes
// the bound larger. Derived here [D81]: P(nu) = S(nu) exp(-4 pi^2 sigma^2 nu^2), S(a) >= S(b).
// Nothing where no ring stands out of the noise. Of the reference of the region.
std::optional<double> LargestBlurVariance(const SpectralMeterSetup& meter,
                                          const MeterRegion& region);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_UNCERTAINTY_FLOOR_CHOICE_H_

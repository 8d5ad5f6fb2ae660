#ifndef THICKLENS_CALIB_FIT_MISFIT_CAUSES_H_
#define THICKLENS_CALIB_FIT_MISFIT_CAUSES_H_

#include <string>

#include "calib/fit/blur_measurement.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// What may lie behind frames that follow the blur law worse than their errors say. What the sweep
// itself excludes (readings whose scatter about the image scale is as small as stated; a shape of
// the blur that fits better than the other) is left out; the rest cannot be told apart by it.
std::string CausesOfMisfit(const FocusSweep& sweep, const BlurEvidence& evidence,
                           const Calibration& calibration);

// Whether the blur along x and along y is least at depths that differ beyond their errors, by an
// amount that matters to the sweep.
bool IsAstigmatic(const Calibration& calibration);

// The warning of it; empty where there is none.
std::string AstigmatismInWords(const Calibration& calibration);

// Whether depths of parts of the field that differ by so much may as well come from astigmatism,
// which moves a part's focus by up to its half either way, by the texture that it shows.
bool AstigmatismExplains(double spread_mm, const Calibration& calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_MISFIT_CAUSES_H_

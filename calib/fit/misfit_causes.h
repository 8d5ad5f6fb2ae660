#ifndef THICKLENS_CALIB_FIT_MISFIT_CAUSES_H_
#define THICKLENS_CALIB_FIT_MISFIT_CAUSES_H_

#include <string>

#include "calib/fit/blur_measurement.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// Describes the possible causes of frames that follow the blur law worse than their errors say.
// Causes that the sweep itself excludes are omitted (readings whose scatter about the image scale
// is as small as stated; a shape of the blur that fits better than the other). The sweep cannot
// distinguish the remaining causes.
std::string CausesOfMisfit(const FocusSweep& sweep, const BlurEvidence& evidence,
                           const Calibration& calibration);

// Whether the blur along x and the blur along y are smallest at depths that differ beyond their
// errors, by an amount that matters to the sweep.
bool IsAstigmatic(const Calibration& calibration);

// Returns the warning about astigmatism, with both in-focus object distances; empty where there is
// none.
std::string AstigmatismInWords(const Calibration& calibration);

// What FieldMap::field_astigmatism_mm says of the lens, in words; empty where it is not beyond
// doubt, or too small against the sweep to matter.
std::string FieldAstigmatismInWords(const Calibration& calibration);

// Whether astigmatism may also explain depths of parts of the field that differ by `spread_mm`: it
// moves a part's focus by up to half of itself in either direction, depending on the part's
// texture.
bool AstigmatismExplains(double spread_mm, const Calibration& calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_MISFIT_CAUSES_H_

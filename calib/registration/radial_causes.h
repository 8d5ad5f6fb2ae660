#ifndef THICKLENS_CALIB_REGISTRATION_RADIAL_CAUSES_H_
#define THICKLENS_CALIB_REGISTRATION_RADIAL_CAUSES_H_

#include <optional>
#include <string>

#include "calib/registration/scale_bend.h"
#include "thicklens/calib/calibration.h"

namespace thicklens::calib {

// Causes that displace the frames against one another as distorted images would be.
inline constexpr char kLensDistorts[] = "the lens distorts";
inline constexpr char kTargetIsNotFlat[] = "the target is not flat";
inline constexpr char kVignettingShifts[] = "vignetting";
inline constexpr char kFixedStructureShifts[] = "structure that stays on the sensor";

// Whether the registrations show a radial distortion that is large enough to speak of.
bool ShowsDistortion(const Calibration& calibration);

// Adds the comparison of the causes to the calibration's diagnoses, where there is a distortion
// (`calibration->structure` measured before), and a warning; a refusal where it is beyond what can
// be allowed for.
std::optional<std::string> CheckDistortion(Calibration* calibration);

// The warning of readings that bend against the image scale names what `calibration.structure`
// shows.
std::string BendInWords(const Bend& bend, const Calibration& calibration);
// The remedy makes the bend, or what it does to the bench zero, smaller.
std::string BendRemedy(const FrameStructureFinding& structure);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_RADIAL_CAUSES_H_

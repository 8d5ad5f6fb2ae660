#ifndef THICKLENS_CALIB_REGISTRATION_RADIAL_CAUSES_H_
#define THICKLENS_CALIB_REGISTRATION_RADIAL_CAUSES_H_

#include <optional>
#include <string>

#include "calib/registration/scale_nonlinearity.h"
#include "thicklens/calib/calibration.h"

namespace thicklens::calib {

// Causes that displace the frames relative to one another as distorted images would be.
inline constexpr char kLensDistorts[] = "the lens distorts";
inline constexpr char kTargetIsNotFlat[] = "the target is not flat";
inline constexpr char kVignettingShifts[] = "vignetting";
inline constexpr char kFixedStructureShifts[] = "structure that stays on the sensor";
inline constexpr char kAstigmatismShifts[] = "astigmatism";

// Whether the registrations show a significant radial distortion that is large enough to report.
bool ShowsDistortion(const Calibration& calibration);

// If there is a distortion, adds the comparison of its causes to the calibration's diagnoses, and
// adds a warning. `calibration->structure` must have been measured before. Returns a refusal
// instead of the warning where the distortion is too large for a result. `is_astigmatic` says that
// the blur along x changes against that along y through the sweep (ShowsAstigmatism): this moves
// detail in the registrations in proportion to the depth, as distortion does, so that it is a cause
// as well, and no reason to refuse. `is_undistorted` says that a stated distortion was taken out of
// the frames.
std::optional<std::string> CheckDistortion(Calibration* calibration, bool is_astigmatic = false,
                                           bool is_undistorted = false);

// The warning about readings that bend against the image scale. It names the structure found in
// `calibration.structure`.
std::string NonlinearityText(const ScaleNonlinearity& nonlinearity, const Calibration& calibration);
// A remedy that makes the bend smaller, or its effect on the bench offset.
std::string NonlinearityRemedy(const FrameStructureFinding& structure);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_RADIAL_CAUSES_H_

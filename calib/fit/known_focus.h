#ifndef THICKLENS_CALIB_FIT_KNOWN_FOCUS_H_
#define THICKLENS_CALIB_FIT_KNOWN_FOCUS_H_

#include <optional>
#include <string>

#include "calib/fit/blur_fit.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/conjugates.h"

namespace thicklens::calib {

// The part of a focal length within which it is taken to be right if the camera file states no
// tolerance: labels are rounded by about as much.
inline constexpr double kFocalLengthTolerance = 0.01;

// Names of the focal lengths in the camera file.
inline constexpr char kFrontFocalLength[] = "lens.front_focal_length_mm";
inline constexpr char kRearFocalLength[] = "lens.rear_focal_length_mm";

// Name of the statement that follows from a period of the target.
inline constexpr char kFromPeriod[] = "target_period_mm";

// Name of the statement by which the data of an objective give its magnification, and the part of
// it within which ISO 8039 requires it to be right: it holds where the camera file states no
// tolerance.
inline constexpr char kFromObjective[] = "lens.magnification";
inline constexpr double kIso8039 = 0.05;

// The tolerance of a statement: that of an objective's magnification, which is an interval and no
// standard deviation. 0 for all other statements, whose standard deviation is stated.
double ToleranceOfStatement(const model::Camera& camera, const model::StatedConjugate& stated);

// Whether both focal lengths are those of a lens in air, which are one length.
bool HasOneFocalLength(const model::ThickLens& lens);

// Name of the focal length whose stated tolerance holds for the lens: that of the front one, or, if
// only the rear one states a tolerance and both are one length, that of the rear one. Empty where
// the camera file states none.
std::string FieldOfFocalLengthTolerance(const model::Camera& camera);

// The lens with both focal lengths times a factor.
model::ThickLens Stretched(const model::ThickLens& lens, double factor);

// Whether the camera file states a tolerance of the focal length.
bool StatesFocalLength(const model::Camera& camera);

// The tolerance of the focal lengths relative to them: the one that the camera file states, or
// kFocalLengthTolerance. 0 for an objective, whose equivalent lens is exact by its definition.
double FocalLengthTolerance(const model::Camera& camera);

// zf of a statement, mm from Ap. Sigma includes the errors that a tolerance of the focal lengths
// and one of the statement itself, as even distributions, give it.
model::Estimate FocusDepthWithTolerance(const model::Camera& camera,
                                        const model::StatedConjugate& stated);

// FitBlur where the plane of focus is known and the bench offset is not [D132]: the offset is the
// one at which the fitted zf is that of the statement; `setup.offset_mm` is only where its search
// starts. With the fit's covariance C at a held offset and its slope g = d(zf, kappa, S0,
// offset)/d offset, an error e of the fit and an error e_s of the statement's zf give
//   (1 - g u^T/g_zf) e + g e_s/g_zf,  u^T e = e_zf,
// so that zf has the error of the statement alone. `done` is false, with the reason, where the
// statement is impossible for the lens.
BlurFitResult FitBlurAtKnownFocus(const BlurFitSetup& setup, const model::StatedConjugate& known,
                                  const BlurFitResult* start = nullptr);

// FitBlurAtKnownFocus if a statement is given, otherwise FitBlur.
BlurFitResult FitBlurWith(const BlurFitSetup& setup,
                          const std::optional<model::StatedConjugate>& known,
                          const BlurFitResult* start = nullptr);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_KNOWN_FOCUS_H_

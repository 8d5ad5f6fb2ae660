#ifndef THICKLENS_MODEL_DEPTH_OF_FIELD_H_
#define THICKLENS_MODEL_DEPTH_OF_FIELD_H_

#include <Eigen/Core>
#include <optional>

#include "thicklens/base/export.h"
#include "thicklens/model/camera.h"

namespace thicklens::model {

// A limit of the depth of field, mm from Ap.
struct DepthLimit {
  double depth_mm = 0;  // +inf: infinity is within the depth of field
  // Standard deviation by that of the image distance. Absent: the limit is at infinity.
  std::optional<double> sigma_mm;
  // The limit for an image distance one standard deviation shorter or longer, (nearer, farther); an
  // end may be +inf.
  Eigen::Vector2d interval_mm{0, 0};
};

// Depth of field and depth of focus of a calibrated camera for a circle of confusion: the largest
// diameter c, on the sensor, of the geometric blur disc (2 r_defocus) of a point that counts as
// sharp.
struct FocusLimits {
  double circle_of_confusion_mm = 0;  // c, diameter on the sensor, mm
  double circle_of_confusion_px = 0;  // the same in px
  DepthLimit near, far;               // object side, from Ap
  // far - near, with the error of the image distance, which moves both; absent: far is infinity.
  std::optional<Estimate> depth_of_field_mm;
  // Image side: the whole range of sensor positions, mm, in which a point in the plane of focus has
  // at most this circle. Half of it lies on each side of the sensor.
  Estimate depth_of_focus_mm;
  // The plane of focus, from Ap, whose far limit just reaches infinity, mm; its near limit is half
  // of it. It depends on the lens and the circle alone.
  double hyperfocal_mm = 0;
  // Its change by the stated tolerances of the focal length and of the aperture radius; 0: none is
  // stated.
  double hyperfocal_tolerance_mm = 0;
  // Sigma per axis of the blur of a point at a limit, kappa c/(2 p), without the blur floor, px.
  Estimate blur_sigma_px;
};

// The limits for a circle of confusion, a diameter > 0 in mm on the sensor [D170]. With D = d1 -
// rho and e = c/(2 r):
//   1/near = 1/f1 - (f2/f1) (1 - e)/D,   1/far = 1/f1 - (f2/f1) (1 + e)/D,
// and far is infinity where the second is <= 0. The errors are those of the calibrated d1; the
// depth of focus is c D/r and the hyperfocal depth f1 (1 + 2 r/c). Throws Error unless c is finite
// and > 0 and less than 2 r (a larger circle would contain every blur), and Error that names the
// field if the camera has no image distance or no blur ratio.
THICKLENS_EXPORT FocusLimits FocusLimitsOf(const Camera& camera, double circle_of_confusion_mm);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_DEPTH_OF_FIELD_H_

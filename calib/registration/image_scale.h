#ifndef THICKLENS_CALIB_REGISTRATION_IMAGE_SCALE_H_
#define THICKLENS_CALIB_REGISTRATION_IMAGE_SCALE_H_

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/calib/calibration.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::calib {

// Transformation between the same target points in two images: p_frame = centre + shift + scale R
// (p_reference - centre). R is a rotation; centre is a pixel given by the caller.
struct Registration {
  double scale = 1;        // > 1 where the target looks larger: geometric mean of x and y
  double scale_sigma = 0;  // standard deviation of `scale`, including the bias of the method
  double scale_x = 1, scale_y = 1;
  double rotation_rad = 0;
  Eigen::Vector2d shift_px{0, 0};
  // Third-order part of the displacement that an affine map does not describe, and its standard
  // deviation, px^-2. The displacement beyond the map at distance R from `centre` in the frame is
  // cubic R^3.
  double cubic = 0, cubic_sigma = 0;
  // Difference between the blur variance of the frame and that of the reference brought to the
  // frame's scale, px^2 of the frame. It is a rough estimate from the spectra of the tiles.
  std::optional<double> added_variance_px2;
  // Relative change of `scale` by the change of the blur over the field, which was taken out
  // (TakeOutStretchByBlur).
  std::optional<model::Estimate> stretch_by_blur;
};

// Registers `frame` to `reference`, both CV_32F and of one size. The illumination may differ by
// gain, offset and slope, and the blur may differ strongly. The method starts from `expected_scale`
// without rotation, uses ECC on shrunk images, then the phases of the cross-spectra of tiles, and
// checks the one against the other. Blur leaves the phases unchanged and therefore does not bias
// the scale. Tiles are taken at full resolution up to a shared field of 640 px; larger fields and
// blurred images are shrunk. Where the cubic term is significant, it is part of the map, and the
// scale is that at the centre. Otherwise the scale is that of the affine map alone. Returns
// std::nullopt if the two methods do not converge or disagree, if the target does not determine the
// scale (a single edge, a star of spokes), if the scales along x and y differ by more than 1.5 %,
// or if the agreement (correlation) is below 0.6. Throws Interrupted after a request to stop.
std::optional<Registration> Register(const cv::Mat& reference, const cv::Mat& frame,
                                     double expected_scale, cv::Point2d centre);

// The image scale of one frame, as input to the scale law.
struct ScaleSample {
  std::size_t frame = 0;  // index into the sweep
  double reading_mm = 0;
  double scale = 0;           // relative to the reference frame
  Registration registration;  // the registration that gave the scale
  // True on a target that looks the same at every scale. The scale was then not measured: it is the
  // depth of the reference divided by the depth of this frame, from the readings and a stated
  // offset. No law can be fitted to it.
  bool scale_is_from_reading = false;
  // Error of the relative change of scale per (scale - 1) that the samples share: what the change
  // of the blur over the field leaves open (TakeOutStretchByBlur).
  double shared_stretch_sigma = 0;
};

// Determines the law by which the scale depends on the readings (ScaleKind). If the law is 1/z,
// fits 1/scale = (offset + direction reading)/z_reference [D57], because the size on the sensor is
// proportional to 1/z along the chief rays. Offset and depth are in mm. The fit starts from
// repeated medians and continues in Ceres with a Cauchy loss on the readings, each with the error
// sqrt(reading_sigma^2 + (z scale_sigma/scale)^2). A fifth of the frames may be wrong by any
// amount. The sigma is the larger of the formal one and a delete-a-block jackknife over eight runs
// of neighbouring readings, because the errors of the law are not independent from frame to frame.
// The common error of the registrations (3e-5 of scale from end to end) and the uncertain remainder
// of radial distortion are added in quadrature. `done` is false, with the reason in `message`,
// where the samples are too few or another law holds. If `corner_radius_px` is given, the distance
// of the region's farthest corner from the optical axis, radial distortion is reported, too.
ScaleModel FitScaleModel(const std::vector<ScaleSample>& samples, int reference_frame,
                         double reading_sigma_mm, model::BenchDirection direction,
                         double corner_radius_px = 0);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_IMAGE_SCALE_H_

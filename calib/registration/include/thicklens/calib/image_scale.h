#ifndef THICKLENS_CALIB_IMAGE_SCALE_H_
#define THICKLENS_CALIB_IMAGE_SCALE_H_

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/calib/calibration.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::calib {

// Where `frame` shows what `reference` shows: p_frame = centre + shift + scale R (p_reference -
// centre), R a rotation, centre a pixel given by the caller.
struct Registration {
  double scale = 1;        // > 1 where the target looks larger: geometric mean of x and y
  double scale_sigma = 0;  // its standard deviation, bias of the method included
  double scale_x = 1, scale_y = 1;
  double rotation_rad = 0;
  Eigen::Vector2d shift_px{0, 0};
  // Third-order part of what an affine map leaves over: displacement beyond the map at distance R
  // from `centre` in the frame is cubic R^3, px^-2; with its standard deviation.
  double cubic = 0, cubic_sigma = 0;
  // By how much the variance of the frame's blur exceeds that of the reference brought to the
  // frame's scale, px^2 of the frame: roughly, as the tiles' spectra show it.
  std::optional<double> added_variance_px2;
};

// Both CV_32F, of one size; illumination may differ by gain, offset and slope, blur by much.
// Started from `expected_scale` and no rotation: ECC on shrunk pictures, then the phases of the
// cross-spectra of tiles (blur leaves phases alone, so it does not bias the scale), the one checked
// against the other. Tiles are taken at full resolution up to a shared field of 640 px, larger
// fields and soft pictures are shrunk. The cubic term is in the map, and the scale that at the
// centre, where the term is significant; else the scale is that of the affine map alone. Nothing if
// they do not converge or disagree, if the target shows no scale (a lone edge, a star of spokes),
// if the scales along x and y differ by more than 1.5 %, or the agreement (correlation) is below
// 0.6.
std::optional<Registration> Register(const cv::Mat& reference, const cv::Mat& frame,
                                     double expected_scale, cv::Point2d centre);

// One frame's place in the law.
struct ScaleSample {
  std::size_t frame = 0;  // index into the sweep
  double reading_mm = 0;
  double scale = 0;           // relative to the reference frame
  Registration registration;  // where the scale comes from
  // On a target that looks the same at every scale it was not measured: it is the depth of the
  // reference over this frame's, from the readings and a stated offset. No law can be fitted to it.
  bool scale_is_from_reading = false;
};

// Says by which law the scale goes with the readings (ScaleKind) and, where it is 1/z, fits
// 1/scale = (offset + direction reading)/z_reference [D57], the size on the sensor going as 1/z
// along the chief rays. Started by repeated medians, then Ceres with a Cauchy loss on the readings,
// each with the error sqrt(reading_sigma^2 + (z scale_sigma/scale)^2): a fifth of the frames may be
// wrong by any amount. sigma is the larger of the formal one and a delete-a-block jackknife over
// eight runs of neighbouring readings, because the law's errors are not independent from frame to
// frame; what the registrations may be wrong by together (3e-5 of scale from end to end) and the
// uncertain rest of radial distortion are added in quadrature. `done` is false, with the reason,
// where the samples are too few or the law is another one. With `corner_radius_px`, the distance of
// the region's farthest corner from the optical axis, radial distortion is reported too.
ScaleLaw FitScaleLaw(const std::vector<ScaleSample>& samples, int reference_frame,
                     double reading_sigma_mm, model::BenchDirection direction,
                     double corner_radius_px = 0);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_IMAGE_SCALE_H_

#ifndef THICKLENS_MODEL_CAMERA_H_
#define THICKLENS_MODEL_CAMERA_H_

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/model/thick_lens.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::model {

struct Sensor {
  int width_px = 0;
  int height_px = 0;
  double pixel_pitch_mm = 0;
  // The pixel where the optical axis meets the sensor; the centre of the top-left pixel is (0, 0).
  Eigen::Vector2d principal_point_px{0, 0};
  TransferCurve transfer;

  bool IsValid(std::string* why) const;
};

// Shape of the defocus point spread function for a blur radius r_defocus and blur ratio kappa.
enum class Psf {
  kGaussian,  // sigma = kappa r_defocus per axis
  kDisc,      // uniform disc of radius 2 kappa r_defocus, whose second-moment sigma is the same
};
std::string PsfName(Psf psf);

// A measured number with its standard deviation.
struct Estimate {
  double value = 0;
  double sigma = 0;
};

// What is known about a number that was typed in rather than measured.
struct Statement {
  double tolerance = 0;  // in the number's own unit; 0: none stated
  bool assumed = false;  // not published by the maker, not measured: somebody's assumption
};

// A frame that took no part in a calibration, and why.
struct RejectedFrame {
  std::string image;
  std::string reason;
};

// Where a calibration came from.
struct Evidence {
  std::string method;  // "assumed": not measured at all
  int frames_used = 0;
  std::vector<RejectedFrame> frames_rejected;
  std::optional<double> chi2_per_dof;
  std::optional<Estimate> focus_depth_mm;
  // The PSF family whose second moment blur_ratio is (a Psf's name; empty: not stated), and the
  // band of the fit, its largest 2 pi^2 sigma^2 nu^2.
  std::string blur_family;
  std::optional<double> blur_band;
  std::string data_sha256;  // over the frames' bytes and the readings
  std::string version;      // of thicklens
  std::string date;         // ISO 8601
};

// What `thicklens calibrate` adds to a camera. A parameter that did not converge is absent.
struct CameraCalibration {
  std::optional<Estimate> image_distance_mm;  // d1
  // kappa: second-moment sigma of the defocus blur of a point on the axis over the blur radius.
  std::optional<Estimate> blur_ratio;
  std::optional<Estimate> blur_floor_px;  // sqrt(S0)
  std::optional<Estimate> bench_offset_mm;
  // Covariance of the parameters named in `covariance_order`, in their units; may be empty.
  std::vector<std::string> covariance_order;
  Eigen::MatrixXd covariance;
  Evidence evidence;
};

struct Camera {
  std::string name;
  ThickLens lens;
  Sensor sensor;
  Psf psf = Psf::kGaussian;
  // Keyed by the field's path in the file, e.g. "lens.aperture_radius_mm"; an element of a list is
  // "sensor.principal_point_px[0]". Only fields about which something is stated are present.
  std::map<std::string, Statement> statements;
  std::optional<CameraCalibration> calibration;
  // What a reader should know of how the camera was read, one sentence each; not written.
  std::vector<std::string> notices;

  // True if the numbers describe a possible camera; else `why` names field, value and constraint.
  bool IsValid(std::string* why) const;

  // The calibrated values. Each throws Error naming the camera and the field where it is absent.
  double image_distance_mm() const;
  double focus_depth_mm() const;  // from image_distance_mm by [S13]
  double blur_ratio() const;

  // K/p: px per radian of the chief ray's slope in front of the lens; converts px from the
  // principal point into that slope. Needs image_distance_mm.
  double focal_scale_px() const;
};

// Names of the fields marked `assumed`, for the notice printed once per run.
std::vector<std::string> AssumedFields(const Camera& camera);

// The same camera with the thin lens of focal length f1, focused on the same plane: its image
// distance is f1 zf/(zf - f1), and rays land where they did. Needs an image distance.
Camera ThinTwin(const Camera& camera);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_CAMERA_H_

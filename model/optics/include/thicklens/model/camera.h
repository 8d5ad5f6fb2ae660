#ifndef THICKLENS_MODEL_CAMERA_H_
#define THICKLENS_MODEL_CAMERA_H_

#include <Eigen/Core>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/lens_distortion.h"
#include "thicklens/model/objective.h"
#include "thicklens/model/thick_lens.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::model {

struct MeasuredPsf;  // thicklens/model/measured_psf.h

// The sensor: its size, its pixels and the curve by which it encodes light.
struct Sensor {
  int width_px = 0;           // width, px
  int height_px = 0;          // height, px
  double pixel_pitch_mm = 0;  // p, distance between the centres of adjacent pixels, mm
  // Position where the optical axis meets the sensor. The centre of the top-left pixel is (0, 0),
  // x is to the right, y down.
  Eigen::Vector2d principal_point_px{0, 0};
  TransferCurve transfer;  // from linear light to encoded values

  // Returns true if the sizes and the pitch are > 0 and all numbers are finite. Otherwise `why`, if
  // not null, gets the field, the constraint and the value.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// Shape of the defocus point spread function (PSF) on the sensor, for the blur radius r_defocus and
// the blur ratio kappa.
enum class Psf {
  kGaussian,  // sigma = kappa r_defocus per axis
  kDisc,      // uniform disc of radius 2 kappa r_defocus; its second-moment sigma is the same
};
// Name of the shape in files: "gaussian" or "disc".
THICKLENS_EXPORT std::string PsfName(Psf psf);

// A measured number and its standard deviation, both in the unit of the field that holds them.
struct Estimate {
  double value = 0;  // the measured number
  double sigma = 0;  // its standard deviation
};

// Reliability of a number that was typed in rather than measured.
struct Provenance {
  double tolerance = 0;  // in the unit of the number; 0: no tolerance is stated
  bool assumed = false;  // true: an assumption, neither published by the maker nor measured
};

// A frame that was excluded from a calibration, and the reason.
struct RejectedFrame {
  std::string image;   // file name of the frame
  std::string reason;  // one line
};

// Origin of a calibration.
struct Evidence {
  std::string method;  // "assumed": nothing was measured
  // Whether the frames were undistorted by the camera's distortion before they were measured.
  bool undistorted = false;
  int frames_used = 0;                         // number of frames in the fit
  std::vector<RejectedFrame> frames_rejected;  // in the order of the sweep
  std::optional<double> chi2_per_dof;          // chi^2 of the blur fit per degree of freedom
  std::optional<Estimate> focus_depth_mm;      // zf from Ap, mm [S13]
  // The PSF family whose second moment defines blur_ratio (PsfName; empty: not stated), and the
  // band of the fit: its largest 2 pi^2 sigma^2 nu^2, dimensionless.
  std::string blur_family;
  std::optional<double> blur_band;  // see blur_family
  std::string data_sha256;          // hash of the bytes of the frames and of the readings
  std::string version;              // version of thicklens
  std::string date;                 // ISO 8601
};

// Name of the unit of positions in dioptres.
inline constexpr char kDioptreUnit[] = "dpt";

// The image distance of a camera whose lens or sensor moves, as a function of its position.
struct FocusPositions {
  // A position and the image distance there.
  struct Position {
    double reading = 0;            // as the scale or the drive shows it, in `unit`
    double image_distance_mm = 0;  // d1, from Ap to the sensor
  };
  std::string unit = "mm";          // of the readings: "mm", "dpt", "steps"
  std::vector<Position> positions;  // at least two, in rising order of the reading

  // d1 at a position, mm from Ap, by linear interpolation. Throws Error, which names the range, for
  // a position outside it.
  THICKLENS_EXPORT double ImageDistanceMm(double reading) const;
  // Returns whether there are enough positions, all finite, in order and with d1 > 0. Otherwise
  // `why`, if not null, gets the reason.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// The part of a camera that `thicklens calibrate` adds. A parameter that did not converge is
// absent.
struct CameraCalibration {
  std::optional<Estimate> image_distance_mm;  // d1, from Ap to the sensor
  // kappa, dimensionless: the second-moment sigma, per axis, of the defocus blur of a point on the
  // axis, divided by its blur radius.
  std::optional<Estimate> blur_ratio;
  std::optional<Estimate> blur_floor_px;    // sqrt(S0)
  std::optional<Estimate> bench_offset_mm;  // depth from Ap of reading 0, mm
  // d1 of other positions of a lens or a sensor that moves. They share the error of
  // image_distance_mm, which is that of the position at which the target was in focus.
  std::optional<FocusPositions> focus_positions;
  // Covariance matrix of the parameters that `covariance_order` names, one row and one column for
  // each, in their units. Both are empty if no covariance is known.
  std::vector<std::string> covariance_order;
  Eigen::MatrixXd covariance;  // see covariance_order
  Evidence evidence;           // what the values were measured from
};

// A thick lens with its sensor. It owns all its data; copies are independent.
struct Camera {
  std::string name;  // name for messages and reports
  ThickLens lens;    // lengths in mm from the principal planes
  // The data of a microscope objective by which the lens is stated; `lens` is LensOfObjective.
  std::optional<Objective> objective;
  // Distance from the front of the lens's barrel to Ap behind it, mm. It converts working distances
  // to depths. Absent: not stated.
  std::optional<double> aperture_behind_front_mm;
  // The distortion of frames and photographs as they come from the camera. They are undistorted by
  // it before they are used; all other members describe undistorted images. Absent: none.
  std::optional<LensDistortion> distortion;
  Sensor sensor;             // size, pitch, principal point, transfer curve
  Psf psf = Psf::kGaussian;  // shape of the defocus blur
  // The measured shape of the defocus blur (`psf: measured`), which estimates use in place of `psf`
  // with the same sigma; `psf` stands for it in closed forms. Null: none.
  std::shared_ptr<const MeasuredPsf> measured_psf;
  // The key is the path of the field in the file, e.g. "lens.aperture_radius_mm"; an element of a
  // list is "sensor.principal_point_px[0]". Only fields with a statement are present.
  std::map<std::string, Provenance> statements;
  std::optional<CameraCalibration> calibration;  // absent: not calibrated
  // Remarks on how the camera was read, one sentence each. They are not written to files.
  std::vector<std::string> notices;
  std::string source;  // the file that ReadCamera read; messages name it; not written to files

  // Returns true if the numbers describe a possible camera. Otherwise `why`, if not null, gets the
  // field, the value and the constraint.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;

  // The calibrated values. Each function throws Error, which names the camera and the field, if the
  // value is absent.
  THICKLENS_EXPORT double image_distance_mm() const;  // d1, from Ap to the sensor
  THICKLENS_EXPORT double focus_depth_mm()
      const;  // zf, from Ap; computed from image_distance_mm by [S13]
  THICKLENS_EXPORT double blur_ratio() const;  // kappa

  // K/p, px per unit slope of the chief ray in front of the lens. A position in px from the
  // principal point, divided by K/p, is that slope. Throws Error if the image distance is absent.
  THICKLENS_EXPORT double focal_scale_px() const;
};

// Paths of the fields that are marked `assumed`, for the notice that is printed once per run.
THICKLENS_EXPORT std::vector<std::string> AssumedFields(const Camera& camera);

// Copy of the camera with the thin lens of focal length f1, focused on the same plane. Its image
// distance is f1 zf/(zf - f1), and every ray has the same landing point as before. Throws Error if
// the image distance is absent.
THICKLENS_EXPORT Camera ThinLensEquivalent(const Camera& camera);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_CAMERA_H_

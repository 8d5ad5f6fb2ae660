#ifndef THICKLENS_CALIB_BLUR_MODEL_H_
#define THICKLENS_CALIB_BLUR_MODEL_H_

#include <Eigen/Core>
#include <optional>

#include "thicklens/base/export.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::calib {

THICKLENS_EXPORT bool IsDepth(double depth_mm);  // finite and in front of the camera
// Returns whether the blur of the frame was measured.
THICKLENS_EXPORT bool HasBlur(const FrameMeasurement& frame);

// Blur by the fitted law, sigma = sqrt(S0 + (kappa r_defocus/p)^2), px for each axis, without the
// pixel box. The law is exact for all depths z > 0; at z = zf it is the floor. The sweep must
// outlive the object.
class THICKLENS_EXPORT BlurModel {
 public:
  // Returns nothing if the fit gave no image distance or no blur ratio that a lens can have.
  static std::optional<BlurModel> Of(const FocusSweep& sweep, const Calibration& calibration);
  // Makes the model from one side's in-focus object distance and blur ratio, with the floor of the
  // fit.
  static std::optional<BlurModel> OfSide(const FocusSweep& sweep, const Calibration& calibration,
                                         const SideFit& side);
  // Returns the model that a simulated sweep was made with.
  static BlurModel OfTruth(const FocusSweep& sweep, const model::SweepTruth& truth);

  // Sigma of the blur per axis at a depth z > 0 from Ap, mm; px.
  double SigmaPx(double depth_mm) const;
  // Derivative d sigma/d z, px per mm: the effect of an error of the reading on the blur. It is 0
  // at z = zf.
  double SlopePxPerMm(double depth_mm) const;
  // Standard deviation of SigmaPx at a given reading, px, from the fit's covariance; nothing
  // without a covariance.
  std::optional<double> SigmaErrorPx(double depth_mm) const;
  // Measured minus predicted blur, divided by the standard deviation of both measured blur and
  // reading, for a frame of the fit.
  std::optional<double> ResidualSigmas(const FrameMeasurement& frame) const;

  // Returns whether the floor is that of the frames because the fit has none.
  bool floor_from_frames() const { return floor_from_frames_; }

 private:
  BlurModel(const FocusSweep& sweep, double image_distance_mm)
      : sweep_(&sweep), image_distance_mm_(image_distance_mm) {}

  void TakeFloor(const Calibration& calibration);
  void TakeCovariance(const Calibration& calibration);
  double SignedDefocusPx(double depth_mm) const;
  double FloorSquaredFromFrames(const Calibration& calibration) const;

  const FocusSweep* sweep_;
  double image_distance_mm_ = 0;
  double kappa_ = 0;
  double floor_squared_px2_ = 0;
  bool floor_from_frames_ = false;
  // Covariance of d1, kappa, floor and bench offset; rows of parameters that the fit's covariance
  // lacks are 0.
  std::optional<Eigen::Matrix4d> covariance_;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_BLUR_MODEL_H_

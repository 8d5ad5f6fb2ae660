#ifndef THICKLENS_CALIB_CALIBRATE_FOCUS_MOTION_H_
#define THICKLENS_CALIB_CALIBRATE_FOCUS_MOTION_H_

#include <optional>

#include "thicklens/calib/focus_sweep.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::calib {

// A sweep in which the lens or the sensor moves, as a sweep of an equivalent target [D138].
//
// With D from the rear principal plane to the sensor, z from Ap to the target, and xf, zf their
// values at focus, D = xf + s (reading - reading at focus), s = +1 or -1, and z = zf (the sensor
// moves) or z = zf - (D - xf) (the lens moves). The signed blur per aperture is c(z) of
// model::DefocusPerAperture at this D, and the image scale is proportional to D/z. A target at the
// equivalent depth
//   z' = u/(1 - c/A),  A = -dc/d ln(scale),  u = dD/d ln(scale), both at focus,
// in front of a thin lens with the magnification |A| at its in-focus object distance u shows the
// same blur in every frame. If the sensor moves, A = 1, u = xf and z' = xf^2/D, so that the scale
// is the same, too. If the lens moves, A = (1 - (f2/f1) m^2)/(1 + xf/zf), u = 1/(1/xf + 1/zf), and
// the scale is the same to second order. |dz'/d reading| is 1 at focus.
class FocusMotion {
 public:
  // The motion by xf, mm from the rear principal plane, at the reading at focus. `moves` is kLens
  // or kSensor. If the readings are focus distances, xf is that of the reading and not used.
  FocusMotion(const FocusSweep& sweep, model::SweepMotion moves, double sensor_distance_mm,
              double focus_reading_mm);

  // xf and zf, mm from the rear principal plane and from Ap.
  double SensorDistanceAtFocusMm() const { return xf_mm_; }
  double FocusDepthMm() const { return zf_mm_; }
  double focus_reading_mm() const { return focus_reading_mm_; }
  // A and u.
  double blur_per_scale() const { return a_; }
  double unit_mm() const { return u_mm_; }
  // Position of the centre of perspective of the equivalent target, mm, for the one of the camera
  // at its focus (model::CentreOfPerspectiveMm). The mean ray of a point changes its position on
  // the sensor by the factor 1 + mu c, so that 1/scale of the equivalent target has the slope (1 -
  // A mu)/u and the zero -A mu u/(1 - A mu).
  double EquivalentCentreMm(double centre_of_perspective_mm) const;
  const model::ThickLens& lens() const { return lens_; }  // of the camera
  // |dc/d reading| at focus, per mm: the blur ratio that a measured growth of the blur gives is
  // inversely proportional to it.
  double BlurGrowth() const;
  // The factor g by which a difference of the sharpest position from one part of the image to
  // another is a difference of image distances: dc/dD at focus times -xf.
  double ImageDifference() const { return g_; }

  // D and c at a reading.
  double SensorDistanceMm(double reading_mm) const;
  // Nothing for D or z that are not > 0.
  std::optional<double> DefocusPerAperture(double reading_mm) const;
  // z' at a reading, mm; nothing where no depth has this blur.
  std::optional<double> EquivalentDepthMm(double reading_mm) const;
  // The reading with a given z'; nothing if no reading near the sweep has it.
  std::optional<double> ReadingAt(double equivalent_depth_mm) const;
  // The lens of the equivalent sweep.
  model::ThickLens EquivalentLens() const;

 private:
  double ReadingOfSensorDistance(double sensor_distance_mm) const;
  double DefocusAt(double sensor_distance_mm) const;

  model::ThickLens lens_;
  model::SweepMotion moves_;
  bool are_focus_distances_;
  double sign_, focus_reading_mm_;
  double xf_mm_ = 0, zf_mm_ = 0, g_ = 1, a_ = 1, u_mm_ = 0;
};

// D of a lens focused on a depth, mm from the rear principal plane.
double SensorDistanceOf(const model::ThickLens& lens, double focus_depth_mm);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATE_FOCUS_MOTION_H_

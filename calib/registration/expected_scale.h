#ifndef THICKLENS_CALIB_REGISTRATION_EXPECTED_SCALE_H_
#define THICKLENS_CALIB_REGISTRATION_EXPECTED_SCALE_H_

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "calib/registration/image_scale.h"

namespace thicklens::calib {

// A frame that is to be registered, as far as it is known before it is taken.
struct ExpectedFrame {
  double reading_mm = 0;
  double scale = 1;           // relative to the reference
  double variance_px2 = 0;    // sigma^2 of its blur, px^2 of the frame, without the pixel box
  double relative_noise = 0;  // standard deviation of a pixel over the mean of the frame
};

// The texture and the field of a sweep that is planned.
struct ExpectedField {
  Eigen::Vector2d size_px{0, 0};    // of the frames
  Eigen::Vector2d centre_px{0, 0};  // the optical axis
  // Power density of the relative light of the target in the plane of the reference, without blur,
  // px^2 of the reference, as a function of the frequency, cycles per px of the reference.
  std::function<double(double frequency)> texture_px2;
};

// The scales that TrackScale is expected to find: those that are true, with the errors that the
// noise and the texture give the registration of each tile [D154]. Frames whose registration would
// fail are left out.
struct ExpectedScales {
  std::vector<ScaleSample> samples;  // with the errors that TrackScale states
  // For each sample, the error of its own and the change by one standard deviation of the radial
  // distortion that all frames show together, which all of them have in common.
  std::vector<double> own_sigmas, by_distortion;

  // Standard deviation of the bench offset that repeated sweeps would find from these scales and
  // readings with that error (direction away), mm. FitScaleModel states a larger one.
  double OffsetScatterMm(double reading_sigma_mm) const;
};
ExpectedScales ExpectScales(const std::vector<ExpectedFrame>& frames, std::size_t reference,
                            const ExpectedField& field);

// Distance of the farthest corner of a field from the optical axis.
double CornerRadiusPx(const ExpectedField& field);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_EXPECTED_SCALE_H_

#ifndef THICKLENS_MODEL_MEASURED_PSF_H_
#define THICKLENS_MODEL_MEASURED_PSF_H_

#include <Eigen/Core>
#include <string>

#include "thicklens/base/export.h"

namespace thicklens::model {

// The measured shape of the defocus blur, at a blur radius of 1: the image of a point beyond the
// plane of focus, which is also the light of the point over the aperture plane Ap in the
// orientation of the scene (x to the right, y down). A point nearer than the plane of focus has the
// same image turned by half a turn.
struct MeasuredPsf {
  // Shares of the light, N x N, N odd: row j and column i are the square cell of the side `step`
  // about x = (i - (N-1)/2) step, y = (j - (N-1)/2) step. Each is >= 0, and the sum is 1.
  Eigen::ArrayXXd light;
  Eigen::ArrayXXd sigma;  // standard deviation of each share; empty: not known
  double step = 0;        // side of a cell in blur radii, > 0
  std::string file;       // the file as the camera file names it; empty: none

  // Returns true if the shape is one that an estimate can use: square, of an odd size from 3 to
  // 255, finite, >= 0 with the sum 1, with its centroid within 5 % of its sigma of the middle.
  // Otherwise `why`, if not null, gets the field, the value and the constraint.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;

  // The centroid, in blur radii.
  THICKLENS_EXPORT Eigen::Vector2d Centroid() const;
  // Second-moment sigma about the centroid along x and along y, in blur radii. Each cell counts
  // with the spread of a uniform square.
  THICKLENS_EXPORT Eigen::Vector2d AxisSigmas() const;
  // The blur ratio of the shape: the root of the mean of the squares of AxisSigmas.
  THICKLENS_EXPORT double BlurRatio() const;
};

// The shape with the sum 1.
// Throws Error, which names the constraint, for shares that have no positive sum.
THICKLENS_EXPORT MeasuredPsf Normalised(MeasuredPsf psf);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_MEASURED_PSF_H_

#ifndef THICKLENS_MODEL_LENS_DISTORTION_H_
#define THICKLENS_MODEL_LENS_DISTORTION_H_

#include <Eigen/Core>
#include <string>
#include <vector>

#include "thicklens/base/export.h"

namespace thicklens::model {

// The formula of a lens distortion. Both are those of OpenCV, which computes them.
enum class DistortionModel {
  kOpenCv,   // radial polynomial or quotient, tangential, thin prism, tilted sensor
  kFisheye,  // equidistant: a polynomial in the angle of the ray (Kannala and Brandt)
};
// Name of the model in files: "opencv" or "fisheye".
THICKLENS_EXPORT std::string DistortionModelName(DistortionModel model);

// Where a lens images points, compared with an undistorted (pinhole) camera of the same camera
// matrix. The centre of the top-left pixel is (0, 0), x is to the right, y down: that is the
// convention of OpenCV and of this project. COLMAP has (0.5, 0.5) there; its reader subtracts 0.5.
//
// The formulas, where x = (u - cx)/fx and y = (v - cy)/fy of the undistorted position (u, v), px,
// and r^2 = x^2 + y^2, are
//   kOpenCv [L20]: x' = x q + 2 p1 x y + p2 (r^2 + 2 x^2) + s1 r^2 + s2 r^4,
//                  y' = y q + p1 (r^2 + 2 y^2) + 2 p2 x y + s3 r^2 + s4 r^4,
//                  q = (1 + k1 r^2 + k2 r^4 + k3 r^6)/(1 + k4 r^2 + k5 r^4 + k6 r^6),
//                  followed by the tilt of the sensor by the angles tau_x and tau_y;
//   kFisheye [L21]: (x', y') = (x, y) t/r, t = a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8), a =
//                  atan(r).
// The photograph shows the point at (fx x' + cx, fy y' + cy).
struct LensDistortion {
  DistortionModel model = DistortionModel::kOpenCv;  // the formula
  int width_px = 0, height_px = 0;           // size of the photographs that it holds for, px
  Eigen::Vector2d focal_length_px{0, 0};     // fx and fy, px
  Eigen::Vector2d principal_point_px{0, 0};  // cx and cy, px
  // kOpenCv: k1, k2, p1, p2 [, k3 [, k4, k5, k6 [, s1, s2, s3, s4 [, tau_x, tau_y]]]],
  // dimensionless and the angles in radians: 4, 5, 8, 12 or 14 numbers. kFisheye: k1 to k4.
  std::vector<double> coefficients;
  std::string source;  // where it was read from, for messages; not written to files
  // Covariance of the focal length (fx = fy), px, the principal point (cx, cy), px, and the
  // coefficients, in this order; empty: not known.
  Eigen::MatrixXd covariance = {};

  // Returns whether the numbers describe a distortion of such photographs: sizes and focal lengths
  // above 0, everything finite, the number of coefficients one of the list, the principal point
  // not farther from the image than its size, and a polynomial that does not turn back within half
  // of the way to the nearer border. Otherwise `why`, if not null, gets the field and the value.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
  // The names of rows and columns of the covariance: "focal_length_px", "principal_point_x_px",
  // "principal_point_y_px" and those of the coefficients, such as "k1".
  THICKLENS_EXPORT std::vector<std::string> CovarianceOrder() const;

  // Returns the same lens for photographs of another size of the whole field, as they come from
  // binning or scaling: pixel positions are multiplied as those of areas, c' = (c + 0.5) s - 0.5.
  // Throws Error if the aspect ratio differs by more than rounding of a size to whole pixels.
  THICKLENS_EXPORT LensDistortion ScaledTo(int width_px, int height_px) const;
  // Returns the same lens for a part of the photograph whose top-left pixel is (x, y), px.
  THICKLENS_EXPORT LensDistortion OfPart(int x, int y, int width_px, int height_px) const;

  // Returns where the photograph shows what an undistorted camera would show at this position, px.
  // It is NaN beyond the radius at which the polynomial turns back.
  THICKLENS_EXPORT Eigen::Vector2d Distorted(const Eigen::Vector2d& undistorted_px) const;
  // The largest displacement of a position in the field, px, over its border and its corners, where
  // it has a source.
  THICKLENS_EXPORT double LargestShiftPx() const;

  // One line: "OpenCV model with 5 coefficients for 4000 x 3000 px".
  THICKLENS_EXPORT std::string Description() const;
};

// Positions in a photograph for a rectangle of pixels of the undistorted image.
struct SourcePositions {
  // One per pixel of the rectangle, row by row, px in the photograph; NaN: the photograph does not
  // show this pixel.
  std::vector<float> x, y;
};
// Returns the positions for the rectangle whose top-left pixel is (x, y). Throws Error unless the
// distortion is valid.
THICKLENS_EXPORT SourcePositions SourcesOf(const LensDistortion& distortion, int x, int y,
                                           int width_px, int height_px);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_LENS_DISTORTION_H_

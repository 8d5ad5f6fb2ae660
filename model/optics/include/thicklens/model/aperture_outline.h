#ifndef THICKLENS_MODEL_APERTURE_OUTLINE_H_
#define THICKLENS_MODEL_APERTURE_OUTLINE_H_

#include <Eigen/Core>
#include <complex>
#include <string>
#include <vector>

#include "thicklens/base/export.h"

namespace thicklens::model {

// The outline of an aperture of blades. Lengths on the aperture plane Ap are in radii of the circle
// about the corners. Directions are those of the scene as the camera sees it: X right, Y down.
struct ApertureOutline {
  int blades = 0;           // number of blades, 3 to 30; 0: a round aperture
  double rotation_deg = 0;  // direction of a corner, from X toward Y
  // Bend of the blades, 0 to 1: between two corners the distance from the middle is that of the
  // straight blade plus this part of what it lacks to the circle. 0: straight; 1: a circle.
  double roundness = 0;

  // Whether the aperture is a circle.
  bool IsRound() const { return blades == 0 || roundness == 1; }
  // Returns whether all members are in their ranges. Otherwise `why`, if not null, gets the reason.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;

  // The corners, in order of the angle. Arcs are polygons whose area differs from theirs by less
  // than 5e-4.
  THICKLENS_EXPORT std::vector<Eigen::Vector2d> Corners() const;
};

// Area, centroid and central second moments (over the area) of a polygon, by Green's theorem.
struct PolygonMoments {
  double area = 0;                         // > 0 in order of the angle from X toward Y
  Eigen::Vector2d centroid{0, 0};          // centre of area
  Eigen::Matrix2d second{{0, 0}, {0, 0}};  // about the centroid
  // Root of the mean of the second moments along two axes: the sigma of a uniform blur.
  THICKLENS_EXPORT double Sigma() const;
};
// The moments of a polygon. Throws Error for fewer than three corners.
THICKLENS_EXPORT PolygonMoments MomentsOf(const std::vector<Eigen::Vector2d>& corners);

// Transform of a uniform light over a polygon, over its area: the mean of exp(-2 pi i f.x) over it,
// in closed form [D177]; 1 at f = 0. `moments` are those of the polygon, and `f` is in cycles per
// length of the corners.
THICKLENS_EXPORT std::complex<double> PolygonTransfer(const std::vector<Eigen::Vector2d>& corners,
                                                      const PolygonMoments& moments,
                                                      const Eigen::Vector2d& f);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_APERTURE_OUTLINE_H_

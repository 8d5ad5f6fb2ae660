#ifndef THICKLENS_CALIB_REGISTRATION_TILE_MAP_H_
#define THICKLENS_CALIB_REGISTRATION_TILE_MAP_H_

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/registration/tile_phases.h"

namespace thicklens::calib {

// displacement(p) = shift + linear p + cubic |p|^2 p, p from the map's centre.
struct DisplacementField {
  Eigen::Vector2d shift_px{0, 0};
  Eigen::Matrix2d linear = Eigen::Matrix2d::Zero();
  double cubic = 0;  // px^-2
  // Variances of the mean stretch (linear(0, 0) + linear(1, 1))/2 and of the cubic term, and what
  // they have in common.
  double stretch_variance = 0, cubic_variance = 0, stretch_cubic_covariance = 0;
  int tiles = 0;  // that agree with it
};

// Fits the field to the shifts of tiles, whose centres are from the map's, each with the weight of
// its own error and of what tiles scatter besides; those that do not fit lose their weight.
// `weight_variance_px2` is the tiles' own second moment: over a tile the cubic term is not what it
// is at its centre. Nothing if fewer than six tiles, or fewer than half, agree, or if they do not
// fix the map.
std::optional<DisplacementField> FitDisplacement(const std::vector<TileShift>& shifts,
                                                 double weight_variance_px2);

// displacement(p) = shift + turn (-p_y, p_x), p from the map's centre: of targets on which a change
// of scale does not show.
struct RigidDisplacement {
  Eigen::Vector2d shift_px{0, 0};
  double turn_rad = 0;
  Eigen::Matrix2d shift_covariance_px2 = Eigen::Matrix2d::Zero();
};

// As FitDisplacement.
std::optional<RigidDisplacement> FitRigid(const std::vector<TileShift>& shifts);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_TILE_MAP_H_

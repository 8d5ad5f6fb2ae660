#ifndef THICKLENS_CALIB_REGISTRATION_TILE_MAP_H_
#define THICKLENS_CALIB_REGISTRATION_TILE_MAP_H_

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/registration/tile_phases.h"

namespace thicklens::calib {

// displacement(p) = shift + linear p + cubic |p|^2 p, where p is relative to the centre of the map.
struct DisplacementField {
  Eigen::Vector2d shift_px{0, 0};
  Eigen::Matrix2d linear = Eigen::Matrix2d::Zero();
  double cubic = 0;  // px^-2
  // Variances of the mean stretch (linear(0, 0) + linear(1, 1))/2 and of the cubic term, and their
  // covariance.
  double stretch_variance = 0, cubic_variance = 0, stretch_cubic_covariance = 0;
  int tiles = 0;  // tiles that agree with the field
};

// Factor for the variances of a fit, because tiles overlap and neighbours share a part of their
// errors. It was measured on simulated sweeps, and leaves a margin.
inline constexpr double kOverlap = 1.5;

// Fits the field to the shifts of tiles, whose centres are relative to the centre of the map. Each
// tile has the weight of its own error and of the additional scatter of the tiles; outliers lose
// their weight. `weight_variance_px2` is the second moment of a tile, because the mean of the cubic
// term over a tile differs from its value at the centre. Returns std::nullopt if fewer than six
// tiles, or fewer than half of them, agree, or if they do not determine the map.
std::optional<DisplacementField> FitDisplacement(const std::vector<TileShift>& shifts,
                                                 double weight_variance_px2);

// displacement(p) = shift + turn (-p_y, p_x), where p is relative to the centre of the map. It is
// used for targets on which a change of scale is not visible.
struct RigidDisplacement {
  Eigen::Vector2d shift_px{0, 0};
  double turn_rad = 0;
  Eigen::Matrix2d shift_covariance_px2 = Eigen::Matrix2d::Zero();
};

// Fits the rigid displacement in the same way as FitDisplacement.
std::optional<RigidDisplacement> FitRigid(const std::vector<TileShift>& shifts);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_TILE_MAP_H_

#ifndef THICKLENS_CALIB_GRID_GRID_ADJUSTMENT_H_
#define THICKLENS_CALIB_GRID_GRID_ADJUSTMENT_H_

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/model/camera.h"

namespace thicklens::calib {

// The points of a grid that one image shows.
struct GridView {
  std::vector<int> ids;                   // indices of the points of the target
  std::vector<Eigen::Vector2d> image_px;  // their positions
  // Position along the motion of the sweep, mm, rising away from the camera; absent: a view that
  // may stand anywhere.
  std::optional<double> position_mm;
  // Standard deviation of the positions; it is estimated from the view's residuals unless it is
  // above 0.
  double sigma_px = 0;
};

// The points that are adjusted, and the knowledge beforehand.
struct GridSetup {
  std::vector<Eigen::Vector2d> target_mm;    // the points, relative to their mean
  double disc_radius_mm = 0;                 // above 0: the points are the centroids of discs
  std::vector<GridView> views;               // at least one, each with at least 4 points
  int width_px = 0, height_px = 0;           // of the images
  double focal_length_px = 0;                // image distance to start from
  Eigen::Vector2d principal_point_px{0, 0};  // to start from
  double reading_sigma_mm = 0;               // of the positions; 0: estimated
  // Standard deviation of the angle between the motion and the axis, rad; absent: 0.5.
  std::optional<double> alignment_rad;
  bool has_distortion = true;  // false: the distortion is held at 0
};

// Parameters that all views share, in units in which their weak prior has a standard deviation of
// about 1 or less:
//   0      ln(f/f0);
//   1, 2   (cx, cy) - (cx0, cy0), in widths of the image;
//   3 .. 7 k1, k2, p1, p2, k3, as the relative displacement of the farthest corner;
//   8 .. 13  the sheet: relative errors of its scale, of its aspect and of its right angle; sag
//          x^2, xy and y^2, at the radius of its farthest point, relative to that radius;
//   14 .. 16 rotation vector of the target in the sweep; 17 .. 19 its place at the mean position,
//          mm from the centre of perspective; 20, 21 dx/dz and dy/dz of the motion.
// The last eight exist only if views have a position.
inline constexpr int kCameraSize = 8, kSheetSize = 6, kRailAt = 14, kRailSize = 8;

// The outcome of an adjustment.
struct GridAdjustment {
  bool done = false;                                // true: it converged
  std::string message = "not run";                  // how it ended
  Eigen::VectorXd shared;                           // see above
  Eigen::MatrixXd covariance;                       // of `shared`, the weak priors included
  Eigen::VectorXd prior_sigma;                      // of `shared`; infinite: none
  bool has_motion = false;                          // the last eight of `shared` exist
  double rms_px = 0;                                // of the residuals along both axes
  int points = 0;                                   // in all views
  std::vector<double> view_rms_px;                  // of each view
  double lateral_sigma_mm = 0, axial_sigma_mm = 0;  // scatter of the stage, estimated
  double common_px = 0;  // rms of the residuals that a point has in all views: errors of the print

  // A function of `shared`, with its standard deviation by its numerical gradient.
  model::Estimate Of(const std::function<double(const Eigen::VectorXd&)>& function) const;
};

// [D160] Bundle adjustment: the views of a sweep are of one target that moves along a straight line
// at their positions, with the scatter of the stage estimated; other views stand anywhere. The
// sheet may have a wrong scale (0.3 %), be stretched, and be bent, so that none of these passes for
// a distortion of the lens. Errors of single points of the print widen the covariance.
GridAdjustment AdjustGrid(const GridSetup& setup);

// Focal length, principal point and k1, k2, p1, p2, k3 of `shared`.
Eigen::VectorXd CameraOf(const GridSetup& setup, const Eigen::VectorXd& shared);
// d CameraOf/d shared(0 .. 7).
Eigen::MatrixXd CameraGradient(const GridSetup& setup, const Eigen::VectorXd& shared);

// The pose of one view before a known camera.
struct GridPose {
  Eigen::Vector3d rotation{0, 0, 0}, place_mm{0, 0, 0};  // rotation vector; of the points' mean
  // Covariance of rotation and place for points with a standard deviation of 1 px.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  double rms_px = 0;  // of the residuals
};
GridPose FitPose(const GridSetup& setup, const Eigen::VectorXd& shared, const GridView& view);

// The plane of the target at a pose.
struct TargetPlane {
  double depth_mm = 0;         // where the axis meets it, from the centre of perspective
  double right = 0, down = 0;  // tangents of the tilts: positive where right or bottom is nearer
};
TargetPlane PlaneOfTarget(const Eigen::Vector3d& rotation, const Eigen::Vector3d& place_mm);

// The residuals' rms, px, of a view that was not part of the adjustment, with its pose fitted.
double HeldOutRms(const GridSetup& setup, const Eigen::VectorXd& shared, const GridView& view);

// Where a camera images points of a target that stands at a rotation vector and place: the
// simulation for tests, and what the adjustment compares with. Positions in px.
std::vector<Eigen::Vector2d> ProjectGrid(const GridSetup& setup, const Eigen::VectorXd& shared,
                                         const Eigen::Vector3d& rotation,
                                         const Eigen::Vector3d& place_mm);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_GRID_GRID_ADJUSTMENT_H_

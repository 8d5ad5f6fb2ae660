#ifndef THICKLENS_CALIB_EDGES_EDGE_PROFILE_H_
#define THICKLENS_CALIB_EDGES_EDGE_PROFILE_H_

#include <vector>

#include "thicklens/model/camera.h"

namespace thicklens::calib {

// Profile of a step from 0 to 1 across the edge, through a blur and the pixel's box, as a table
// over the signed distance. The table includes the derivatives that a fit needs.
class EdgeProfile {
 public:
  struct Value {
    double level = 0;         // E(d), 0 to 1
    double slope = 0;         // dE/dd, 1/px
    double per_variance = 0;  // dE/d(sigma^2), 1/px^2
  };

  // `variance_px2` is the second moment of the blur along the normal, without the pixel box;
  // `normal_rad` is the direction of the normal from the x axis. kDisc is a disc blurred by a
  // Gaussian of `floor_px`; up to the variance of that floor it is a Gaussian alone. Below 0.02
  // px^2 the profile is continued in a straight line, through 0 to negative variances, so that the
  // fit of a sharp edge meets no bound.
  EdgeProfile(model::Psf psf, double variance_px2, double floor_px, double normal_rad);

  Value At(double distance_px) const;
  // Beyond this distance the level is 0 or 1.
  double reach_px() const { return reach_px_; }

 private:
  void TabulateGaussian(double variance_px2, double normal_rad);
  void TabulateDisc(double gaussian_px2, double variance_px2, double normal_rad);
  void Allocate(double reach_px, double gaussian_px2);
  void Set(std::size_t node, const Value& value);  // sets its mirror image, too
  double Distance(std::size_t node) const { return static_cast<double>(node) * step_px_; }

  double reach_px_ = 0;
  double step_px_ = 0;
  std::size_t half_ = 0;  // nodes on each side of the node at 0
  std::vector<Value> nodes_;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_EDGES_EDGE_PROFILE_H_

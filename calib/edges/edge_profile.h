#ifndef THICKLENS_CALIB_EDGES_EDGE_PROFILE_H_
#define THICKLENS_CALIB_EDGES_EDGE_PROFILE_H_

#include <vector>

#include "thicklens/model/camera.h"

namespace thicklens::calib {

// How a step from 0 to 1 looks across itself through a blur and the pixel's box, as a table over
// the signed distance, with what a fit needs of it.
class EdgeProfile {
 public:
  struct Value {
    double level = 0;         // E(d), 0 to 1
    double slope = 0;         // dE/dd, 1/px
    double per_variance = 0;  // dE/d(sigma^2), 1/px^2
  };

  // The blur's second moment along the normal, px^2, without the pixel box; the direction of the
  // normal from the x axis. kDisc: a disc blurred by a Gaussian of `floor_px`; up to that floor's
  // variance a Gaussian alone. Below .02 px^2 the profile is continued in a straight line, down
  // through 0, so that a fit of a sharp edge meets no wall.
  EdgeProfile(model::Psf psf, double variance_px2, double floor_px, double normal_rad);

  Value At(double distance_px) const;
  // Beyond this distance the level is 0 or 1.
  double reach_px() const { return reach_px_; }

 private:
  void TabulateGaussian(double variance_px2, double normal_rad);
  void TabulateDisc(double gaussian_px2, double variance_px2, double normal_rad);
  void Allocate(double reach_px, double gaussian_px2);
  void Set(std::size_t node, const Value& value);  // and its mirror image
  double Distance(std::size_t node) const { return static_cast<double>(node) * step_px_; }

  double reach_px_ = 0;
  double step_px_ = 0;
  std::size_t half_ = 0;  // nodes on each side of the one at 0
  std::vector<Value> nodes_;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_EDGES_EDGE_PROFILE_H_

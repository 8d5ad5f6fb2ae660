#ifndef THICKLENS_ESTIMATOR_DEPTH_HOLE_TERRITORIES_H_
#define THICKLENS_ESTIMATOR_DEPTH_HOLE_TERRITORIES_H_

#include <utility>
#include <vector>

#include "estimator/depth/hole_region.h"
#include "thicklens/model/scene.h"

namespace thicklens::estimator {

// Which known pixel each pixel of a hole goes with: that to which the shortest way leads. A step
// costs its length, and more where it crosses an edge of the picture. Surfaces that meet a farther
// one pay for the width of the hole that they enter, so that the farther one takes what the picture
// leaves open: a depth sensor is blind beside near things, not on them.
class HoleTerritories {
 public:
  // `roots`: square roots of the picture's linear light, nearly as it is stored. `jump`: as in
  // HoleFinder. Both, and the finder, must outlive it.
  HoleTerritories(const HoleFinder& finder, const model::LinearPicture& roots, double jump);

  // For each pixel of the finder's last region the index of its rim pixel, and in `start` what the
  // surface of that says there.
  void Find(const HoleRegion& region, std::vector<int>* rim_of, std::vector<double>* start);

 private:
  void Spread(const HoleRegion& region, const std::vector<int>& levels, std::vector<int>* rim_of);
  void Start(const HoleRegion& region, const std::vector<int>& rim_of,
             std::vector<double>* start) const;
  std::vector<int> LevelsOf(const HoleRegion& region, const std::vector<int>& rim_of,
                            const std::vector<double>& start);
  float StepCost(int from, int to, bool diagonal) const;
  void FindWidths(const HoleRegion& region);

  const HoleFinder& finder_;
  const model::LinearPicture& roots_;
  const double jump_;
  double edge_cost_ = 0;  // of a squared step of the roots
  struct Waiting {
    float cost;
    int place;
  };
  std::vector<std::vector<Waiting>> waiting_;  // by their cost
  std::vector<float> cost_;
  std::vector<std::pair<int, int>> near_and_far_;  // groups that meet
  std::vector<int> width_px_;                      // of the hole around each pixel
};

// What the surface of a rim pixel says at another pixel: its plane, if that explains its rim to
// within a jump, else its own disparity.
double SurfaceAt(const HoleFinder& finder, const HoleRegion& region, const RimPixel& rim, int pixel,
                 double jump);
bool HasPlane(const HoleRegion& region, const RimPixel& rim, double jump);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_DEPTH_HOLE_TERRITORIES_H_

#ifndef THICKLENS_ESTIMATOR_DEPTH_GEODESIC_VORONOI_LABELS_H_
#define THICKLENS_ESTIMATOR_DEPTH_GEODESIC_VORONOI_LABELS_H_

#include <utility>
#include <vector>

#include "estimator/depth/hole_region.h"
#include "thicklens/model/scene.h"

namespace thicklens::estimator {

// Assigns each pixel of a hole to a known pixel: the one with the shortest path. The cost of a step
// is its length, and more where it crosses an edge of the image. A surface that meets a farther one
// also pays for the width of the hole that it enters, so that the farther surface takes the pixels
// that the image leaves undecided: a depth sensor loses values beside near objects, not on them.
class GeodesicVoronoiLabels {
 public:
  // `roots`: square roots of the image's linear light, nearly equal to its encoded values. `jump`:
  // as in HoleFinder. `finder` and `roots` must outlive the object.
  GeodesicVoronoiLabels(const HoleFinder& finder, const model::LinearImage& roots, double jump);

  // Sets, for each pixel of the finder's last region, the index of its rim pixel and in `start` the
  // disparity of that rim pixel's surface there.
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
  const model::LinearImage& roots_;
  const double jump_;
  double edge_cost_ = 0;  // cost of a squared step of the roots
  struct Waiting {
    float cost;
    int place;
  };
  std::vector<std::vector<Waiting>> waiting_;  // ordered by cost
  std::vector<float> cost_;
  std::vector<std::pair<int, int>> near_and_far_;  // groups that meet
  std::vector<int> width_px_;                      // width of the hole around each pixel
};

// Returns the disparity of a rim pixel's surface at another pixel: that of its plane if the plane
// explains its rim to within a jump, otherwise the rim pixel's own disparity.
double SurfaceAt(const HoleFinder& finder, const HoleRegion& region, const RimPixel& rim, int pixel,
                 double jump);
bool HasPlane(const HoleRegion& region, const RimPixel& rim, double jump);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_DEPTH_GEODESIC_VORONOI_LABELS_H_

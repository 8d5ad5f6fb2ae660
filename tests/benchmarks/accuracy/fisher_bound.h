#ifndef THICKLENS_TESTS_BENCHMARKS_ACCURACY_FISHER_BOUND_H_
#define THICKLENS_TESTS_BENCHMARKS_ACCURACY_FISHER_BOUND_H_

#include "thicklens/model/sweep_simulator.h"

namespace thicklens::accuracy {

// Standard deviations.
struct Bound {
  double focus_depth_mm = 0;
  double image_distance_mm = 0;
  double relative_blur_ratio = 0;  // of kappa over kappa
};

// What no unbiased calibration of a sweep of an unknown texture can do better than, each cause
// alone, all else known exactly.
struct FisherBounds {
  Bound floor;     // the floor's variance is known to a standard deviation
  Bound readings;  // readings err by their sigma; the blur of every frame is known exactly
  Bound scaled;    // the same, and the image scale of every frame is known exactly too
  Bound together;  // floor and `scaled`
};
FisherBounds BoundsOf(const model::SweepSimulationOptions& options, double floor_sigma_px2);

}  // namespace thicklens::accuracy

#endif  // THICKLENS_TESTS_BENCHMARKS_ACCURACY_FISHER_BOUND_H_

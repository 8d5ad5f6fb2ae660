#ifndef THICKLENS_TESTS_BENCHMARKS_ACCURACY_FISHER_BOUND_H_
#define THICKLENS_TESTS_BENCHMARKS_ACCURACY_FISHER_BOUND_H_

#include "thicklens/model/sweep_simulator.h"

namespace thicklens::accuracy {

// Standard deviations.
struct Bound {
  double focus_depth_mm = 0;
  double image_distance_mm = 0;
  double relative_blur_ratio = 0;  // sigma of kappa, divided by kappa
};

// Lower bounds on the errors of every unbiased calibration of a sweep of an unknown texture. Each
// bound has one cause of error alone; everything else is known exactly.
struct FisherBounds {
  Bound floor;     // the variance of the floor is known with a standard deviation
  Bound readings;  // the readings have their sigma; the blur of every frame is known exactly
  Bound scaled;    // as for `readings`, and the image scale of every frame is known exactly, too
  Bound together;  // the errors of `floor` and `scaled` together
};
FisherBounds BoundsOf(const model::SweepSimulationOptions& options, double floor_sigma_px2);

}  // namespace thicklens::accuracy

#endif  // THICKLENS_TESTS_BENCHMARKS_ACCURACY_FISHER_BOUND_H_

#ifndef THICKLENS_TESTS_ESTIMATOR_SOLVER_INPUTS_H_
#define THICKLENS_TESTS_ESTIMATOR_SOLVER_INPUTS_H_

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <functional>
#include <stdexcept>

#include "thicklens/estimator/estimate_input.h"
#include "thicklens/estimator/solver_run.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::estimator::testing {

// Inputs that the tests of several solvers share.

Eigen::ArrayXXd GaussianWeights(int u_count, int v_count);

// An image of uniform noise from 0.1 to 0.9, which has texture everywhere, with the disparity of
// each pixel, px per view step.
EstimateInput NoiseInput(int width_px, int height_px, int channels, const Eigen::ArrayXXd& weights,
                         const std::function<double(int x, int y)>& disparity, unsigned seed = 1);

// Returns the input as testing::SolverCamera would see it, with a grid on these planes and the
// depth of each column. If the ST plane is not the plane of focus, rays land between the pixels.
EstimateInput WithSolverCamera(EstimateInput input, const model::LightFieldPlanes& planes,
                               const std::function<double(int x)>& depth_mm);

// The steps that `solve` reports never go back and end with their total, which is returned; an
// exception of the report leaves the solver. `solve` takes the run.
template <typename Solve>
int ExpectStepsAreReported(const Solve& solve) {
  SolverRun run;
  int last = 0, total = 0;
  run.progress = [&](int done, int of) {
    EXPECT_GE(done, last);
    EXPECT_LE(done, of);
    last = done;
    total = of;
  };
  solve(run);
  EXPECT_EQ(last, total);
  run.progress = [](int done, int of) {
    if (2 * done > of) throw std::runtime_error("enough");
  };
  EXPECT_THROW(solve(run), std::runtime_error);
  return total;
}

}  // namespace thicklens::estimator::testing

#endif  // THICKLENS_TESTS_ESTIMATOR_SOLVER_INPUTS_H_

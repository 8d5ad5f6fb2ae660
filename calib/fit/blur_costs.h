#ifndef THICKLENS_CALIB_FIT_BLUR_COSTS_H_
#define THICKLENS_CALIB_FIT_BLUR_COSTS_H_

#include <ceres/cost_function.h>

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "calib/fit/blur_residuals.h"
#include "calib/fit/variable_projection.h"

namespace thicklens::calib {

// The cost that Ceres minimises: all residuals of a fit of the blur, with the readings' errors
// eliminated. Its blocks are global, c of each estimator, and the scale's law if there are scales;
// Blocks puts them in this order.
class BlurCost : public ceres::CostFunction {
 public:
  // The errors in `start` are the start of the first search for the best errors.
  BlurCost(const BlurResiduals& residuals, BlurParameters start);

  static std::vector<double*> Blocks(const BlurResiduals& residuals, BlurParameters* parameters);

  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override;

 private:
  BlurParameters At(double const* const* blocks) const;

  const BlurResiduals& residuals_;
  // Ceres requests derivatives at accepted points. The next errors are sought from there, not from
  // the errors of a step that failed.
  mutable BlurParameters accepted_;
  mutable BlurParameters last_;  // Ceres requests the values of a step and then its derivatives
};

// The residual (S0 - value)/sigma of a given floor. Its block is global.
class FloorCost : public ceres::CostFunction {
 public:
  explicit FloorCost(const model::Estimate& floor_variance_px2);
  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override;

 private:
  model::Estimate floor_;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_BLUR_COSTS_H_

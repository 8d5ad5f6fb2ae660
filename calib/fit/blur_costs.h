#ifndef THICKLENS_CALIB_FIT_BLUR_COSTS_H_
#define THICKLENS_CALIB_FIT_BLUR_COSTS_H_

#include <ceres/cost_function.h>

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "calib/fit/blur_residuals.h"
#include "calib/fit/error_elimination.h"

namespace thicklens::calib {

// What Ceres makes small: all residuals of a fit of the blur, with the readings' errors eliminated.
// Blocks: global, c of each meter, the scale's law if there are scales (Blocks puts them in order).
class BlurCost : public ceres::CostFunction {
 public:
  // The errors in `start` are where the first search for the best errors begins.
  BlurCost(const BlurResiduals& residuals, BlurParameters start);

  static std::vector<double*> Blocks(const BlurResiduals& residuals, BlurParameters* parameters);

  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override;

 private:
  BlurParameters At(double const* const* blocks) const;

  const BlurResiduals& residuals_;
  // Derivatives are asked for at points that were accepted: from there the next errors are sought,
  // not from those of a step that failed.
  mutable BlurParameters accepted_;
  mutable BlurParameters last_;  // Ceres asks for the values of a step and then for derivatives
};

// (S0 - value)/sigma of a floor that is given. Block: global.
class FloorCost : public ceres::CostFunction {
 public:
  explicit FloorCost(const model::Estimate& floor_variance_px2);
  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override;

 private:
  model::Estimate floor_;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_BLUR_COSTS_H_

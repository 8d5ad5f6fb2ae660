#include "calib/fit/blur_costs.h"

#include <algorithm>
#include <utility>

namespace thicklens::calib {
namespace {

bool IsSamePoint(const BlurParameters& a, const BlurParameters& b) {
  return a.global == b.global && a.softness_px2 == b.softness_px2 && a.scale_model == b.scale_model;
}

}  // namespace

BlurCost::BlurCost(const BlurResiduals& residuals, BlurParameters start)
    : residuals_(residuals), accepted_(std::move(start)), last_(accepted_) {
  last_.global[kFocusDepth] = -1;  // no point yet
  set_num_residuals(static_cast<int>(residuals.rows()));
  *mutable_parameter_block_sizes() = {kBlurParameters};
  mutable_parameter_block_sizes()->resize(1 + accepted_.softness_px2.size(), 1);
  if (residuals.has_scales()) mutable_parameter_block_sizes()->push_back(3);
}

std::vector<double*> BlurCost::Blocks(const BlurResiduals& residuals, BlurParameters* parameters) {
  std::vector<double*> blocks = {parameters->global.data()};
  for (double& softness : parameters->softness_px2) blocks.push_back(&softness);
  if (residuals.has_scales()) blocks.push_back(parameters->scale_model.data());
  return blocks;
}

BlurParameters BlurCost::At(double const* const* blocks) const {
  BlurParameters point = accepted_;
  point.global = Eigen::Map<const Eigen::Vector4d>(blocks[0]);
  for (std::size_t m = 0; m < point.softness_px2.size(); ++m)
    point.softness_px2[m] = *blocks[1 + m];
  if (residuals_.has_scales())
    point.scale_model = Eigen::Map<const Eigen::Vector3d>(blocks[1 + point.softness_px2.size()]);
  return point;
}

bool BlurCost::Evaluate(double const* const* blocks, double* residuals, double** jacobians) const {
  BlurParameters point = At(blocks);
  if (IsSamePoint(point, last_)) {
    point = last_;
  } else if (!SolveErrors(residuals_, &point)) {
    return false;
  }
  last_ = point;
  if (jacobians == nullptr) {
    Eigen::Map<Eigen::VectorXd>(residuals, residuals_.rows()) =
        residuals_.Values(*residuals_.At(point));
    return true;
  }
  accepted_ = point;
  const ReducedProblem reduced = Reduce(residuals_, point);
  Eigen::Map<Eigen::VectorXd>(residuals, residuals_.rows()) = reduced.values;
  Eigen::Index column = 0;
  for (std::size_t b = 0; b < parameter_block_sizes().size(); ++b) {
    const int size = parameter_block_sizes()[b];
    if (jacobians[b] != nullptr) {
      using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
      if (size == 1) {
        Eigen::Map<Eigen::VectorXd>(jacobians[b], residuals_.rows()) = reduced.jacobian.col(column);
      } else {
        Eigen::Map<RowMajor>(jacobians[b], residuals_.rows(), size) =
            reduced.jacobian.middleCols(column, size);
      }
    }
    column += size;
  }
  return true;
}

FloorCost::FloorCost(const model::Estimate& floor_variance_px2) : floor_(floor_variance_px2) {
  set_num_residuals(1);
  *mutable_parameter_block_sizes() = {kBlurParameters};
}

bool FloorCost::Evaluate(double const* const* blocks, double* residuals, double** jacobians) const {
  residuals[0] = (blocks[0][kFloorVariance] - floor_.value) / floor_.sigma;
  if (jacobians != nullptr && jacobians[0] != nullptr) {
    std::fill_n(jacobians[0], kBlurParameters, 0.0);
    jacobians[0][kFloorVariance] = 1 / floor_.sigma;
  }
  return true;
}

}  // namespace thicklens::calib

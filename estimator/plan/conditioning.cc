#include "thicklens/estimator/conditioning.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>
#include <cstddef>
#include <limits>
#include <random>
#include <vector>

#include "estimator/blocks/block_system.h"
#include "estimator/projection/scene_projection.h"
#include "estimator/projection/scene_rays.h"
#include "estimator/views/input_checks.h"
#include "estimator/views/ray_landing.h"
#include "thicklens/base/error.h"
#include "thicklens/kernels/aperture_prior.h"
#include "thicklens/kernels/kernels.h"

namespace thicklens::estimator {
namespace {

using Eigen::Index;

void RequireFew(double unknowns) {
  constexpr double kMax = 4000;
  if (unknowns <= kMax) return;
  throw Error(
      fmt::format("conditioning: the system has {:.0f} unknowns: a dense system may have at most "
                  "{:.0f}; use a smaller image or fewer views",
                  unknowns, kMax));
}

// Solves a system in that precision and returns the relative error of the solution.
template <typename Real>
std::optional<double> ErrorOf(const Eigen::MatrixXd& matrix, bool symmetric) {
  using Matrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
  using Vector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;
  std::mt19937 engine(1);
  Eigen::VectorXd truth(matrix.rows());
  for (Index i = 0; i < truth.size(); ++i)
    truth[i] = static_cast<double>(engine()) / 4294967296.0 - 0.5;
  const Matrix rounded = matrix.cast<Real>();
  const Vector right = (matrix * truth).cast<Real>();
  Vector found;
  if (symmetric) {
    const Eigen::LLT<Matrix> factor(rounded);
    if (factor.info() != Eigen::Success) return std::nullopt;
    found = factor.solve(right);
  } else {
    found = rounded.partialPivLu().solve(right);
  }
  const double error = (found.template cast<double>() - truth).norm() / truth.norm();
  if (!std::isfinite(error)) return std::nullopt;
  return error;
}

Conditioning ConditioningOf(const Eigen::MatrixXd& matrix, bool symmetric) {
  Conditioning conditioning;
  conditioning.unknowns = static_cast<int>(matrix.rows());
  if (symmetric) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(matrix, Eigen::EigenvaluesOnly);
    conditioning.smallest = solver.eigenvalues().minCoeff();
    conditioning.largest = solver.eigenvalues().maxCoeff();
  } else {
    const Eigen::BDCSVD<Eigen::MatrixXd> solver(matrix);
    conditioning.smallest = solver.singularValues().minCoeff();
    conditioning.largest = solver.singularValues().maxCoeff();
  }
  conditioning.float_error = ErrorOf<float>(matrix, symmetric);
  conditioning.double_error = ErrorOf<double>(matrix, symmetric);
  return conditioning;
}

Eigen::MatrixXd Dense(const kernels::CsrMatrix<double>& sparse) {
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(sparse.rows, sparse.columns);
  for (int row = 0; row < sparse.rows; ++row) {
    const auto at = static_cast<std::size_t>(row);
    for (auto e = sparse.row_start[at]; e < sparse.row_start[at + 1]; ++e) {
      const auto entry = static_cast<std::size_t>(e);
      dense(row, sparse.column[entry]) += sparse.value[entry];
    }
  }
  return dense;
}

}  // namespace

double Conditioning::condition() const {
  return smallest > 0 ? largest / smallest : std::numeric_limits<double>::infinity();
}

Conditioning ConditioningOfBlock(const EstimateInput& input, const BlockOptions& options) {
  std::string why;
  if (!options.IsValid(&why)) throw Error("conditioning: " + why);
  CheckInput(input);
  const auto views = static_cast<double>(input.weights.size());
  RequireFew(views * static_cast<double>(input.disparity.disparity.size()));
  const RayField rays(input, options.falloff, 1);
  const auto kernels = kernels::NewReference<double>();
  const BlockSystem system =
      MakeBlockSystem(rays, rays.Block(0, 0, input.image.width_px, input.image.height_px), options,
                      options.ridge.value_or(1e-2 / views), kernels.get());
  return ConditioningOf(Dense(system.matrix), options.stencil == Stencil::kWarp);
}

Conditioning ConditioningOfSceneRays(const EstimateInput& input, const FunctionalOptions& options) {
  std::string why;
  if (!options.IsValid(&why)) throw Error("conditioning: " + why);
  CheckInput(input);
  RequireFew(static_cast<double>(input.disparity.disparity.size()));
  const Eigen::Vector2d landing_step_px =
      input.grid ? LandingStepPx(*input.camera, *input.grid) : Eigen::Vector2d::Zero();
  SceneRays<double> rays(PhotographDisparity(input.disparity, landing_step_px), input.weights, 1,
                         [] {});
  const double ridge = options.ridge.value_or(1e-2 / static_cast<double>(input.weights.size()));
  kernels::AperturePrior<double> prior(static_cast<int>(input.weights.cols()),
                                       static_cast<int>(input.weights.rows()), options.gamma,
                                       ridge);
  const std::size_t pixels = rays.pixels(), stride = rays.plane_stride();
  constexpr std::size_t kPacket = kernels::AperturePrior<double>::kPacket;
  const std::size_t points = (pixels + kPacket - 1) / kPacket * kPacket;
  std::vector<double> planes(stride * rays.view_count()), unit(stride), column(stride);
  Eigen::MatrixXd matrix(static_cast<Index>(pixels), static_cast<Index>(pixels));
  for (std::size_t i = 0; i < pixels; ++i) {
    unit.assign(stride, 0.0);
    unit[i] = 1;
    rays.ApplyTransposed(unit.data(), planes.data());
    prior.ApplyInverse(points, stride, 1, planes.data());
    rays.Apply(planes.data(), stride, column.data());
    column[i] += 1;
    matrix.col(static_cast<Index>(i)) =
        Eigen::Map<const Eigen::VectorXd>(column.data(), static_cast<Index>(pixels));
  }
  return ConditioningOf((matrix + matrix.transpose()) / 2, true);
}

}  // namespace thicklens::estimator

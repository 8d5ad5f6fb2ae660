// The linear system of one block as the solvers get it.
#include "estimator/blocks/block_system.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "estimator/blocks/linear_solver.h"
#include "thicklens/kernels/device.h"

namespace thicklens::estimator {
namespace {

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

// A slanted background with a nearer patch: blur, links between views, and links that are cut.
EstimateInput PatchBeforeASlant() {
  constexpr int kWidth = 23, kHeight = 19;
  EstimateInput input;
  input.image = {kWidth, kHeight, 3, {}};
  std::mt19937 engine(3);
  std::uniform_real_distribution<float> uniform(0, 1);
  input.image.values.resize(Index(kWidth * kHeight * 3));
  for (float& value : input.image.values) value = uniform(engine);
  input.disparity.width_px = kWidth;
  input.disparity.height_px = kHeight;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool patch = x > 8 && x < 15 && y > 5 && y < 12;
      input.disparity.disparity.push_back(patch ? 1.6F : -0.9F + 0.06F * static_cast<float>(x));
    }
  }
  input.weights = model::ApertureWeights(model::ApertureShape::kGaussian, 5, 3);
  return input;
}

double RelativeDifference(const std::vector<double>& a, const std::vector<double>& b) {
  const auto map = [](const std::vector<double>& v) {
    return Eigen::Map<const Eigen::VectorXd>(v.data(), static_cast<Eigen::Index>(v.size()));
  };
  EXPECT_EQ(a.size(), b.size());
  return (map(a) - map(b)).norm() / map(b).norm();
}

class BlockSystemTest : public ::testing::TestWithParam<Stencil> {
 protected:
  BlockSystem SystemOn(kernels::Backend* backend) const {
    BlockOptions options;
    options.stencil = GetParam();
    const auto kernels = backend->NewDouble();
    return MakeBlockSystem(rays_, rays_.Block(3, 2, 17, 13), options, 1e-2 / 15, kernels.get());
  }
  static std::shared_ptr<kernels::Backend> Open(const char* device) {
    return kernels::OpenBackend(kernels::ParseDeviceRequest(device), nullptr);
  }

  const EstimateInput input_ = PatchBeforeASlant();
  const RayField rays_{input_, false, 1};
};

TEST_P(BlockSystemTest, DeviceAndReferenceMakeTheSameSystem) {
  const BlockSystem there = SystemOn(Open("opencl").get());
  const BlockSystem here = SystemOn(Open("cpu").get());
  EXPECT_EQ(there.matrix.column, here.matrix.column);
  EXPECT_EQ(there.matrix.row_start, here.matrix.row_start);
  EXPECT_LT(RelativeDifference(there.matrix.value, here.matrix.value), 1e-10);
  for (std::size_t channel = 0; channel < 3; ++channel) {
    EXPECT_LT(RelativeDifference(there.right_sides[channel], here.right_sides[channel]), 1e-10);
  }
}

TEST_P(BlockSystemTest, AllSolversFindTheSameLightField) {
  const BlockSystem system = SystemOn(Open("cpu").get());
  std::vector<double> first;
  for (const BlockSolver kind :
       {BlockSolver::kEigen, BlockSolver::kUmfpack, BlockSolver::kCholmod}) {
    const bool symmetric = GetParam() == Stencil::kWarp;
    if (!IsBuiltIn(kind) || (kind == BlockSolver::kCholmod && !symmetric)) continue;
    SCOPED_TRACE(BlockSolverName(kind));
    const auto solver = NewLinearSolver(kind, symmetric);
    solver->Factorize(system.matrix);
    const std::vector<double> found = solver->Solve(system.right_sides[1]);
    EXPECT_LT(RelativeResidual(system.matrix, found, system.right_sides[1]), 1e-12);
    if (first.empty()) first = found;
    EXPECT_LT(RelativeDifference(found, first), 1e-8);
  }
}

TEST_P(BlockSystemTest, IsSymmetricForTheWarpAlone) {
  const BlockSystem system = SystemOn(Open("cpu").get());
  const kernels::CsrMatrix<double> transposed = kernels::Transpose(system.matrix);
  double largest = 1;  // where even the patterns differ
  if (transposed.column == system.matrix.column) {
    largest = 0;
    for (std::size_t i = 0; i < transposed.value.size(); ++i) {
      largest = std::max(largest, std::abs(transposed.value[i] - system.matrix.value[i]));
    }
  }
  if (GetParam() == Stencil::kWarp) {
    EXPECT_LT(largest, 1e-14);
  } else {
    EXPECT_GT(largest, 1e-3);
  }
}

INSTANTIATE_TEST_SUITE_P(Stencils, BlockSystemTest,
                         ::testing::Values(Stencil::kWarp, Stencil::kSource),
                         [](const auto& test) { return StencilName(test.param); });

// A ray is linked to the next view only where that view shows its scene point.
TEST(RayField, CutsLinksAtOcclusions) {
  const EstimateInput input = PatchBeforeASlant();
  const RayField rays(input, false, 1);
  const kernels::BlockGeometry block = rays.Block(0, 0, 23, 19);
  const RayField::Slopes all = rays.SlopesOf(block, false);
  const RayField::Slopes linked = rays.SlopesOf(block, true);
  const auto ray_at = [](int x, int y, int k, int l) {
    return Index(((l * 5 + k) * 19 + y) * 23 + x);
  };
  // In the middle view (2, 1), going right: the patch (disparity 1.6) moves left by 1.6.
  EXPECT_NEAR(all.u[ray_at(11, 8, 2, 1)], -1.6, 1e-6);
  EXPECT_NEAR(linked.u[ray_at(11, 8, 2, 1)], -1.6, 1e-6);
  // The background just left of the patch is hidden by it in the next view.
  EXPECT_LT(std::abs(all.u[ray_at(8, 8, 2, 1)]), 1);
  EXPECT_TRUE(std::isnan(linked.u[ray_at(8, 8, 2, 1)]));
  // Far from it nothing is cut, but in the last view there is no next one.
  EXPECT_FALSE(std::isnan(linked.u[ray_at(4, 3, 2, 1)]));
  EXPECT_TRUE(std::isnan(linked.u[ray_at(4, 3, 4, 1)]));
  EXPECT_TRUE(std::isnan(linked.v[ray_at(4, 3, 2, 2)]));
}

}  // namespace
}  // namespace thicklens::estimator

// Statements of the paper about the smoothness operator G that do not hold, each shown on a light
// field small enough to be examined completely.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cstdint>
#include <vector>

#include "thicklens/kernels/kernels.h"

namespace thicklens::estimator {
namespace {

using kernels::BlockGeometry;
using kernels::EllMatrix;

BlockGeometry Block(int width, int height, int u_count, int v_count) {
  BlockGeometry block;
  block.width_px = block.s_count = width;
  block.height_px = block.t_count = height;
  block.u_count = u_count;
  block.v_count = v_count;
  block.s_shift.assign(static_cast<std::size_t>(u_count), 0);
  block.t_shift.assign(static_cast<std::size_t>(v_count), 0);
  block.s_fraction.assign(static_cast<std::size_t>(u_count), 0.0);
  block.t_fraction.assign(static_cast<std::size_t>(v_count), 0.0);
  block.view_weight.assign(static_cast<std::size_t>(u_count * v_count), 1.0 / (u_count * v_count));
  return block;
}

Eigen::MatrixXd ToDense(const EllMatrix<double>& ell) {
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(ell.rows, ell.columns);
  for (int slot = 0; slot < ell.slots; ++slot) {
    for (int row = 0; row < ell.rows; ++row) {
      const auto entry = static_cast<std::size_t>(slot) * static_cast<std::size_t>(ell.rows) +
                         static_cast<std::size_t>(row);
      if (ell.column[entry] >= 0) dense(row, ell.column[entry]) += ell.value[entry];
    }
  }
  return dense;
}

std::vector<double> Constant(const BlockGeometry& block, double slope) {
  return std::vector<double>(static_cast<std::size_t>(block.rays()), slope);
}

// A slope that differs from sample to sample, the same in all views.
std::vector<double> Slanted(const BlockGeometry& block) {
  std::vector<double> slopes;
  for (int ray = 0; ray < block.rays(); ++ray) slopes.push_back(0.2 * (ray % block.width_px));
  return slopes;
}

Eigen::MatrixXd WarpD(const BlockGeometry& block, const std::vector<double>& slopes) {
  return ToDense(kernels::NewReference<double>()->WarpDifferences(block, slopes, slopes));
}

Eigen::MatrixXd SixTerms(const BlockGeometry& block, const std::vector<double>& slopes) {
  return ToDense(kernels::NewReference<double>()->SixTermMasks(block, slopes, slopes));
}

Eigen::MatrixXd ProjectionH(const BlockGeometry& block) {
  const auto reference = kernels::NewReference<double>();
  return ToDense(reference->WeightRays(block, kernels::Splat::kNearest,
                                       reference->FindRays(block, kernels::Splat::kNearest), {}));
}

Eigen::Index RankOf(const Eigen::MatrixXd& matrix) {
  Eigen::FullPivLU<Eigen::MatrixXd> lu(matrix);
  lu.setThreshold(1e-10);
  return lu.rank();
}

// Supplement, section 3, [S19], [S20], [S21]: "H has linearly independent columns, then it is
// invertible" (H^t H).
TEST(SourceErrors, WithGammaZeroTheRankIsThatOfTheImage) {
  const BlockGeometry block = Block(6, 5, 3, 3);
  const Eigen::MatrixXd h = ProjectionH(block);
  EXPECT_EQ(h.cols(), 270);
  EXPECT_EQ(RankOf(h.transpose() * h), 30);
}

// Supplement, section 3, [S22] and [S24]: "the matrix -G ... gives a matrix of rank six. Moreover,
// this matrix is non-singular." Nothing beyond six unknowns can be both; with free ends it is
// neither.
TEST(SourceErrors, GIsNeitherOfRankSixNorRegular) {
  const BlockGeometry block = Block(6, 5, 3, 3);
  for (const double slope : {0.0, 0.5, 1.0}) {
    const Eigen::MatrixXd d = WarpD(block, Constant(block, slope));
    const Eigen::MatrixXd g = d.transpose() * d;
    EXPECT_GT(RankOf(g), 6);
    EXPECT_LT(RankOf(g), g.rows());
    EXPECT_LT((d * Eigen::VectorXd::Ones(d.cols())).norm(), 1e-12) << "constants are in its null";
  }
  const Eigen::MatrixXd six = SixTerms(block, Constant(block, 0.5));
  EXPECT_GT(RankOf(six), 6);
  EXPECT_LT(RankOf(six), six.rows());
}

// A stencil that reads zero outside of the grid is regular, as the paper claims, but darkens the
// borders. The test compares it with the same masks, cut out of a grid that continues beyond the
// borders.
TEST(SourceErrors, AStencilThatReadsZeroOutsideDarkensTheBorders) {
  const BlockGeometry block = Block(6, 6, 3, 3);
  const BlockGeometry large = Block(8, 8, 5, 5);
  const Eigen::MatrixXd g_large = SixTerms(large, Constant(large, 0.5));
  std::vector<int> inner;
  for (int l = 1; l < 4; ++l) {
    for (int k = 1; k < 4; ++k) {
      for (int y = 1; y < 7; ++y) {
        for (int x = 1; x < 7; ++x) inner.push_back(((l * 5 + k) * 8 + y) * 8 + x);
      }
    }
  }
  Eigen::MatrixXd g(block.rays(), block.rays());
  for (int i = 0; i < block.rays(); ++i) {
    for (int j = 0; j < block.rays(); ++j) {
      g(i, j) = g_large(inner[static_cast<std::size_t>(i)], inner[static_cast<std::size_t>(j)]);
    }
  }
  EXPECT_EQ(RankOf(g), g.rows());

  const Eigen::MatrixXd h = ProjectionH(block);
  const auto solve = [&](const Eigen::MatrixXd& smoothness, double ridge) {
    const Eigen::MatrixXd system =
        h.transpose() * h - smoothness + ridge * Eigen::MatrixXd::Identity(h.cols(), h.cols());
    const Eigen::VectorXd white =
        h.transpose() * Eigen::VectorXd::Ones(h.rows()) + ridge * Eigen::VectorXd::Ones(h.cols());
    return Eigen::VectorXd(system.partialPivLu().solve(white));
  };
  const Eigen::VectorXd dark = solve(g, 0);
  EXPECT_LT(dark(0), 0.5) << "a white image's corner ray";
  const Eigen::VectorXd white = solve(SixTerms(block, Constant(block, 0.5)), 1e-3);
  EXPECT_NEAR(white.minCoeff(), 1, 1e-9);
}

// If the depth differs from ray to ray, six explicit differences form no symmetric operator and so
// are not the gradient of any energy. D^T D is symmetric and has no negative eigenvalue.
TEST(SourceErrors, ExplicitDifferencesAreNotSymmetricWhereTheDepthVaries) {
  const BlockGeometry block = Block(6, 5, 3, 3);
  const Eigen::MatrixXd flat = SixTerms(block, Constant(block, 0.5));
  const Eigen::MatrixXd slanted = SixTerms(block, Slanted(block));
  EXPECT_LT((flat - flat.transpose()).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_GT((slanted - slanted.transpose()).cwiseAbs().maxCoeff(), 0.1);

  const Eigen::MatrixXd d = WarpD(block, Slanted(block));
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> energies(d.transpose() * d);
  EXPECT_GT(energies.eigenvalues().minCoeff(), -1e-12);
}

}  // namespace
}  // namespace thicklens::estimator

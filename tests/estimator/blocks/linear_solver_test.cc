#include "estimator/blocks/linear_solver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "thicklens/kernels/device.h"

namespace thicklens::estimator {
namespace {

using kernels::CsrMatrix;
using ::testing::AllOf;
using testing::ErrorOf;
using ::testing::HasSubstr;

std::vector<BlockSolver> DirectSolvers() {
  std::vector<BlockSolver> solvers;
  for (const BlockSolver solver : BuiltInBlockSolvers()) {
    if (!IsIterative(solver)) solvers.push_back(solver);
  }
  return solvers;
}

// Iterates to the precision of double.
constexpr LinearSolverLimits kTight{1e-13, 1000};

CsrMatrix<double> ToCsr(const Eigen::MatrixXd& dense) {
  CsrMatrix<double> csr;
  csr.rows = static_cast<int>(dense.rows());
  csr.columns = static_cast<int>(dense.cols());
  csr.row_start.push_back(0);
  for (int i = 0; i < dense.rows(); ++i) {
    for (int j = 0; j < dense.cols(); ++j) {
      if (dense(i, j) == 0) continue;
      csr.column.push_back(j);
      csr.value.push_back(dense(i, j));
    }
    csr.row_start.push_back(static_cast<std::int64_t>(csr.value.size()));
  }
  return csr;
}

// About a fifth of the entries, diagonally dominant.
Eigen::MatrixXd RandomSparse(int n, unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(n, n);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      if (uniform(engine) > 0.6) a(i, j) = uniform(engine);
    }
    a(i, i) = 3 + uniform(engine);
  }
  return a;
}

std::vector<double> RandomVector(int n, unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<double> x(static_cast<std::size_t>(n));
  for (double& value : x) value = uniform(engine);
  return x;
}

Eigen::VectorXd ToEigen(const std::vector<double>& x) {
  return Eigen::Map<const Eigen::VectorXd>(x.data(), static_cast<Eigen::Index>(x.size()));
}

TEST(LinearSolver, AgreesWithADenseSolutionOfASymmetricMatrix) {
  for (const BlockSolver kind : BuiltInBlockSolvers()) {
    for (const int n : {1, 2, 7, 40}) {
      // If half a step reaches the solution, ViennaCL divides 0 by 0.
      if (kind == BlockSolver::kViennaCl && n < 7) continue;
      SCOPED_TRACE(BlockSolverName(kind) + " n " + std::to_string(n));
      const Eigen::MatrixXd r = RandomSparse(n, 5);
      const Eigen::MatrixXd a = r.transpose() * r;
      const CsrMatrix<double> csr = ToCsr(a);
      const auto solver = NewLinearSolver(kind, true, kTight);
      solver->Factorize(csr);
      EXPECT_EQ(solver->rcond().has_value(), !IsIterative(kind));
      EXPECT_GT(solver->rcond().value_or(1), 1e-4);
      EXPECT_LE(solver->rcond().value_or(1), 1);
      for (const unsigned seed : {1u, 2u}) {  // one factor, two right sides
        const std::vector<double> b = RandomVector(n, seed);
        const std::vector<double> x = solver->Solve(b);
        const Eigen::VectorXd dense = a.ldlt().solve(ToEigen(b));
        EXPECT_LT((ToEigen(x) - dense).norm(), 1e-11 * dense.norm());
        EXPECT_LT(RelativeResidual(csr, x, b), 1e-13);
      }
    }
  }
}

// Rows are handed over as columns: a solver that forgets it solves the transposed system.
TEST(LinearSolver, SolvesAGeneralMatrixTheRightWayRound) {
  for (const BlockSolver kind : BuiltInBlockSolvers()) {
    if (kind == BlockSolver::kCholmod || kind == BlockSolver::kCg) continue;
    SCOPED_TRACE(BlockSolverName(kind));
    const Eigen::MatrixXd a = RandomSparse(23, 9);
    ASSERT_GT((a - a.transpose()).norm(), 1);
    const auto solver = NewLinearSolver(kind, false, kTight);
    solver->Factorize(ToCsr(a));
    const std::vector<double> b = RandomVector(23, 3);
    const Eigen::VectorXd dense = a.partialPivLu().solve(ToEigen(b));
    EXPECT_LT((ToEigen(solver->Solve(b)) - dense).norm(), 1e-11 * dense.norm());
  }
}

TEST(LinearSolver, IsUsedAgainForAnotherMatrixOfAnotherSize) {
  for (const BlockSolver kind : BuiltInBlockSolvers()) {
    SCOPED_TRACE(BlockSolverName(kind));
    const auto solver = NewLinearSolver(kind, true, kTight);
    for (const int n : {12, 5, 30}) {
      const Eigen::MatrixXd r = RandomSparse(n, static_cast<unsigned>(n));
      const Eigen::MatrixXd a = r.transpose() * r;
      solver->Factorize(ToCsr(a));
      const std::vector<double> b = RandomVector(n, 1);
      const Eigen::VectorXd dense = a.ldlt().solve(ToEigen(b));
      EXPECT_LT((ToEigen(solver->Solve(b)) - dense).norm(), 1e-11 * dense.norm());
    }
  }
}

TEST(LinearSolver, ASingularMatrixHasAnRcondOfNothing) {
  Eigen::MatrixXd a =
      Eigen::MatrixXd::Zero(4, 4);  // a chain of differences: constants are its null
  for (int i = 0; i < 3; ++i) {
    a(i, i) += 1;
    a(i + 1, i + 1) += 1;
    a(i, i + 1) -= 1;
    a(i + 1, i) -= 1;
  }
  for (const BlockSolver kind : DirectSolvers()) {
    for (const bool symmetric : {true, false}) {
      if (kind == BlockSolver::kCholmod && !symmetric) continue;
      SCOPED_TRACE(BlockSolverName(kind) + (symmetric ? " symmetric" : " general"));
      const auto solver = NewLinearSolver(kind, symmetric);
      solver->Factorize(ToCsr(a));
      EXPECT_LT(solver->rcond().value(), 1e-15);
    }
  }
}

TEST(LinearSolver, AnIndefiniteMatrixIsNotRescued) {
  Eigen::MatrixXd a = Eigen::MatrixXd::Identity(5, 5);
  a(2, 2) = -1;
  for (const BlockSolver kind : {BlockSolver::kCholmod, BlockSolver::kEigen}) {
    if (!IsBuiltIn(kind)) continue;
    SCOPED_TRACE(BlockSolverName(kind));
    const auto solver = NewLinearSolver(kind, true);
    solver->Factorize(ToCsr(a));
    EXPECT_EQ(solver->rcond().value(), 0);
  }
}

// A chain of differences with a small ridge has the condition 4/ridge, nearly; scaling its rows
// does not help. rcond is its inverse's order of magnitude.
TEST(LinearSolver, RcondFollowsTheCondition) {
  constexpr int kCount = 20;
  for (const double ridge : {1e-3, 1e-6, 1e-9, 1e-12}) {
    Eigen::MatrixXd a = ridge * Eigen::MatrixXd::Identity(kCount, kCount);
    for (int i = 0; i + 1 < kCount; ++i) {
      a(i, i) += 1;
      a(i + 1, i + 1) += 1;
      a(i, i + 1) -= 1;
      a(i + 1, i) -= 1;
    }
    for (const BlockSolver kind : DirectSolvers()) {
      for (const bool symmetric : {true, false}) {
        if (kind == BlockSolver::kCholmod && !symmetric) continue;
        SCOPED_TRACE(BlockSolverName(kind) + (symmetric ? " symmetric" : " general"));
        const auto solver = NewLinearSolver(kind, symmetric);
        solver->Factorize(ToCsr(a));
        EXPECT_GT(solver->rcond().value(), ridge / 4 / 10);
        EXPECT_LT(solver->rcond().value(), ridge / 4 * 100);
      }
    }
  }
}

TEST(LinearSolver, PredictsAtLeastTheMatrixItself) {
  const Eigen::MatrixXd r = RandomSparse(60, 4);
  const CsrMatrix<double> a = ToCsr(r.transpose() * r);
  for (const BlockSolver kind : DirectSolvers()) {
    SCOPED_TRACE(BlockSolverName(kind));
    // The lower triangle of this full matrix, 8 bytes an entry.
    EXPECT_GE(NewLinearSolver(kind, true)->PredictBytes(a), 8 * 60 * 61 / 2);
    EXPECT_LE(NewLinearSolver(kind, true)->PredictBytes(a), 100 * 8 * 60 * 60);
  }
}

TEST(LinearSolver, RelativeResidualOfAWrongAnswer) {
  const CsrMatrix<double> a = ToCsr(Eigen::Matrix2d::Identity() * 2);
  EXPECT_DOUBLE_EQ(RelativeResidual(a, {1, 0}, {2, 0}), 0);
  EXPECT_DOUBLE_EQ(RelativeResidual(a, {1, 1}, {2, 0}), 1);
  EXPECT_DOUBLE_EQ(RelativeResidual(a, {0, 3}, {0, 0}), 6);
}

TEST(LinearSolver, SomeAreForSymmetricMatricesAlone) {
  for (const BlockSolver kind : {BlockSolver::kCholmod, BlockSolver::kCg}) {
    if (!IsBuiltIn(kind)) continue;
    EXPECT_THAT(ErrorOf([&] { NewLinearSolver(kind, false); }), HasSubstr("not symmetric"));
  }
}

TEST(LinearSolver, LetsADeviceBeOpenedAfterViennaCl) {
  if (!IsBuiltIn(BlockSolver::kViennaCl)) GTEST_SKIP() << "built without ViennaCL";
  const auto solver = NewLinearSolver(BlockSolver::kViennaCl, true);
  solver->Factorize(ToCsr(RandomSparse(23, 9)));
  solver->Solve(RandomVector(23, 3));
  // The earlier failure took a minute and was reported as a driver that does not end.
  EXPECT_NO_THROW(kernels::OpenBackend(kernels::ParseDeviceRequest("opencl"), nullptr));
}

TEST(LinearSolver, SaysThatViennaClWasLeftOut) {
  if (IsBuiltIn(BlockSolver::kViennaCl)) GTEST_SKIP() << "built with ViennaCL";
  EXPECT_THAT(ErrorOf([] { NewLinearSolver(BlockSolver::kViennaCl, true); }),
              HasSubstr("THICKLENS_WITH_VIENNACL=OFF"));
}

TEST(LinearSolver, SaysWhatABuildWithoutGplPartsHas) {
  if (IsBuiltIn(BlockSolver::kUmfpack)) GTEST_SKIP() << "built with UMFPACK";
  EXPECT_EQ(DefaultBlockSolver(), BlockSolver::kEigen);
  EXPECT_THAT(ErrorOf([] { NewLinearSolver(BlockSolver::kUmfpack, true); }),
              HasSubstr("THICKLENS_WITH_GPL=OFF"));
}

TEST(BlockSolverName, ReadsBackAndRefusesOthers) {
  for (const BlockSolver solver :
       {BlockSolver::kUmfpack, BlockSolver::kCholmod, BlockSolver::kEigen, BlockSolver::kCg,
        BlockSolver::kBicgstab, BlockSolver::kViennaCl}) {
    EXPECT_EQ(BlockSolverFromName(BlockSolverName(solver)), solver);
  }
  EXPECT_THAT(ErrorOf([] { BlockSolverFromName("superlu"); }),
              AllOf(HasSubstr("\"superlu\""), HasSubstr("umfpack, cholmod, eigen, cg")));
}

}  // namespace
}  // namespace thicklens::estimator

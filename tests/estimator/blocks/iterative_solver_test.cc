#include "estimator/blocks/iterative_solver.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "estimator/blocks/linear_solver_kinds.h"

namespace thicklens::estimator {
namespace {

using kernels::CsrMatrix;

CsrMatrix<double> Diagonal(const std::vector<double>& values) {
  CsrMatrix<double> matrix;
  matrix.rows = matrix.columns = static_cast<int>(values.size());
  matrix.row_start.push_back(0);
  for (std::size_t i = 0; i < values.size(); ++i) {
    matrix.column.push_back(static_cast<std::int32_t>(i));
    matrix.value.push_back(values[i]);
    matrix.row_start.push_back(static_cast<std::int64_t>(i + 1));
  }
  return matrix;
}

// Returns what `answer` makes of the solution, and always claims to be done.
class OverconfidentMethod : public IterativeMethod {
 public:
  explicit OverconfidentMethod(std::function<double(double solution, double tolerance)> answer)
      : answer_(std::move(answer)) {}
  double BytesOf(const CsrMatrix<double>& /*matrix*/) const override { return 0; }
  void SetMatrix(const CsrMatrix<double>& matrix) override { diagonal_ = matrix.value; }
  std::vector<double> Run(const std::vector<double>& b, double tolerance, int max_iterations,
                          int* iterations) override {
    EXPECT_GE(max_iterations, 1);
    ++*iterations;
    std::vector<double> x;
    for (std::size_t i = 0; i < b.size(); ++i) {
      x.push_back(answer_(b[i] / diagonal_[i], tolerance));
    }
    return x;
  }

 private:
  std::function<double(double, double)> answer_;
  std::vector<double> diagonal_;
};

struct Answer {
  std::vector<double> x;
  double residual = 0;
  int iterations = 0;
};
Answer Solved(std::function<double(double, double)> answer, const LinearSolverLimits& limits) {
  const CsrMatrix<double> matrix = Diagonal({2, 5, -3});
  const std::vector<double> b = {1, -2, 4};
  IterativeSolver solver(std::make_unique<OverconfidentMethod>(std::move(answer)), limits);
  solver.Factorize(matrix);
  Answer result;
  result.x = solver.Solve(b);
  result.residual = RelativeResidual(matrix, result.x, b);
  result.iterations = solver.iterations();
  return result;
}

TEST(IterativeSolverTest, AsksAgainUntilTheResidualIsSmall) {
  const auto half = [](double solution, double /*tolerance*/) { return solution / 2; };
  const Answer answer = Solved(half, {1e-6, 1000});
  EXPECT_LE(answer.residual, 1e-6);
  EXPECT_EQ(answer.iterations, 20);  // 2^-20 is the first power below 1e-6
}

TEST(IterativeSolverTest, AsksForMoreWhereAPassDoesNothing) {
  // Does nothing unless it is asked for a hundredth.
  const auto lazy = [](double solution, double tolerance) {
    return tolerance < 0.01 ? 0.999 * solution : 0;
  };
  const Answer answer = Solved(lazy, {0.1, 1000});
  EXPECT_LE(answer.residual, 0.1);
  EXPECT_GT(answer.iterations, 1);
}

TEST(IterativeSolverTest, StopsAtItsLimitAndWhereNothingHelps) {
  const auto half = [](double solution, double /*tolerance*/) { return solution / 2; };
  EXPECT_NEAR(Solved(half, {1e-6, 4}).residual, 1.0 / 16, 1e-12);
  const auto nothing = [](double /*solution*/, double /*tolerance*/) { return 0.0; };
  const Answer idle = Solved(nothing, {1e-6, 1000});
  EXPECT_EQ(idle.residual, 1);
  EXPECT_LT(idle.iterations, 10);
}

TEST(IterativeSolverTest, KeepsWhatItHasWhenAMethodGoesAstray) {
  int calls = 0;
  const auto breaks = [&](double solution, double /*tolerance*/) {
    ++calls;
    return calls <= 3 ? solution / 2 : std::numeric_limits<double>::quiet_NaN();
  };
  EXPECT_NEAR(Solved(breaks, {1e-6, 1000}).residual, 0.5, 1e-12);
  const auto away = [](double solution, double /*tolerance*/) { return -solution; };
  EXPECT_EQ(Solved(away, {1e-6, 1000}).residual, 1);
}

TEST(IterativeSolverTest, NothingHasTheSolutionNothing) {
  const CsrMatrix<double> matrix = Diagonal({2, 5, -3});
  for (const auto make : {NewEigenCgSolver, NewEigenBicgstabSolver}) {
    const auto solver = make({});
    solver->Factorize(matrix);
    EXPECT_EQ(solver->Solve({0, 0, 0}), (std::vector<double>{0, 0, 0}));
    EXPECT_EQ(solver->iterations(), 0);
  }
}

TEST(IterativeSolverTest, StartsFromWhatIsNearAndNeverLeavesItForWorse) {
  const CsrMatrix<double> matrix = Diagonal({2, 5, 3, 7});
  const std::vector<double> b = {2, 10, 9, 28}, answer = {1, 2, 3, 4};
  for (const auto make : {NewEigenCgSolver, NewEigenBicgstabSolver}) {
    const auto solver = make({1e-12, 100});
    solver->Factorize(matrix);
    EXPECT_EQ(solver->SolveFrom(answer, b), answer);
    EXPECT_EQ(solver->iterations(), 0);
    const std::vector<double> found = solver->SolveFrom({7, 7, 7, 7}, b);
    for (std::size_t i = 0; i < b.size(); ++i) EXPECT_NEAR(found[i], answer[i], 1e-10);
    // The start and the solution are 0: the tolerance is relative to |b|, not to the residual of
    // the start.
    const auto one_pass = make({1e-12, 1});
    one_pass->Factorize(matrix);
    const std::vector<double> near = {1, 2, 3, 4.001};
    EXPECT_LE(RelativeResidual(matrix, one_pass->SolveFrom(near, b), b),
              RelativeResidual(matrix, near, b));
  }
}

// An indefinite matrix on which BiCGSTAB breaks down: Eigen calls that success.
TEST(IterativeSolverTest, DoesNotTrustEigensSuccess) {
  CsrMatrix<double> turn;  // (0 1; -1 0): r0 . A p = 0 at once
  turn.rows = turn.columns = 2;
  turn.row_start = {0, 1, 2};
  turn.column = {1, 0};
  turn.value = {1, -1};
  const auto solver = NewEigenBicgstabSolver({1e-6, 50});
  solver->Factorize(turn);
  const std::vector<double> b = {1, 0};
  const std::vector<double> x = solver->Solve(b);
  const double residual = RelativeResidual(turn, x, b);
  EXPECT_TRUE(residual <= 1) << residual;  // solved or left alone, never made worse or NaN
}

}  // namespace
}  // namespace thicklens::estimator

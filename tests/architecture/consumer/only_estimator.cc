// A program that links thicklens::estimator and no other library of the package by name.
#include <cstdio>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/estimator/block_solver.h"

namespace {

// A cancelled token of this program ends a loop of the library.
bool Works() {
  thicklens::estimator::EstimateInput input;
  input.image = {8, 8, 1, std::vector<float>(64, 0.5F)};
  input.disparity.width_px = input.disparity.height_px = 8;
  input.disparity.disparity.assign(64, 0.5F);
  input.weights = Eigen::ArrayXXd::Constant(3, 3, 1.0 / 9);
  if (thicklens::estimator::WarpedLightField(input, true, 1).u_count != 3) return false;
  thicklens::CancelToken token;
  token.Cancel();
  const thicklens::CancelScope scope(&token);
  try {
    thicklens::estimator::WarpedLightField(input, true, 1);
  } catch (const thicklens::Interrupted&) {
    return thicklens::estimator::IsBuiltIn(thicklens::estimator::DefaultBlockSolver());
  }
  return false;
}

}  // namespace

int main() {
  if (Works()) return 0;
  std::fprintf(stderr, "thicklens::estimator does not work\n");
  return 1;
}

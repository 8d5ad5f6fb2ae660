#include <fmt/format.h>

#include "estimator/views/option_checks.h"
#include "thicklens/base/error.h"
#include "thicklens/base/validity.h"
#include "thicklens/estimator/block_solver.h"

namespace thicklens::estimator {
Stencil StencilFromName(const std::string& name) {
  if (name == "warp") return Stencil::kWarp;
  if (name == "source") return Stencil::kSource;
  throw Error(fmt::format("stencil \"{}\" is unknown: it must be warp or source", name));
}

std::string StencilName(Stencil stencil) { return stencil == Stencil::kWarp ? "warp" : "source"; }

bool BlockOptions::IsValid(std::string* why) const {
  if (gamma == 0) {
    return Fail(
        why,
        "gamma is 0: it must be > 0, because otherwise only the ridge relates the rays of a "
        "scene point, and the light field does not follow the scene's geometry");
  }
  if (!(rcond_min >= 0) || !(rcond_min < 1)) {
    return Fail(why, fmt::format("rcond_min is {}: it must be >= 0 and < 1", rcond_min));
  }
  return IsEnumerator(BlockSolver::kViennaCl, "solver", solver, why) &&
         IsEnumerator(Stencil::kSource, "stencil", stencil, why) &&
         IsEnumerator(kernels::Splat::kBilinear, "splat", splat, why) &&
         IsPositive("gamma", gamma, why) && IsNonNegative("ridge", ridge, why) &&
         IsAtLeast(1, "block_px", block_px, why) && IsTolerance("tolerance", tolerance, why) &&
         IsAtLeast(1, "max_iterations", max_iterations, why);
}

}  // namespace thicklens::estimator

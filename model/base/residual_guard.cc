#include "thicklens/base/residual_guard.h"

#include <fmt/format.h>

#include "thicklens/base/error.h"

namespace thicklens {

void RequireProgress(const std::string& solver, double relative_residual, int iterations,
                     const std::string& advice) {
  constexpr double kLost = 10;
  if (relative_residual < kLost) return;
  throw Error(
      fmt::format("{}: the iterations diverged: after {} of them the relative residual is {:.2g}, "
                  "but it must be below {:g}; {}",
                  solver, iterations, relative_residual, kLost, advice));
}

}  // namespace thicklens

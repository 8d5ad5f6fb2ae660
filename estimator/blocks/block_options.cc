#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/estimator/block_solver.h"

namespace thicklens::estimator {
Stencil StencilFromName(const std::string& name) {
  if (name == "warp") return Stencil::kWarp;
  if (name == "source") return Stencil::kSource;
  throw Error(fmt::format("stencil \"{}\" is unknown: it must be warp or source", name));
}

std::string StencilName(Stencil stencil) { return stencil == Stencil::kWarp ? "warp" : "source"; }

bool BlockOptions::IsValid(std::string* why) const {
  const auto fail = [why](std::string reason) {
    if (why != nullptr) *why = std::move(reason);
    return false;
  };
  if (gamma == 0) {
    return fail(
        "gamma is 0: it must be > 0, because otherwise only the ridge relates the rays of a scene "
        "point, and the light field does not follow the scene's geometry");
  }
  if (!(gamma > 0) || !std::isfinite(gamma)) {
    return fail(fmt::format("gamma is {}: it must be finite and > 0", gamma));
  }
  if (ridge && (!(*ridge >= 0) || !std::isfinite(*ridge))) {
    return fail(fmt::format("ridge is {}: it must be finite and >= 0", *ridge));
  }
  if (block_px && !(*block_px >= 1)) {
    return fail(fmt::format("block_px is {}: it must be >= 1", *block_px));
  }
  if (memory_limit_mib && !(*memory_limit_mib > 0)) {
    return fail(fmt::format("memory_limit_mib is {}: it must be > 0", *memory_limit_mib));
  }
  if (!(rcond_min >= 0) || !(rcond_min < 1)) {
    return fail(fmt::format("rcond_min is {}: it must be >= 0 and < 1", rcond_min));
  }
  if (!(tolerance > 0) || !(tolerance < 1)) {
    return fail(fmt::format("tolerance is {}: it must be > 0 and < 1", tolerance));
  }
  if (max_iterations < 1) {
    return fail(fmt::format("max_iterations is {}: it must be >= 1", max_iterations));
  }
  if (threads < 0) return fail(fmt::format("threads is {}: it must be >= 0", threads));
  return true;
}

}  // namespace thicklens::estimator

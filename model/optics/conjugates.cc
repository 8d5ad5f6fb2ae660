#include "thicklens/model/conjugates.h"

#include <fmt/format.h>

#include <cmath>

#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

Error Impossible(const StatedConjugate& stated, const std::string& constraint) {
  return Error(fmt::format("{} is {}: {}", stated.name, stated.value.value, constraint));
}

}  // namespace

Estimate FocusDepthOf(const ThickLens& lens, const StatedConjugate& stated) {
  const double f1_mm = lens.front_focal_length_mm, f2_mm = lens.rear_focal_length_mm;
  const double value = stated.value.value, sigma = stated.value.sigma;
  if (!std::isfinite(value) || !(sigma >= 0) || !std::isfinite(sigma))
    throw Impossible(stated, "it must be finite, with a standard deviation >= 0");
  switch (stated.kind) {
    case ConjugateKind::kFocusDepth:
      if (!(value > f1_mm))
        throw Impossible(stated, fmt::format("it must be larger than the front focal length "
                                             "({} mm), because nothing nearer comes into focus",
                                             f1_mm));
      return stated.value;
    case ConjugateKind::kMagnification:
      if (!(value > 0)) throw Impossible(stated, "it must be > 0");
      return {f1_mm + f1_mm / value, f1_mm * sigma / (value * value)};
    case ConjugateKind::kImageDistance:
    case ConjugateKind::kTubeLength: {
      const double infinity_mm =
          stated.kind == ConjugateKind::kImageDistance ? lens.lens_thickness_mm + f2_mm : 0;
      const double beyond_mm = value - infinity_mm;  // Newton's x'
      if (!(beyond_mm > 0))
        throw Impossible(
            stated, fmt::format("it must be larger than {} mm, its value for a focus at infinity",
                                infinity_mm));
      return {f1_mm + f1_mm * f2_mm / beyond_mm, f1_mm * f2_mm * sigma / (beyond_mm * beyond_mm)};
    }
  }
  throw Impossible(stated, "its kind is not known");
}

double MagnificationAtFocus(const ThickLens& lens, double focus_depth_mm) {
  const double beyond_mm = focus_depth_mm - lens.front_focal_length_mm;
  if (!(beyond_mm > 0)) {
    throw Error(fmt::format("focus depth {} mm: it must be larger than the front focal length ({})",
                            focus_depth_mm, lens.front_focal_length_mm));
  }
  return lens.front_focal_length_mm / beyond_mm;
}

}  // namespace thicklens::model

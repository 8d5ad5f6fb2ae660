#include "thicklens/calib/stage_errors.h"

#include <fmt/format.h>

#include <cmath>

namespace thicklens::calib {
namespace {

// A value with its error, both to the error's first two digits.
std::string WithError(const model::Estimate& estimate, bool is_signed) {
  const int digits =
      estimate.sigma > 0
          ? std::min(6, std::max(0, 1 - static_cast<int>(std::floor(std::log10(estimate.sigma)))))
          : 3;
  return is_signed
             ? fmt::format("{:+.{}f} +- {:.{}f} mm", estimate.value, digits, estimate.sigma, digits)
             : fmt::format("{:.{}f} +- {:.{}f} mm", estimate.value, digits, estimate.sigma, digits);
}

}  // namespace

std::string StageErrors::InWords() const {
  std::vector<std::string> found;
  if (backlash_mm) {
    found.push_back(
        fmt::format("backlash: readings at falling positions are {} from those at rising ones",
                    WithError(*backlash_mm, true)));
  }
  if (slip_mm) {
    found.push_back(
        fmt::format("lost steps or a slipped clamp: from frame {} on the readings are "
                    "{} from those before",
                    slip_from_frame + 1, WithError(*slip_mm, true)));
  }
  if (periodic) {
    found.push_back(fmt::format(
        "a periodic error, as of a lead screw: amplitude {}, period {} in the readings",
        WithError(periodic->amplitude_mm, false), WithError(periodic->period_mm, false)));
  }
  if (found.empty()) {
    if (also_possible.empty()) return "";
    return fmt::format(
        "the readings deviate from what the frames show by a pattern that has one of these causes, "
        "which the frames do not distinguish: {}. The readings were not corrected, and the "
        "intervals include each of them",
        fmt::join(also_possible, "; "));
  }
  std::string text = fmt::format("the readings have an error of the stage, which was corrected: {}",
                                 fmt::join(found, "; "));
  if (!also_possible.empty())
    text +=
        fmt::format(" (the frames would look the same with {})", fmt::join(also_possible, "; "));
  return text;
}

}  // namespace thicklens::calib

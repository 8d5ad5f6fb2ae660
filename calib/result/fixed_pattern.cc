#include "thicklens/calib/fixed_pattern.h"

#include <fmt/format.h>

#include <cmath>
#include <vector>

namespace thicklens::calib {
namespace {

std::string Counted(int count, const char* one, const char* several) {
  return fmt::format("{} {}", count, count == 1 ? one : several);
}

}  // namespace

bool FixedPattern::Removed() const {
  return shading_removed || specks > 0 || defective_px > 0 || column_deviation > 0 ||
         row_deviation > 0;
}

std::string FixedPattern::InWords() const {
  std::vector<std::string> found;
  if (shading_removed && corner_stops) {
    found.push_back(fmt::format(
        "shading ({:.2f} +- {:.2f} stops from the centre to the corners: vignetting, or a lamp "
        "that moves with the camera)",
        corner_stops->value, corner_stops->sigma));
  }
  if (specks > 0) {
    found.push_back(fmt::format("{} (dust; up to {:.0f} % of the light)",
                                Counted(specks, "speck", "specks"), 100 * deepest_speck));
  }
  if (defective_px > 0)
    found.push_back(Counted(defective_px, "defective pixel", "defective pixels"));
  if (column_deviation > 0) {
    found.push_back(fmt::format("columns of unequal gain ({:.2g} % standard deviation)",
                                100 * column_deviation));
  }
  if (row_deviation > 0)
    found.push_back(
        fmt::format("rows of unequal gain ({:.2g} % standard deviation)", 100 * row_deviation));
  if (found.empty()) return "";
  std::string text =
      fmt::format("structure fixed to the frame was found and removed: {}", fmt::join(found, "; "));
  const double share = divided_share + filled_share;
  if (share > 0) {
    text += fmt::format("; specks and pixels cover {:.2g} % of the region", 100 * share);
    if (filled_share > 0)
      text +=
          fmt::format(", of which {:.2g} % was filled from its surroundings", 100 * filled_share);
  }
  return text;
}

}  // namespace thicklens::calib

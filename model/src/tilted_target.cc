#include "tilted_target.h"

#include <algorithm>

namespace thicklens::model {
namespace {

constexpr double kAllowedPx = 0.01;
constexpr int kWidestStrip = 64;

}  // namespace

std::vector<ColumnStrip> StripsOf(int width_px, double blur_px_per_px, double shift_px_per_px) {
  const double steepest = std::max(blur_px_per_px, shift_px_per_px);
  // From the middle of a strip to its ends.
  const double columns = steepest > 0 ? 2 * kAllowedPx / steepest : kWidestStrip;
  const int count = static_cast<int>(std::clamp<double>(columns, 1, kWidestStrip));
  std::vector<ColumnStrip> strips;
  for (int first = 0; first < width_px; first += count) {
    strips.push_back({first, std::min(count, width_px - first)});
  }
  return strips;
}

}  // namespace thicklens::model

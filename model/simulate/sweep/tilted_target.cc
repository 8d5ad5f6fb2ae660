#include "model/simulate/sweep/tilted_target.h"

#include <algorithm>

namespace thicklens::model {
namespace {

constexpr double kAllowedPx = 0.01;
constexpr double kBetweenNodesPx = 0.16;
constexpr int kWidest = 64;

int ColumnsWithin(double limit_px, double change_px_per_px) {
  const double columns = change_px_per_px > 0 ? limit_px / change_px_per_px : kWidest;
  return static_cast<int>(std::clamp<double>(columns, 1, kWidest));
}

}  // namespace

std::vector<ColumnStrip> StripsOf(int width_px, double change_px_per_px) {
  // The limit applies from the middle of a strip to its ends.
  const int count = ColumnsWithin(2 * kAllowedPx, change_px_per_px);
  std::vector<ColumnStrip> strips;
  for (int first = 0; first < width_px; first += count) {
    strips.push_back({first, std::min(count, width_px - first)});
  }
  return strips;
}

std::vector<int> NodesOf(int width_px, double change_px_per_px) {
  const int count = ColumnsWithin(kBetweenNodesPx, change_px_per_px);
  std::vector<int> nodes;
  for (int column = 0; column < width_px - 1; column += count) nodes.push_back(column);
  nodes.push_back(width_px - 1);
  return nodes;
}

}  // namespace thicklens::model

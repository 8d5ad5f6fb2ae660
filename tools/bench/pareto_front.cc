#include "tools/bench/pareto_front.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace thicklens::tools {

std::vector<bool> ParetoFront(const std::vector<std::pair<double, double>>& points) {
  std::vector<bool> on_front(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double cost = points[i].first, error = points[i].second;
    if (!std::isfinite(cost) || !std::isfinite(error)) continue;
    on_front[i] = std::none_of(points.begin(), points.end(), [&](const auto& other) {
      return other.first <= cost && other.second <= error &&
             (other.first < cost || other.second < error);
    });
  }
  return on_front;
}

}  // namespace thicklens::tools

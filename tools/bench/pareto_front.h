#ifndef THICKLENS_TOOLS_BENCH_PARETO_FRONT_H_
#define THICKLENS_TOOLS_BENCH_PARETO_FRONT_H_

#include <utility>
#include <vector>

namespace thicklens::tools {

// Returns which points (cost, error) are on the Pareto front: no other point is better in one
// without being worse in the other. Equal points are on the front together. A point that is not
// finite is not on the front and dominates none.
std::vector<bool> ParetoFront(const std::vector<std::pair<double, double>>& points);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_PARETO_FRONT_H_

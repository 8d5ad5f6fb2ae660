#ifndef THICKLENS_TOOLS_PARETO_FRONT_H_
#define THICKLENS_TOOLS_PARETO_FRONT_H_

#include <utility>
#include <vector>

namespace thicklens::tools {

// Of points (cost, error): which no other beats in one without being worse in the other. Equal
// points are on the front together; one that is not finite is not on it and beats none.
std::vector<bool> ParetoFront(const std::vector<std::pair<double, double>>& points);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_PARETO_FRONT_H_

#ifndef THICKLENS_TOOLS_BENCH_COST_PAGE_H_
#define THICKLENS_TOOLS_BENCH_COST_PAGE_H_

#include <string>
#include <vector>

#include "tools/bench/cost_rows.h"
#include "tools/report/svg_plot.h"

namespace thicklens::tools {

// Plots error against seconds on logarithmic axes, for the rows of one scene and one number of
// views: one colour for each solver, the Pareto front joined, the baseline as a horizontal line.
// `id` is unique on its page.
Plot CostFigure(const std::vector<CostRow>& rows, const std::string& id);

// Groups the rows by scene and number of views, in the order of their first rows.
std::vector<std::vector<CostRow>> CostGroups(const std::vector<CostRow>& rows);

// Makes a page with the figures and tables of all rows. `about` states the conditions of the times.
std::string CostPage(const std::vector<CostRow>& rows, const std::string& about);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_COST_PAGE_H_

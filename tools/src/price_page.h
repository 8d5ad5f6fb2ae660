#ifndef THICKLENS_TOOLS_PRICE_PAGE_H_
#define THICKLENS_TOOLS_PRICE_PAGE_H_

#include <string>
#include <vector>

#include "price_rows.h"
#include "svg_plot.h"

namespace thicklens::tools {

// Error against seconds on logarithmic axes, of the rows of one scene and one number of views: each
// solver a colour, the front joined, the baseline a line across. `id`: unique on its page.
Plot PriceFigure(const std::vector<PriceRow>& rows, const std::string& id);

// Rows of one scene and number of views each, in the order in which they begin.
std::vector<std::vector<PriceRow>> PriceGroups(const std::vector<PriceRow>& rows);

// A page with the figures and tables of all. `about`: what the times are to be read with.
std::string PricePage(const std::vector<PriceRow>& rows, const std::string& about);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_PRICE_PAGE_H_

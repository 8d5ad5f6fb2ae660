#ifndef THICKLENS_TOOLS_REPORT_PAGE_FIGURES_H_
#define THICKLENS_TOOLS_REPORT_PAGE_FIGURES_H_

#include <functional>
#include <string>

namespace thicklens::tools {

// Building blocks of figures with images; they need LightFieldFigureStyle().

// Width of the page's column, and of each of several images side by side.
constexpr int kPageColumnPx = 890;
inline int PlacePx(int columns) { return kPageColumnPx / columns; }

// One image with its label beneath.
std::string Cell(const std::string& image, const std::string& label);
std::string Grid(int columns, const std::string& cells, const std::string& css_class = "");
std::string Figure(const std::string& content, const std::string& title,
                   const std::string& caption);

// The colours of a map from `lo` to `hi` (> lo), with numbers below. `colour` gives the colour of a
// value as "#rrggbb"; `id` is unique on the page.
std::string ColourScale(const std::string& id, double lo, double hi, const std::string& unit,
                        const std::function<std::string(double)>& colour);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_PAGE_FIGURES_H_

#ifndef THICKLENS_TOOLS_IO_LIGHTFIELDS_VIEW_GRID_H_
#define THICKLENS_TOOLS_IO_LIGHTFIELDS_VIEW_GRID_H_

#include <optional>
#include <string>
#include <vector>

#include "tools/io/lightfields/layout.h"

namespace thicklens::io {

// A view and the numbers that its name gives it.
struct NumberedView {
  int u = 0, v = 0;  // column and row
  std::string file;  // name of the file or of the part
};

// The smallest rectangle of views that holds the given ones. Numbers may have any start and any
// constant step.
struct ViewGrid {
  model::LightField frame;           // counts, weights and present views
  std::vector<std::string> files;    // index l * U + k; empty: the view is missing
  std::vector<std::string> missing;  // "the view in row 1, column 2"
  int first_number = 0;              // of GridOfNumbers: the number of the first view of a row
  bool may_start_at_one = false;     // of GridOfNumbers: see MayStartAtOne
  const std::string& At(int k, int l) const {
    return files[static_cast<std::size_t>(l * frame.u_count + k)];
  }
};
// Throws Error that begins with `path` if two views have one place, if the numbers span too much,
// or if views are missing and `reading.sparse` is not set; then `name_of` names the missing ones.
ViewGrid GridOfViews(const std::string& path, const std::vector<NumberedView>& views,
                     const LightFieldReading& reading);

// The number of the first view in a row-by-row numbering with rows of `row` views: 0, or 1 if 0 is
// not among the sorted numbers, the first or the last view of a square from 1 is, and fewer views
// are missing then within the rectangle of those that are there.
int FirstOfNumbering(const std::vector<int>& numbers, int row);
// Whether counting from 1 places the sorted numbers otherwise than FirstOfNumbering, which is 0,
// and as few views are missing: of 25 views, the first from 0 or the last from 1.
bool MayStartAtOne(const std::vector<int>& numbers, int row);
// Places views that have one number each, counted row by row from 0, from 1 (FirstOfNumbering), or
// from another number if they form a full rectangle. The length of a row is that of the options
// layout or grid; otherwise the views must form a full square. `first` states the first number.
ViewGrid GridOfNumbers(const std::string& path, const std::vector<NumberedView>& views,
                       const LightFieldReading& reading, std::optional<int> first = std::nullopt);

// "a.png, b.png and 3 more"
std::string Listed(const std::vector<std::string>& names);
// Throws an Error that names missing views and the option that accepts them.
[[noreturn]] void ThrowMissingViews(const std::string& path, const std::vector<std::string>& names);

// A frame of u x v views, all present, with equal weights.
model::LightField FullFrame(int u_count, int v_count);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_LIGHTFIELDS_VIEW_GRID_H_

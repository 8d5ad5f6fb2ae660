// The layout of the (New) Stanford Light Field Archive: out_RR_CC_Y_X_.png with the row, the column
// and the position of the camera in the order (y, x), "related to the centre of projection by an
// unknown scale and translation" (lightfield.stanford.edu/calib.html). Files without the last
// underscore exist too.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "tools/io/image_names.h"
#include "tools/io/lightfields/layout.h"
#include "tools/io/lightfields/view_grid.h"
#include "tools/io/lightfields/view_names.h"
#include "tools/io/lightfields/view_pixels.h"

namespace thicklens::io {
namespace {

namespace fs = std::filesystem;

// A view farther than this from its place on the regular grid, in view steps, is reported.
constexpr double kIrregular = 0.1;

// A position along one axis of the grid: least-squares line through (index, position).
struct Line {
  double start = 0, step = 0;
};

Line LineThrough(const std::vector<double>& index, const std::vector<double>& position) {
  const auto n = static_cast<double>(index.size());
  double mean_i = 0, mean_p = 0, square = 0, product = 0;
  for (std::size_t i = 0; i < index.size(); ++i) {
    mean_i += index[i] / n;
    mean_p += position[i] / n;
  }
  for (std::size_t i = 0; i < index.size(); ++i) {
    square += (index[i] - mean_i) * (index[i] - mean_i);
    product += (index[i] - mean_i) * (position[i] - mean_p);
  }
  Line line;
  line.step = square > 0 ? product / square : 0;
  line.start = mean_p - line.step * mean_i;
  return line;
}

// Compares the positions that the names state with a regular grid.
void DescribePositions(const std::string& path, const NamePattern& pattern, const ViewGrid& grid,
                       ViewSource* source) {
  std::vector<double> column, row, x, y;
  std::vector<std::string> names;
  for (int l = 0; l < grid.frame.v_count; ++l) {
    for (int k = 0; k < grid.frame.u_count; ++k) {
      if (grid.At(k, l).empty()) continue;
      const std::optional<NameNumbers> numbers = pattern.Match(grid.At(k, l));
      column.push_back(k);
      row.push_back(l);
      x.push_back(*numbers->x);
      y.push_back(*numbers->y);
      names.push_back(grid.At(k, l));
    }
  }
  const Line across = LineThrough(column, x);
  const Line down = LineThrough(row, y);
  const bool is_across = grid.frame.u_count > 1;
  const bool is_down = grid.frame.v_count > 1;
  const auto spread = [](const std::vector<double>& values) {
    const auto [least, most] = std::minmax_element(values.begin(), values.end());
    return *most - *least;
  };
  if (spread(x) == 0 && spread(y) == 0) {
    source->notices.push_back(fmt::format(
        "{}: the names of all views state one position ({}, {}): the rows and columns in the names "
        "are used alone",
        path, y.front(), x.front()));
    return;
  }
  const double step =
      std::max(is_across ? std::abs(across.step) : 0.0, is_down ? std::abs(down.step) : 0.0);
  if (!(step > 0)) return;
  double farthest = 0;
  std::size_t at = 0;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const double away = std::hypot(x[i] - across.start - across.step * column[i],
                                   y[i] - down.start - down.step * row[i]) /
                        step;
    if (away > farthest) {
      farthest = away;
      at = i;
    }
  }
  source->details.push_back(fmt::format(
      "positions from the file names: {:.4g} per column, {:.4g} per row, at most {:.2g} "
      "view steps from a regular grid",
      across.step, down.step, farthest));
  if (farthest > kIrregular) {
    source->notices.push_back(
        fmt::format("{}: {} lies {:.2g} view steps from its place on the regular grid that is "
                    "fitted to the positions; the views are taken at the places of that grid",
                    path, names[at], farthest));
  }
}

}  // namespace

std::optional<ViewSource> OpenStanfordFolder(const LayoutInput& input) {
  std::vector<std::string> names = ImageNames(input.path);
  // '*' is the last underscore and the ending.
  const NamePattern pattern("out_{v}_{u}_{y}_{x}*");
  const auto is_view = [&](const std::string& name) { return pattern.Match(name).has_value(); };
  if (!input.is_forced && std::none_of(names.begin(), names.end(), is_view)) return std::nullopt;

  std::vector<std::string> others;
  const ViewGrid grid = GridOfNames(input.path, pattern, names, *input.reading, &others);
  ViewSource source;
  source.kind = "a Stanford folder";
  source.frame = grid.frame;
  if (!others.empty()) source.details.push_back(fmt::format("not views: {}", Listed(others)));
  if (!grid.missing.empty())
    source.details.push_back(fmt::format("missing: {}", Listed(grid.missing)));
  DescribePositions(input.path, pattern, grid, &source);
  for (const std::string& file : grid.files) {
    if (!file.empty()) ReportInput((fs::path(input.path) / file).string());
  }
  source.read = [folder = input.path, grid](int k, int l) {
    return ReadLightOfFile((fs::path(folder) / grid.At(k, l)).string());
  };
  return source;
}

}  // namespace thicklens::io

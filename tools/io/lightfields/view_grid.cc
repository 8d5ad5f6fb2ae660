#include "tools/io/lightfields/view_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <numeric>
#include <optional>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"

namespace thicklens::io {
namespace {

// Longest row or column of views. The numbers come from names of files: without a limit, two files
// could ask for any amount of memory.
constexpr int kMaxSpan = 1000;

// The numbers of one axis: first + step * index.
struct Axis {
  int first = 0, step = 1, count = 0;
  int IndexOf(int number) const { return (number - first) / step; }
};

Axis AxisOf(const std::string& path, const char* name, const std::vector<NumberedView>& views,
            int NumberedView::*number) {
  const auto [least, most] =
      std::minmax_element(views.begin(), views.end(),
                          [&](const auto& a, const auto& b) { return a.*number < b.*number; });
  Axis axis;
  axis.first = (*least).*number;
  int step = 0;
  for (const NumberedView& view : views) step = std::gcd(step, view.*number - axis.first);
  axis.step = std::max(1, step);
  const int span = ((*most).*number - axis.first) / axis.step;
  if (span >= kMaxSpan) {
    throw Error(fmt::format(
        "{}: the {} numbers of the views go from {} ({}) to {} ({}): at most {} views in a {} are "
        "expected",
        path, name, axis.first, PrintableUtf8(least->file), (*most).*number,
        PrintableUtf8(most->file), kMaxSpan, name));
  }
  axis.count = span + 1;
  return axis;
}

}  // namespace

std::string Listed(const std::vector<std::string>& names) {
  constexpr std::size_t kShown = 5;
  std::vector<std::string> shown;
  for (std::size_t i = 0; i < std::min(kShown, names.size()); ++i)
    shown.push_back(PrintableUtf8(names[i]));
  const std::string more =
      names.size() > kShown ? fmt::format(" and {} more", names.size() - kShown) : "";
  return fmt::format("{}{}", fmt::join(shown, ", "), more);
}

void ThrowMissingViews(const std::string& path, const std::vector<std::string>& names) {
  throw Error(
      fmt::format("{}: missing: {}; the option sparse accepts a light field with views missing",
                  path, Listed(names)));
}

model::LightField FullFrame(int u_count, int v_count) {
  model::LightField frame;
  frame.u_count = u_count;
  frame.v_count = v_count;
  frame.weights = Eigen::ArrayXXd::Constant(
      v_count, u_count, 1.0 / (static_cast<double>(u_count) * static_cast<double>(v_count)));
  frame.origin.method = "imported";
  return frame;
}

ViewGrid GridOfViews(const std::string& path, const std::vector<NumberedView>& views,
                     const LightFieldReading& reading) {
  if (views.empty()) throw Error(fmt::format("{}: no view is in it", path));
  const Axis across = AxisOf(path, "column", views, &NumberedView::u);
  const Axis down = AxisOf(path, "row", views, &NumberedView::v);
  ViewGrid grid;
  grid.frame = FullFrame(across.count, down.count);
  grid.files.resize(static_cast<std::size_t>(across.count * down.count));
  for (const NumberedView& view : views) {
    std::string& place = grid.files[static_cast<std::size_t>(down.IndexOf(view.v) * across.count +
                                                             across.IndexOf(view.u))];
    if (!place.empty()) {
      throw Error(fmt::format("{}: {} and {} are both the view in row {}, column {}", path,
                              PrintableUtf8(place), PrintableUtf8(view.file), view.v, view.u));
    }
    place = view.file;
  }
  std::vector<std::string> missing;
  for (int l = 0; l < down.count; ++l) {
    for (int k = 0; k < across.count; ++k) {
      const bool is_there = !grid.At(k, l).empty();
      grid.frame.present.push_back(is_there);
      grid.frame.weights(l, k) = is_there ? 1.0 / static_cast<double>(views.size()) : 0.0;
      if (!is_there) {
        missing.push_back(fmt::format("the view in row {}, column {}", down.first + l * down.step,
                                      across.first + k * across.step));
      }
    }
  }
  if (missing.empty()) grid.frame.present.clear();
  if (!missing.empty() && !reading.sparse) ThrowMissingViews(path, missing);
  grid.missing = missing;
  return grid;
}

namespace {

// The places in the smallest rectangle that holds the numbers, counted from `first`.
std::int64_t PlacesFrom(int first, const std::vector<int>& numbers, int row) {
  int least = row, most = 0;
  for (const int number : numbers) {
    least = std::min(least, (number - first) % row);
    most = std::max(most, (number - first) % row);
  }
  const std::int64_t rows = (numbers.back() - first) / row - (numbers.front() - first) / row + 1;
  return rows * (most - least + 1);
}

// Column and row of each number, relative to the first of them.
std::vector<std::pair<int, int>> PlacesOf(int first, const std::vector<int>& numbers, int row) {
  std::vector<std::pair<int, int>> places;
  for (const int number : numbers) {
    places.emplace_back((number - first) % row - (numbers.front() - first) % row,
                        (number - first) / row - (numbers.front() - first) / row);
  }
  return places;
}

}  // namespace

int FirstOfNumbering(const std::vector<int>& numbers, int row) {
  if (numbers.empty() || numbers.front() < 1) return 0;
  const bool may_be_one =
      numbers.front() == 1 || static_cast<std::int64_t>(row) * row == numbers.back();
  if (!may_be_one) return 0;
  // All rectangles hold the same views: the smaller one has fewer missing.
  return PlacesFrom(1, numbers, row) < PlacesFrom(0, numbers, row) ? 1 : 0;
}

bool MayStartAtOne(const std::vector<int>& numbers, int row) {
  return !numbers.empty() && numbers.front() >= 1 && numbers.front() <= row &&
         FirstOfNumbering(numbers, row) == 0 &&
         PlacesFrom(1, numbers, row) == PlacesFrom(0, numbers, row) &&
         PlacesOf(1, numbers, row) != PlacesOf(0, numbers, row);
}

ViewGrid GridOfNumbers(const std::string& path, const std::vector<NumberedView>& views,
                       const LightFieldReading& reading, std::optional<int> stated_first) {
  const auto [least, most] = std::minmax_element(
      views.begin(), views.end(), [](const auto& a, const auto& b) { return a.u < b.u; });
  if (least == views.end()) throw Error(fmt::format("{}: no view is in it", path));
  const auto count = static_cast<int>(views.size());
  int row = reading.layout_u > 0 ? reading.layout_u : reading.grid;
  const bool is_gapless = most->u - least->u == count - 1;
  // Numbers with any start may form the full rectangle; others count from 0 or 1.
  const bool is_full = row > 0 && is_gapless && count % row == 0;
  int first = least->u;
  bool may_start_at_one = false;
  if (row > 0 && least->u > 0 && !is_full) {
    std::vector<int> numbers;
    for (const NumberedView& view : views) numbers.push_back(view.u);
    std::sort(numbers.begin(), numbers.end());
    first = stated_first ? *stated_first : FirstOfNumbering(numbers, row);
    may_start_at_one = MayStartAtOne(numbers, row);
  }
  // "parts:4x6" of 25 pages: without this, 7 rows with views missing. Numbers with gaps may be a
  // part of the stated views: if it is no rectangle, the message names the missing ones.
  const int stated = reading.layout_u * reading.layout_v;
  if (stated > 0 && (count > stated || (count < stated && is_gapless && !reading.sparse))) {
    throw Error(fmt::format(
        "{}: the option layout states {} x {} views, which are {}, but {} are there, from {} to {}",
        path, reading.layout_u, reading.layout_v, stated, count, PrintableUtf8(least->file),
        PrintableUtf8(most->file)));
  }
  if (row <= 0) {
    row = static_cast<int>(std::lround(std::sqrt(count)));
    if (row * row != count || !is_gapless) {
      throw Error(fmt::format(
          "{}: {} views from {} to {} do not form a full square: the option grid must state how "
          "many views the numbering counts per row",
          path, count, PrintableUtf8(least->file), PrintableUtf8(most->file)));
    }
  }
  std::vector<NumberedView> placed;
  for (const NumberedView& view : views)
    placed.push_back({(view.u - first) % row, (view.u - first) / row, view.file});
  ViewGrid grid = GridOfViews(path, placed, reading);
  grid.first_number = first;
  grid.may_start_at_one = may_start_at_one;
  return grid;
}

}  // namespace thicklens::io

#include "tools/io/lightfields/tile_lines.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "thicklens/base/cancel.h"
#include "tools/io/lightfields/image_tiles.h"

namespace thicklens::io {
namespace {

// The mean deviation within a line, relative to that within a usual column: JPEG of low quality
// leaves 0.2.
constexpr double kFlat = 0.3;
// The column beside a line differs from the line's colour at least by this part of what columns
// usually do: beside an object on a plain background few pixels differ.
constexpr double kSharp = 0.1;
// JPEG changes the columns so near to an edge that they seem to belong to its other side, or to
// none.
constexpr int kBlurPx = 3;
// The columns of such a line differ from its colour by less than this part of what columns usually
// do, and those beside it by more.
constexpr double kOfLine = 0.3;
// Differences across the edges of views, relative to those elsewhere.
constexpr double kEdgeContrast = 1.3;

double Middle(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Mean absolute differences between the values of each column and its level, one for each column.
std::vector<double> DeviationsFrom(const std::vector<double>& levels, const cv::Mat& grey) {
  std::vector<double> sums(levels.size(), 0.0);
  for (int y = 0; y < grey.rows; ++y) {
    ThrowIfCancelled();
    const auto* row = grey.ptr<float>(y);
    for (std::size_t x = 0; x < sums.size(); ++x)
      sums[x] += std::abs(static_cast<double>(row[x]) - levels[x]);
  }
  for (double& sum : sums) sum /= grey.rows;
  return sums;
}

std::vector<double> MeansOf(const cv::Mat& grey) {
  std::vector<double> sums(static_cast<std::size_t>(grey.cols), 0.0);
  for (int y = 0; y < grey.rows; ++y) {
    ThrowIfCancelled();
    const auto* row = grey.ptr<float>(y);
    for (std::size_t x = 0; x < sums.size(); ++x) sums[x] += static_cast<double>(row[x]);
  }
  for (double& sum : sums) sum /= grey.rows;
  return sums;
}

// Neighbouring columns of one colour.
struct FlatRun {
  int at = 0, width = 0;
  double level = 0;
  int End() const { return at + width; }
};

std::vector<FlatRun> FlatRuns(const cv::Mat& grey, double* tolerance) {
  std::vector<FlatRun> runs;
  const std::vector<double> levels = MeansOf(grey);
  const std::vector<double> deviations = DeviationsFrom(levels, grey);
  *tolerance = kFlat * Middle(deviations);
  for (int x = 0; x < grey.cols; ++x) {
    const auto i = static_cast<std::size_t>(x);
    if (!(deviations[i] < *tolerance)) continue;
    if (!runs.empty() && runs.back().End() == x &&
        std::abs(runs.back().level - levels[i]) < *tolerance) {
      ++runs.back().width;
    } else {
      runs.push_back({x, 1, levels[i]});
    }
  }
  return runs;
}

// Whether runs of one colour are lines between tiles of one size, or the border around them.
std::optional<AxisLines> RegularLines(std::vector<FlatRun> runs, int columns) {
  AxisLines lines;
  const bool begins = runs.front().at == 0;
  const bool ends = runs.back().End() == columns;
  lines.first_px = begins ? runs.front().width : 0;
  const int last_px = ends ? runs.back().width : 0;
  if (begins) runs.erase(runs.begin());
  if (ends && !runs.empty()) runs.pop_back();
  lines.count = static_cast<int>(runs.size()) + 1;
  if (lines.count > kMaxTiles) return std::nullopt;
  if (!runs.empty()) lines.gap_px = runs.front().width;
  lines.tile_px = (runs.empty() ? columns - last_px : runs.front().at) - lines.first_px;
  // Lines on one side of each tile may be the uniform edge of the views, such as a sky.
  if (begins != ends) lines.one_side_px = lines.first_px + last_px;
  if (begins != ends && lines.one_side_px != lines.gap_px) return std::nullopt;
  if (lines.tile_px < kMinTilePx || 2 * lines.gap_px > lines.tile_px ||
      2 * std::max(lines.first_px, last_px) > lines.tile_px) {
    return std::nullopt;
  }
  const int step = lines.tile_px + lines.gap_px;
  for (int i = 1; i < lines.count; ++i) {
    const FlatRun& run = runs[static_cast<std::size_t>(i - 1)];
    if (run.width != lines.gap_px || run.at != lines.first_px + i * step - lines.gap_px)
      return std::nullopt;
  }
  const int end = lines.first_px + lines.count * step - lines.gap_px + last_px;
  return end == columns ? std::optional(lines) : std::nullopt;
}

// The lines of one width between and around `count` tiles of one size; none if the columns do not
// suffice for whole pixels.
std::optional<AxisLines> EvenLines(int columns, int count, int gap_px, int first_px) {
  const int rest = columns - 2 * first_px - (count - 1) * gap_px;
  if (rest < count * std::max(kMinTilePx, 2 * std::max(gap_px, first_px)) || rest % count != 0) {
    return std::nullopt;
  }
  AxisLines lines;
  lines.count = count;
  lines.gap_px = gap_px;
  lines.first_px = first_px;
  lines.tile_px = rest / count;
  return lines;
}

// The lines, the border before the first tile and after the last one too.
std::vector<FlatRun> RunsOf(const AxisLines& lines, int columns) {
  std::vector<FlatRun> runs;
  if (lines.first_px > 0) runs.push_back({0, lines.first_px, lines.level});
  for (int i = 1; i < lines.count; ++i) {
    runs.push_back({lines.first_px + i * (lines.tile_px + lines.gap_px) - lines.gap_px,
                    lines.gap_px, lines.level});
  }
  if (lines.first_px > 0) runs.push_back({columns - lines.first_px, lines.first_px, lines.level});
  return runs;
}

// Whether the columns beside lines of one colour differ from it as the others do.
bool AreSharp(const cv::Mat& grey, const std::vector<FlatRun>& lines) {
  const std::vector<double> differences = DeviationsFrom(
      std::vector<double>(static_cast<std::size_t>(grey.cols), lines.front().level), grey);
  const double least = kSharp * Middle(differences);
  for (const FlatRun& line : lines) {
    if (line.at > 0 && differences[static_cast<std::size_t>(line.at - 1)] < least) return false;
    if (line.End() < grey.cols && differences[static_cast<std::size_t>(line.End())] < least)
      return false;
  }
  return true;
}

// Mean absolute difference between the columns x - 1 and x.
double StepAt(const cv::Mat& grey, int x) {
  double sum = 0;
  for (int y = 0; y < grey.rows; ++y) {
    const auto* row = grey.ptr<float>(y);
    sum += std::abs(row[x] - row[x - 1]);
  }
  return sum / grey.rows;
}

// Lines whose edges JPEG blurred, so that runs of several widths are found in the place of lines of
// one width: of the lines of one width about there, which have the colour of the runs and no column
// beside them has it, those at whose edges the columns differ most. Fewer than three tiles may be
// anything.
std::optional<AxisLines> BlurredLines(const cv::Mat& grey, const std::vector<FlatRun>& runs) {
  const bool begins = runs.front().at <= kBlurPx;
  const bool ends = runs.back().End() >= grey.cols - kBlurPx;
  const std::size_t outer = begins ? 2 : 0;
  if (begins != ends || runs.size() < outer + 2) return std::nullopt;
  const int count = static_cast<int>(runs.size() - outer) + 1;
  if (count > kMaxTiles) return std::nullopt;
  const auto by_width = [](const FlatRun& a, const FlatRun& b) { return a.width < b.width; };
  const int widest_px = std::max_element(runs.begin(), runs.end(), by_width)->width + 2 * kBlurPx;
  const double level = runs.front().level;
  const std::vector<double> differences =
      DeviationsFrom(std::vector<double>(static_cast<std::size_t>(grey.cols), level), grey);
  const double most = kOfLine * Middle(differences);
  const auto has_colour = [&](int x) { return differences[static_cast<std::size_t>(x)] < most; };
  const auto is_line = [&](const FlatRun& run, const FlatRun& line) {
    if (run.at < line.at - kBlurPx || run.End() > line.End() + kBlurPx) return false;
    if (line.at > 0 && has_colour(line.at - 1)) return false;
    if (line.End() < grey.cols && has_colour(line.End())) return false;
    for (int x = line.at; x < line.End(); ++x) {
      if (!has_colour(x)) return false;
    }
    return true;
  };
  // Views that show an object on a plain background are no narrower than the image says.
  const bool is_whole = grey.cols % count == 0 && RatioAt(grey, grey.cols / count) < kRepeats;
  std::optional<AxisLines> best;
  double best_step = 0;
  for (int gap = 1; gap <= widest_px; ++gap) {
    ThrowIfCancelled();
    for (int first = begins ? 1 : 0; first <= (begins ? widest_px : 0); ++first) {
      std::optional<AxisLines> lines = EvenLines(grey.cols, count, gap, first);
      if (!lines || (is_whole && 2 * first != gap)) continue;
      const std::vector<FlatRun> places = RunsOf(*lines, grey.cols);
      if (!std::equal(runs.begin(), runs.end(), places.begin(), places.end(), is_line)) continue;
      double sum = 0, edges = 0;
      for (const FlatRun& line : places) {
        for (const int x : {line.at, line.End()}) {
          if (x == 0 || x == grey.cols) continue;
          sum += StepAt(grey, x);
          ++edges;
        }
      }
      if (sum > best_step * edges) {
        best_step = sum / edges;
        best = lines;
      }
    }
  }
  return best;
}

// Lines of the width and colour of those along the other axis, which may lie beside parts of the
// views that have their colour, such as a white sky.
std::optional<AxisLines> LinesLike(const AxisLines& other, const cv::Mat& grey) {
  double tolerance = 0;
  std::vector<FlatRun> runs;
  for (const FlatRun& run : FlatRuns(grey, &tolerance)) {
    if (std::abs(run.level - other.level) < tolerance) runs.push_back(run);
  }
  const auto is_flat = [&runs](const FlatRun& line) {
    return std::any_of(runs.begin(), runs.end(), [&](const FlatRun& run) {
      return run.at <= line.at && line.End() <= run.End();
    });
  };
  std::vector<RatioOfCount> ratios;
  for (int count = 2; count <= kMaxTiles; ++count) {
    const std::optional<AxisLines> lines =
        EvenLines(grey.cols, count, other.gap_px, other.first_px);
    if (!lines) continue;
    const std::vector<FlatRun> places = RunsOf(*lines, grey.cols);
    if (std::all_of(places.begin(), places.end(), is_flat))
      ratios.emplace_back(count, RatioAt(grey, lines->tile_px + lines->gap_px));
  }
  const int count = CountOf(ratios);
  return count > 1 ? EvenLines(grey.cols, count, other.gap_px, other.first_px) : std::nullopt;
}

AxisLines LinesAcross(const cv::Mat& grey, bool may_be_blurred) {
  AxisLines none;
  none.tile_px = grey.cols;
  if (grey.cols < kMinTilePx || grey.rows < 1) return none;
  double tolerance = 0;
  const std::vector<FlatRun> runs = FlatRuns(grey, &tolerance);
  std::vector<double> tried;
  constexpr std::size_t kMaxColours = 8;
  for (const FlatRun& first : runs) {
    const auto is_alike = [&](double level) { return std::abs(level - first.level) < tolerance; };
    if (std::any_of(tried.begin(), tried.end(), is_alike)) continue;
    if (tried.size() == kMaxColours) break;
    tried.push_back(first.level);
    std::vector<FlatRun> of_colour;
    for (const FlatRun& run : runs) {
      if (is_alike(run.level)) of_colour.push_back(run);
    }
    std::optional<AxisLines> lines = RegularLines(of_colour, grey.cols);
    if (lines && !AreSharp(grey, of_colour)) continue;
    if (!lines && may_be_blurred) lines = BlurredLines(grey, of_colour);
    if (!lines) continue;
    lines->level = first.level;
    if (lines->one_side_px == 0) return *lines;
    none.one_side_px = lines->one_side_px;
  }
  return none;
}

}  // namespace

TileLines LinesOf(const cv::Mat& pixels, bool may_be_blurred) {
  const cv::Mat grey = GreyOf(pixels), transposed = grey.t();
  TileLines lines = {LinesAcross(grey, may_be_blurred), LinesAcross(transposed, may_be_blurred)};
  const auto complete = [](const AxisLines& other, const cv::Mat& image, AxisLines* axis) {
    if (other.count < 2 || other.gap_px == 0 || axis->count > 1) return;
    if (const std::optional<AxisLines> like = LinesLike(other, image)) *axis = *like;
  };
  complete(lines.across, transposed, &lines.down);
  complete(lines.down, grey, &lines.across);
  return lines;
}

bool AreEdgesWithinBorder(const cv::Mat& pixels, AxisLines border, int count, bool is_down) {
  cv::Mat grey = GreyOf(pixels);
  if (is_down) grey = grey.t();
  double within = 0, whole = 0;
  for (int i = 1; i < count; ++i) {
    const int edge_within = border.first_px + i * (border.tile_px / count);
    const int edge_whole = i * (grey.cols / count);
    if (edge_within == edge_whole) continue;  // as in the middle of an even number
    within += StepAt(grey, edge_within);
    whole += StepAt(grey, edge_whole);
  }
  return within > kEdgeContrast * whole;
}

}  // namespace thicklens::io

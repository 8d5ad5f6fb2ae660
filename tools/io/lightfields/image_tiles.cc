#include "tools/io/lightfields/image_tiles.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"

namespace thicklens::io {
namespace {

constexpr int kMaxTiles = 40;
constexpr int kMinTilePx = 8;
// Views side by side differ by their parallax only. A photograph without repetitions has a ratio
// near 1.
constexpr double kRepeats = 0.5;
constexpr int kMaxPitchPx = 100;
// Fewer edges may stand at regular distances by chance.
constexpr int kMinEdges = 8;  // half of it up to kSmallPitchPx
constexpr int kSmallPitchPx = 20;
// Differences across the edge of a lenslet, relative to those inside.
constexpr double kEdgeContrast = 1.3;
// The mean deviation within a line, relative to that within a usual column: JPEG of low quality
// leaves 0.2.
constexpr double kFlat = 0.3;
// The column beside a line differs from the line's colour at least by this part of what columns
// usually do: beside an object on a plain background few pixels differ.
constexpr double kSharp = 0.1;
// Rows of an image that are compared.
constexpr int kRows = 400;

// Grey values of the image, or of its transpose, as floats.
cv::Mat GreyOf(const cv::Mat& pixels) {
  cv::Mat grey(pixels.rows, pixels.cols, CV_32F);
  cv::Mat floats;
  pixels.convertTo(floats, CV_32F);
  const int channels = floats.channels();
  const int kept = channels == 2 || channels == 4 ? channels - 1 : channels;
  for (int y = 0; y < floats.rows; ++y) {
    ThrowIfCancelled();
    const auto* row = floats.ptr<float>(y);
    auto* out = grey.ptr<float>(y);
    for (int x = 0; x < floats.cols; ++x) {
      float sum = 0;
      for (int c = 0; c < kept; ++c) {
        const float value = row[static_cast<std::ptrdiff_t>(x) * channels + c];
        sum += std::isfinite(value) ? value : 0.0F;
      }
      out[x] = sum;
    }
  }
  return grey;
}

// Mean absolute difference of pixels `lag` apart across.
double DifferenceAt(const cv::Mat& grey, int lag) {
  const int stride = std::max(1, grey.rows / kRows);
  double sum = 0, count = 0;
  for (int y = 0; y < grey.rows; y += stride) {
    const auto* row = grey.ptr<float>(y);
    for (int x = 0; x + lag < grey.cols; ++x) sum += std::abs(row[x + lag] - row[x]);
    count += std::max(0, grey.cols - lag);
  }
  return count > 0 ? sum / count : 0;
}

bool RepeatsAcross(const cv::Mat& grey, int count) {
  if (count < 2 || grey.cols % count != 0) return count == 1;
  ThrowIfCancelled();
  const int lag = grey.cols / count;
  return DifferenceAt(grey, lag) < kRepeats * DifferenceAt(grey, lag / 2);
}

int RepetitionsAcross(const cv::Mat& grey) {
  for (int count = std::min(kMaxTiles, grey.cols / kMinTilePx); count >= 2; --count) {
    if (RepeatsAcross(grey, count)) return count;
  }
  return 1;
}

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

// Whether the columns beside the lines differ from them as the others do.
bool AreSharp(const cv::Mat& grey, const std::vector<FlatRun>& runs) {
  const std::vector<double> differences = DeviationsFrom(
      std::vector<double>(static_cast<std::size_t>(grey.cols), runs.front().level), grey);
  const double least = kSharp * Middle(differences);
  for (const FlatRun& run : runs) {
    if (run.at > 0 && differences[static_cast<std::size_t>(run.at - 1)] < least) return false;
    if (run.End() < grey.cols && differences[static_cast<std::size_t>(run.End())] < least)
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

AxisLines LinesAcross(const cv::Mat& grey) {
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
    const std::optional<AxisLines> lines = RegularLines(of_colour, grey.cols);
    if (!lines || !AreSharp(grey, of_colour)) continue;
    if (lines->one_side_px == 0) return *lines;
    none.one_side_px = lines->one_side_px;
  }
  return none;
}

int PitchAcross(const cv::Mat& grey) {
  // Mean difference between the columns x and x + 1.
  std::vector<double> step(static_cast<std::size_t>(std::max(0, grey.cols - 1)), 0.0);
  const int stride = std::max(1, grey.rows / kRows);
  for (int y = 0; y < grey.rows; y += stride) {
    const auto* row = grey.ptr<float>(y);
    for (std::size_t x = 0; x < step.size(); ++x) step[x] += std::abs(row[x + 1] - row[x]);
  }
  // The contrast of the edges at every `pitch` columns, without those at every `left_out` columns.
  const auto contrast_of = [&step](int pitch, int left_out) {
    double edge = 0, inside = 0, edges = 0, insides = 0;
    for (std::size_t i = 0; i < step.size(); ++i) {
      const int x = static_cast<int>(i);
      const bool is_edge = x % pitch == pitch - 1;
      if (is_edge && left_out > 0 && x % left_out == left_out - 1) continue;
      (is_edge ? edge : inside) += step[i];
      (is_edge ? edges : insides) += 1;
    }
    return edges > 0 && inside > 0 ? (edge / edges) / (inside / insides) : 0.0;
  };
  int best = 0;
  double best_contrast = kEdgeContrast;
  for (int pitch = 2; pitch <= kMaxPitchPx; ++pitch) {
    if (grey.cols < (pitch > kSmallPitchPx ? kMinEdges : kMinEdges / 2) * pitch) break;
    ThrowIfCancelled();
    const double contrast = contrast_of(pitch, 0);
    if (contrast > best_contrast) {
      best_contrast = contrast;
      best = pitch;
    }
  }
  // Multiples of a pitch have its edges too.
  for (int pitch = 2; pitch < best; ++pitch) {
    if (best % pitch == 0 && contrast_of(pitch, best) > kEdgeContrast) return pitch;
  }
  return best;
}

}  // namespace

AxisCounts RepetitionsOf(const cv::Mat& pixels) {
  const cv::Mat grey = GreyOf(pixels);
  return {RepetitionsAcross(grey), RepetitionsAcross(grey.t())};
}

bool Repeats(const cv::Mat& pixels, AxisCounts counts) {
  const cv::Mat grey = GreyOf(pixels);
  return RepeatsAcross(grey, counts.across) && RepeatsAcross(grey.t(), counts.down);
}

TileLines LinesOf(const cv::Mat& pixels) {
  const cv::Mat grey = GreyOf(pixels);
  return {LinesAcross(grey), LinesAcross(grey.t())};
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

int LensletPitchOf(const cv::Mat& pixels) {
  const cv::Mat grey = GreyOf(pixels);
  const int across = PitchAcross(grey);
  return across == PitchAcross(grey.t()) ? across : 0;
}

std::string CommonDivisors(int width_px, int height_px) {
  std::vector<int> divisors;
  for (int n = 2; n <= kMaxTiles; ++n) {
    if (width_px % n == 0 && height_px % n == 0) divisors.push_back(n);
  }
  return divisors.empty() ? "none" : fmt::format("{}", fmt::join(divisors, ", "));
}

}  // namespace thicklens::io

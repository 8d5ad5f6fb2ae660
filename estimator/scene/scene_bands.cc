#include "estimator/scene/scene_bands.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace thicklens::estimator {
namespace {

constexpr int kSlopeMarginPx = 8;
// Margin for the smoothing of the slopes and for the prior, whatever the blur.
constexpr int kMinMarginPx = 16;
constexpr int kReaches = 4;

SceneBand WithMargin(int first, int last, int height_px, int margin_px) {
  return {first, last, std::max(0, first - margin_px), std::min(height_px, last + margin_px)};
}

// Returns the values of the rows [from, to) of an image with `in_row` values in a row.
std::vector<float> RowsOf(const std::vector<float>& values, std::size_t in_row, int from, int to) {
  const auto row = [&](int y) {
    return values.begin() + static_cast<std::ptrdiff_t>(static_cast<std::size_t>(y) * in_row);
  };
  return {row(from), row(to)};
}

}  // namespace

std::vector<SceneBand> BandsOf(int height_px, int count, int margin_px) {
  std::vector<SceneBand> bands;
  const auto border = [&](int i) {
    return static_cast<int>(static_cast<long long>(height_px) * i / count);
  };
  for (int i = 0; i < count; ++i) {
    bands.push_back(WithMargin(border(i), border(i + 1), height_px, margin_px));
  }
  return bands;
}

std::vector<SceneBand> SampleBands(int height_px, int rows, int stride, int margin_px) {
  std::vector<SceneBand> bands;
  const int count = (height_px + rows - 1) / rows;
  for (int i = std::min(stride / 2, count - 1); i < count; i += stride) {
    const int last = std::min(height_px, (i + 1) * rows);
    bands.push_back(WithMargin(i * rows, last, height_px, margin_px));
  }
  return bands;
}

int ReachPx(const DisparityMap& disparity, double landing_step_px, int v_count) {
  const auto [least, most] =
      std::minmax_element(disparity.disparity.begin(), disparity.disparity.end());
  const auto step_px = [&](float value) {
    return std::abs(static_cast<double>(value) * disparity.step.y() - landing_step_px);
  };
  const double largest_px = std::max(step_px(*least), step_px(*most));
  return static_cast<int>(std::ceil((v_count - 1) / 2.0 * largest_px)) + 2;
}

int SampleMarginPx(int reach_px) { return kSlopeMarginPx + 2 * reach_px; }

int BandMarginPx(int reach_px) { return kMinMarginPx + kReaches * reach_px; }

model::LinearImage CutRows(const model::LinearImage& image, int from, int to) {
  const std::size_t in_row =
      static_cast<std::size_t>(image.width_px) * static_cast<std::size_t>(image.channels);
  return {image.width_px, to - from, image.channels, RowsOf(image.values, in_row, from, to)};
}

DisparityMap CutRows(const DisparityMap& map, int from, int to) {
  return {map.width_px, to - from,
          RowsOf(map.disparity, static_cast<std::size_t>(map.width_px), from, to), map.step};
}

}  // namespace thicklens::estimator

// Reads an image for a view in plain C++; warp.cl computes the same.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "kernels/reference/warp_arguments.h"
#include "thicklens/base/error.h"
#include "thicklens/base/index.h"
#include "thicklens/kernels/catmull_rom.h"
#include "thicklens/kernels/view_warp.h"

namespace thicklens::kernels {
namespace {

std::size_t PixelsOf(const SurfaceImage& image) {
  return Index(image.width_px) * Index(image.height_px);
}

// A position on a line of pixels: the pixel before it, and the distance from that pixel, < 1.
struct Place {
  int pixel = 0;
  float rest = 0;
};
// `limit_px` is larger than the length of the line.
Place PlaceAt(int sample, float source, int count, float limit_px) {
  const float way = std::clamp(source, -limit_px, limit_px);
  const float below = std::floor(way);
  const int at = sample + static_cast<int>(below);
  const int pixel = std::clamp(at, 0, count - 1);
  return {pixel, at == pixel && at < count - 1 ? way - below : 0.0F};
}

class ReferenceWarp : public ViewWarp {
 public:
  explicit ReferenceWarp(const SurfaceImage& image) : image_(image), ranges_(TapRangesOf(image)) {}

  void Warp(const ViewSources& view, std::vector<float>* values) override {
    CheckView(image_, view);
    values->resize(image_.values->size());
    for (std::size_t i = 0; i < view.disparity->size(); ++i) {
      const float disparity = (*view.disparity)[i];
      if (std::isnan(disparity)) continue;
      ReadSample(i, static_cast<float>(view.shift_x * disparity),
                 static_cast<float>(view.shift_y * disparity), disparity, values);
    }
    for (const OccludedSample& occluded : *view.occluded) {
      ReadSample(Index(occluded.index), occluded.source_x, occluded.source_y, occluded.disparity,
                 values);
    }
    if (view.boundary == nullptr) return;
    for (const BoundarySample& boundary : *view.boundary) MixInto(boundary, values);
  }

 private:
  void ReadSample(std::size_t sample, float source_x, float source_y, float disparity,
                  std::vector<float>* values) const {
    const SourcePlace source = PlaceOf(sample, source_x, source_y);
    const Place &across = source.across, &down = source.down;
    const std::size_t there = At(across.pixel, down.pixel);
    const bool cubic = IsOnSurface(ranges_.lowest[there], disparity) &&
                       IsOnSurface(ranges_.highest[there], disparity);
    for (int channel = 0; channel < image_.channels; ++channel) {
      (*values)[sample * Index(image_.channels) + Index(channel)] =
          cubic ? Cubic(across, down, channel) : Linear(across, down, disparity, channel);
    }
  }

  void MixInto(const BoundarySample& boundary, std::vector<float>* values) const {
    const std::size_t sample = Index(boundary.index);
    const SourcePlace source = PlaceOf(sample, boundary.other.source_x, boundary.other.source_y);
    for (int channel = 0; channel < image_.channels; ++channel) {
      float& value = (*values)[sample * Index(image_.channels) + Index(channel)];
      const float other = Linear(source.across, source.down, boundary.other.disparity, channel);
      value += boundary.share * (other - value);
    }
  }

  struct SourcePlace {
    Place across, down;
  };
  SourcePlace PlaceOf(std::size_t sample, float source_x, float source_y) const {
    const auto limit_px = static_cast<float>(image_.width_px + image_.height_px);
    const int x = static_cast<int>(sample % Index(image_.width_px));
    const int y = static_cast<int>(sample / Index(image_.width_px));
    return {PlaceAt(x, source_x, image_.width_px, limit_px),
            PlaceAt(y, source_y, image_.height_px, limit_px)};
  }

  std::size_t At(int x, int y) const {
    return Index(std::clamp(y, 0, image_.height_px - 1)) * Index(image_.width_px) +
           Index(std::clamp(x, 0, image_.width_px - 1));
  }
  float ValueAt(int x, int y, int channel) const {
    return (*image_.values)[At(x, y) * Index(image_.channels) + Index(channel)];
  }
  bool IsOnSurface(float there, float disparity) const {
    return std::abs(there - disparity) <= image_.tolerance;
  }

  float Cubic(const Place& across, const Place& down, int channel) const {
    const std::array<float, 4> weight_x = CatmullRomWeights(across.rest);
    const std::array<float, 4> weight_y = CatmullRomWeights(down.rest);
    float sum = 0;
    for (int j = 0; j < 4; ++j) {
      float row = 0;
      for (int i = 0; i < 4; ++i) {
        row += weight_x[Index(i)] * ValueAt(across.pixel - 1 + i, down.pixel - 1 + j, channel);
      }
      sum += weight_y[Index(j)] * row;
    }
    return sum;
  }

  float Linear(const Place& across, const Place& down, float disparity, int channel) const {
    float sum = 0, sum_of_weights = 0, closest_value = 0;
    float closest = std::numeric_limits<float>::infinity();
    for (int j = 0; j < 2; ++j) {
      for (int i = 0; i < 2; ++i) {
        const float weight =
            (i == 0 ? 1 - across.rest : across.rest) * (j == 0 ? 1 - down.rest : down.rest);
        if (weight == 0) continue;  // may be outside of the image
        const int x = across.pixel + i, y = down.pixel + j;
        const float there = (*image_.disparity)[At(x, y)];
        if (std::abs(there - disparity) < closest) {
          closest = std::abs(there - disparity);
          closest_value = ValueAt(x, y, channel);
        }
        if (!IsOnSurface(there, disparity)) continue;
        sum_of_weights += weight;
        sum += weight * ValueAt(x, y, channel);
      }
    }
    return sum_of_weights > 0 ? sum / sum_of_weights : closest_value;
  }

  const SurfaceImage image_;
  const TapRanges ranges_;
};

void CheckCount(const char* what, const std::vector<float>* numbers, std::size_t count) {
  if (numbers != nullptr && numbers->size() == count) return;
  throw Error(fmt::format("{}: it has {} numbers: it must have {}", what,
                          numbers == nullptr ? 0 : numbers->size(), count));
}

}  // namespace

void CheckImage(const SurfaceImage& image) {
  if (image.width_px < 1 || image.height_px < 1 || image.channels < 1) {
    throw Error(fmt::format("image of surfaces: {}x{} px in {} channels: each must be >= 1",
                            image.width_px, image.height_px, image.channels));
  }
  CheckCount("image of surfaces", image.values, PixelsOf(image) * Index(image.channels));
  CheckCount("disparity of an image", image.disparity, PixelsOf(image));
  if (!(image.tolerance >= 0)) {
    throw Error(fmt::format("tolerance of a surface is {}: it must be >= 0", image.tolerance));
  }
}

namespace {

void CheckBoundarySamples(const std::vector<BoundarySample>& boundary, std::size_t pixels) {
  std::int32_t before = -1;  // otherwise two items of a device would write one sample
  for (const BoundarySample& one : boundary) {
    if (one.index <= before || Index(one.index) >= pixels) {
      throw Error(fmt::format(
          "boundary sample of a view has the index {} after {}: indices must ascend from "
          "0 to at most {}",
          one.index, before, pixels - 1));
    }
    before = one.index;
    if (one.share >= 0 && one.share <= 1) continue;
    throw Error(fmt::format("boundary sample {} of a view has the share {}: it must be 0 to 1",
                            one.index, one.share));
  }
}

}  // namespace

void CheckView(const SurfaceImage& image, const ViewSources& view) {
  CheckCount("disparity of a view", view.disparity, PixelsOf(image));
  for (const double shift : {view.shift_x, view.shift_y}) {
    if (std::isfinite(shift)) continue;
    throw Error(fmt::format("shift of a view is {}: it must be finite", shift));
  }
  if (view.occluded == nullptr)
    throw Error(
        "occluded samples of a view: the list is missing: an empty list is expected if no sample "
        "is "
        "hidden");
  for (const OccludedSample& occluded : *view.occluded) {
    if (!(occluded.index >= 0 && Index(occluded.index) < PixelsOf(image))) {
      throw Error(fmt::format("occluded sample of a view has the index {}: it must be 0 to {}",
                              occluded.index, PixelsOf(image) - 1));
    }
    // Otherwise two items of a device would write this sample.
    const float seen = (*view.disparity)[Index(occluded.index)];
    if (std::isnan(seen)) continue;
    throw Error(
        fmt::format("occluded sample {} of a view has the disparity {} in the list of visible "
                    "samples: it must be NaN there",
                    occluded.index, seen));
  }
  if (view.boundary != nullptr) CheckBoundarySamples(*view.boundary, PixelsOf(image));
}

TapRanges TapRangesOf(const SurfaceImage& image) {
  CheckImage(image);
  const int width = image.width_px, height = image.height_px;
  TapRanges ranges{std::vector<float>(PixelsOf(image)), std::vector<float>(PixelsOf(image))};
  const auto row_at = [&](int y) {
    return image.disparity->data() + Index(std::clamp(y, 0, height - 1)) * Index(width);
  };
  // The extremes of the four pixels in each column, then of four columns.
  std::vector<float> lowest(Index(width)), highest(Index(width));
  for (int y = 0; y < height; ++y) {
    const float* const rows[] = {row_at(y - 1), row_at(y), row_at(y + 1), row_at(y + 2)};
    for (std::size_t x = 0; x < Index(width); ++x) {
      lowest[x] = std::min({rows[0][x], rows[1][x], rows[2][x], rows[3][x]});
      highest[x] = std::max({rows[0][x], rows[1][x], rows[2][x], rows[3][x]});
    }
    for (int x = 0; x < width; ++x) {
      const std::size_t i = Index(y) * Index(width) + Index(x);
      const std::size_t before = Index(std::max(x - 1, 0));
      const std::size_t next = Index(std::min(x + 1, width - 1));
      const std::size_t last = Index(std::min(x + 2, width - 1));
      ranges.lowest[i] = std::min({lowest[before], lowest[Index(x)], lowest[next], lowest[last]});
      ranges.highest[i] =
          std::max({highest[before], highest[Index(x)], highest[next], highest[last]});
    }
  }
  return ranges;
}

std::unique_ptr<ViewWarp> NewReferenceWarp(const SurfaceImage& image) {
  return std::make_unique<ReferenceWarp>(image);
}

}  // namespace thicklens::kernels

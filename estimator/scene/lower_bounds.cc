#include "estimator/scene/lower_bounds.h"

#include <algorithm>

#include "thicklens/base/index.h"

namespace thicklens::estimator {

std::vector<std::size_t> BoundsInPlanes(const ClippedValues& clipped, int width_px, int channels,
                                        int from, int to) {
  std::vector<std::size_t> bounds;
  if (clipped.empty()) return bounds;
  const std::size_t pixels = Index(width_px) * Index(to - from);
  const std::size_t first = Index(width_px) * Index(from);
  for (int channel = 0; channel < channels; ++channel) {
    for (std::size_t i = 0; i < pixels; ++i) {
      if (clipped[(first + i) * Index(channels) + Index(channel)] != 0)
        bounds.push_back(Index(channel) * pixels + i);
    }
  }
  return bounds;
}

ClippedValues HalfSize(const ClippedValues& clipped, int width_px, int height_px, int channels) {
  ClippedValues half;
  if (clipped.empty()) return half;
  const auto at = [&](int x, int y, int channel) {
    return clipped[(Index(y) * Index(width_px) + Index(x)) * Index(channels) + Index(channel)];
  };
  for (int y = 0; y < height_px; y += 2) {
    const int y1 = std::min(y + 1, height_px - 1);
    for (int x = 0; x < width_px; x += 2) {
      const int x1 = std::min(x + 1, width_px - 1);
      for (int c = 0; c < channels; ++c)
        half.push_back(std::max({at(x, y, c), at(x1, y, c), at(x, y1, c), at(x1, y1, c)}));
    }
  }
  return half;
}

ClippedValues CutRows(const ClippedValues& clipped, int width_px, int channels, int from, int to) {
  if (clipped.empty()) return {};
  const auto in_row = static_cast<std::ptrdiff_t>(Index(width_px) * Index(channels));
  return {clipped.begin() + from * in_row, clipped.begin() + to * in_row};
}

ClippedValues InAnyChannel(const ClippedValues& clipped, int channels) {
  ClippedValues pixels(clipped.size() / Index(channels));
  for (std::size_t i = 0; i < clipped.size(); ++i)
    pixels[i / Index(channels)] = std::max(pixels[i / Index(channels)], clipped[i]);
  return pixels;
}

}  // namespace thicklens::estimator

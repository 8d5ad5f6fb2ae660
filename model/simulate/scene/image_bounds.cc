#include "model/simulate/scene/image_bounds.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "thicklens/base/cancel.h"

namespace thicklens::model {
namespace {

constexpr int kFinestBits = 2;  // log2 of the finest block size, 4 px
constexpr int kMaxBlocks = 3;   // maximum number on each axis of a look-up

void Include(const ValueRange& other, ValueRange* range) {
  range->low = std::min(range->low, other.low);
  range->high = std::max(range->high, other.high);
}

constexpr ValueRange kNothing = {std::numeric_limits<double>::infinity(),
                                 -std::numeric_limits<double>::infinity()};

}  // namespace

ImageBounds::ImageBounds(int width_px, int height_px,
                         const std::function<double(int x, int y)>& value)
    : width_px_(width_px), height_px_(height_px) {
  Level finest;
  finest.columns = ((width_px - 1) >> kFinestBits) + 1;
  finest.rows = ((height_px - 1) >> kFinestBits) + 1;
  finest.blocks.assign(
      static_cast<std::size_t>(finest.columns) * static_cast<std::size_t>(finest.rows), kNothing);
  // A block contains the cells between its pixels and the next ones, so that it includes the first
  // pixels of its neighbours.
  for (int y = 0; y < height_px; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < width_px; ++x) {
      const double number = value(x, y);
      for (int row = std::max(y - 1, 0) >> kFinestBits; row <= y >> kFinestBits; ++row) {
        for (int column = std::max(x - 1, 0) >> kFinestBits; column <= x >> kFinestBits; ++column) {
          Include({number, number}, &finest.blocks[static_cast<std::size_t>(row) *
                                                       static_cast<std::size_t>(finest.columns) +
                                                   static_cast<std::size_t>(column)]);
        }
      }
    }
  }
  levels_.push_back(std::move(finest));
  while (levels_.back().columns > 1 || levels_.back().rows > 1) {
    const Level& fine = levels_.back();
    Level coarse;
    coarse.columns = (fine.columns + 1) / 2;
    coarse.rows = (fine.rows + 1) / 2;
    coarse.blocks.assign(
        static_cast<std::size_t>(coarse.columns) * static_cast<std::size_t>(coarse.rows), kNothing);
    for (int row = 0; row < fine.rows; ++row) {
      for (int column = 0; column < fine.columns; ++column) {
        Include(fine.blocks[static_cast<std::size_t>(row) * static_cast<std::size_t>(fine.columns) +
                            static_cast<std::size_t>(column)],
                &coarse.blocks[static_cast<std::size_t>(row / 2) *
                                   static_cast<std::size_t>(coarse.columns) +
                               static_cast<std::size_t>(column / 2)]);
      }
    }
    levels_.push_back(std::move(coarse));
  }
}

ValueRange ImageBounds::Over(const ImageRegion& region) const {
  const auto pixel = [](double position_px, int size_px) {
    return static_cast<int>(std::clamp(position_px, 0.0, size_px - 1.0));
  };
  const int left = pixel(region.low_px.x(), width_px_) >> kFinestBits;
  const int right = pixel(region.high_px.x(), width_px_) >> kFinestBits;
  const int above = pixel(region.low_px.y(), height_px_) >> kFinestBits;
  const int below = pixel(region.high_px.y(), height_px_) >> kFinestBits;
  int level = 0;
  while ((right >> level) - (left >> level) >= kMaxBlocks ||
         (below >> level) - (above >> level) >= kMaxBlocks) {
    ++level;
  }
  const Level& of = levels_[static_cast<std::size_t>(level)];
  ValueRange range = kNothing;
  for (int row = above >> level; row <= below >> level; ++row) {
    for (int column = left >> level; column <= right >> level; ++column) {
      Include(of.blocks[static_cast<std::size_t>(row) * static_cast<std::size_t>(of.columns) +
                        static_cast<std::size_t>(column)],
              &range);
    }
  }
  return range;
}

}  // namespace thicklens::model

#ifndef THICKLENS_MODEL_STORED_LEVELS_H_
#define THICKLENS_MODEL_STORED_LEVELS_H_

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "thicklens/model/scene.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::model {

// The values that files store for light, for many pictures of one curve: the levels of
// floor(Encode(light) (2^bits - 1) + 1/2), clipped, without a power function for each value.
class StoredLevels {
 public:
  // Throws Error unless `bits` is 8 or 16.
  StoredLevels(const TransferCurve& transfer, int bits);

  int bits() const { return bits_; }

  // NaN is black.
  std::uint16_t LevelOf(float light) const {
    if (!(light > 0)) return 0;
    if (light >= least_light_.back()) return static_cast<std::uint16_t>(least_light_.size() - 1);
    std::size_t level = lowest_level_[CellOf(light)];
    while (light >= least_light_[level + 1]) ++level;
    return static_cast<std::uint16_t>(level);
  }

 private:
  // Light in cells of about one level each: curves are nearly straight over the root of light.
  std::size_t CellOf(float light) const {
    return static_cast<std::size_t>(std::sqrt(light) * static_cast<float>(least_light_.size()));
  }

  int bits_ = 8;
  std::vector<float> least_light_;           // of each level; 0 for level 0
  std::vector<std::uint16_t> lowest_level_;  // of the light in each cell
};

// ToStored(picture, transfer, bits) of the levels' curve and bits, the same values.
StoredPicture ToStored(const LinearPicture& picture, const StoredLevels& levels);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_STORED_LEVELS_H_

#ifndef THICKLENS_MODEL_QUANTISED_LEVELS_H_
#define THICKLENS_MODEL_QUANTISED_LEVELS_H_

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::model {

// Table of the values that files store for linear light, for many images of one transfer curve. It
// gives floor(Encode(light) (2^bits - 1) + 1/2), clipped, without a power function for each value.
class THICKLENS_EXPORT QuantisedLevels {
 public:
  // Throws Error unless `bits` is 8 or 16.
  QuantisedLevels(const TransferCurve& transfer, int bits);

  // The number of bits of a value, 8 or 16.
  int bits() const { return bits_; }

  // The encoded value of `light`, 1 at full scale. NaN gives 0.
  std::uint16_t LevelOf(float light) const {
    if (!(light > 0)) return 0;
    if (light >= least_light_.back()) return static_cast<std::uint16_t>(least_light_.size() - 1);
    std::size_t level = lowest_level_[CellOf(light)];
    while (light >= least_light_[level + 1]) ++level;
    return static_cast<std::uint16_t>(level);
  }

 private:
  // Index of the cell of `light`. Cells have about one level each, because curves are nearly
  // straight over the square root of light.
  std::size_t CellOf(float light) const {
    return static_cast<std::size_t>(std::sqrt(light) * static_cast<float>(least_light_.size()));
  }

  int bits_ = 8;
  std::vector<float> least_light_;           // minimum light of each level; 0 for level 0
  std::vector<std::uint16_t> lowest_level_;  // minimum level of the light in each cell
};

// Gives the same values as the other ToEncoded with the curve and the bits of `levels`. Throws
// Error if the number of values does not fit the size.
THICKLENS_EXPORT EncodedImage ToEncoded(const LinearImage& image, const QuantisedLevels& levels);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_QUANTISED_LEVELS_H_

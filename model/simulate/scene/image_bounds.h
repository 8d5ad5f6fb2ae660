#ifndef THICKLENS_MODEL_SIMULATE_SCENE_IMAGE_BOUNDS_H_
#define THICKLENS_MODEL_SIMULATE_SCENE_IMAGE_BOUNDS_H_

#include <functional>
#include <vector>

#include "model/simulate/scene/image_region.h"

namespace thicklens::model {

struct ValueRange {
  double low = 0, high = 0;
};

// Bounds of the numbers of an image over any region. The numbers are bilinear between pixel centres
// and constant beyond the outermost ones. A look-up reads at most nine blocks, regardless of the
// size of the region. The blocks of the finest level have 4 x 4 px, those of each further level
// twice the side.
class ImageBounds {
 public:
  ImageBounds(int width_px, int height_px, const std::function<double(int x, int y)>& value);

  // Returns a lower and an upper bound of the numbers at all positions of the region. They are
  // wider than necessary where the region ends inside a block.
  ValueRange Over(const ImageRegion& region) const;

 private:
  struct Level {
    int columns = 0, rows = 0;
    std::vector<ValueRange> blocks;
  };

  const int width_px_, height_px_;
  std::vector<Level> levels_;
};

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SCENE_IMAGE_BOUNDS_H_

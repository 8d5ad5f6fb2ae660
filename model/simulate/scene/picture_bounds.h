#ifndef THICKLENS_MODEL_SIMULATE_SCENE_PICTURE_BOUNDS_H_
#define THICKLENS_MODEL_SIMULATE_SCENE_PICTURE_BOUNDS_H_

#include <functional>
#include <vector>

#include "model/simulate/scene/picture_region.h"

namespace thicklens::model {

struct ValueRange {
  double low = 0, high = 0;
};

// Bounds of the numbers of a picture over any region of it: of what is bilinear between them and
// beyond the outermost as there. A region is looked up in at most nine blocks, whatever its size:
// of 4 x 4 px and of twice as much on each further level.
class PictureBounds {
 public:
  PictureBounds(int width_px, int height_px, const std::function<double(int x, int y)>& value);

  // No less and no more than what any position of the region has. Wider than need be where the
  // region ends within a block.
  ValueRange Over(const PictureRegion& region) const;

 private:
  struct Level {
    int columns = 0, rows = 0;
    std::vector<ValueRange> blocks;
  };

  const int width_px_, height_px_;
  std::vector<Level> levels_;
};

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SCENE_PICTURE_BOUNDS_H_

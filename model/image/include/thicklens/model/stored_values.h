#ifndef THICKLENS_MODEL_STORED_VALUES_H_
#define THICKLENS_MODEL_STORED_VALUES_H_

#include <vector>

#include "thicklens/model/scene.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::model {

// Stored values of an image in [0, 1], on which image metrics are computed. Channels are
// interleaved.
struct StoredValues {
  int width_px = 0;
  int height_px = 0;
  int channels = 0;  // 1 (grey) or 3 (sRGB)
  std::vector<float> values;
};
// Divides the stored values by full scale and leaves alpha out.
StoredValues StoredValuesOf(const StoredPicture& picture);
// Encodes by the transfer curve and clips to [0, 1], without rounding.
StoredValues StoredValuesOf(const LinearPicture& picture, const TransferCurve& transfer);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_STORED_VALUES_H_

#ifndef THICKLENS_MODEL_STORED_VALUES_H_
#define THICKLENS_MODEL_STORED_VALUES_H_

#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::model {

// Encoded values of an image in [0, 1], on which image metrics are computed. Channels are
// interleaved.
struct EncodedValues {
  int width_px = 0;           // width, px
  int height_px = 0;          // height, px
  int channels = 0;           // 1 (grey) or 3 (sRGB)
  std::vector<float> values;  // width * height * channels, rows from top to bottom
};
// Divides the encoded values by full scale and leaves alpha out.
THICKLENS_EXPORT EncodedValues EncodedValuesOf(const EncodedImage& image);
// Encodes by the transfer curve and clips to [0, 1], without rounding.
THICKLENS_EXPORT EncodedValues EncodedValuesOf(const LinearImage& image,
                                               const TransferCurve& transfer);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_STORED_VALUES_H_

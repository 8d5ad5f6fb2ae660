#include "thicklens/model/encoded_values.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "thicklens/base/error.h"

namespace thicklens::model {

EncodedValues EncodedValuesOf(const EncodedImage& image) {
  const int channels = image.channels == 4 ? 3 : image.channels;
  if (channels != 1 && channels != 3) {
    throw Error(fmt::format(
        "image: {} channels: it must have 1 (grey), 3 (RGB) or 4 (RGB and alpha)", channels));
  }
  EncodedValues stored{image.width_px, image.height_px, channels, {}};
  const double full_scale = image.full_scale();
  stored.values.reserve(image.values.size());
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    if (image.channels == 4 && i % 4 == 3) continue;
    stored.values.push_back(static_cast<float>(image.values[i] / full_scale));
  }
  return stored;
}

EncodedValues EncodedValuesOf(const LinearImage& image, const TransferCurve& transfer) {
  EncodedValues stored{image.width_px, image.height_px, image.channels, {}};
  stored.values.reserve(image.values.size());
  for (const float light : image.values) {
    if (std::isnan(light)) throw Error("image: a value is not a number (NaN)");
    stored.values.push_back(static_cast<float>(std::clamp(transfer.Encode(light), 0.0, 1.0)));
  }
  return stored;
}

}  // namespace thicklens::model

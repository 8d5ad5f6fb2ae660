#include "thicklens/model/stored_values.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "thicklens/base/error.h"

namespace thicklens::model {

StoredValues StoredValuesOf(const StoredPicture& picture) {
  const int channels = picture.channels == 4 ? 3 : picture.channels;
  if (channels != 1 && channels != 3) {
    throw Error(fmt::format(
        "picture: {} channels: it must have 1 (grey), 3 (RGB) or 4 (RGB and alpha)", channels));
  }
  StoredValues stored{picture.width_px, picture.height_px, channels, {}};
  const double full_scale = picture.full_scale();
  stored.values.reserve(picture.values.size());
  for (std::size_t i = 0; i < picture.values.size(); ++i) {
    if (picture.channels == 4 && i % 4 == 3) continue;
    stored.values.push_back(static_cast<float>(picture.values[i] / full_scale));
  }
  return stored;
}

StoredValues StoredValuesOf(const LinearPicture& picture, const TransferCurve& transfer) {
  StoredValues stored{picture.width_px, picture.height_px, picture.channels, {}};
  stored.values.reserve(picture.values.size());
  for (const float light : picture.values) {
    if (std::isnan(light)) throw Error("picture: a value is not a number (NaN)");
    stored.values.push_back(static_cast<float>(std::clamp(transfer.Encode(light), 0.0, 1.0)));
  }
  return stored;
}

}  // namespace thicklens::model

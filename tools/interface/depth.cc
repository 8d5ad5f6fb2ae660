#include "thicklens/depth.h"

#include <utility>

#include "thicklens/base/output_file.h"
#include "thicklens/io/depth_io.h"
#include "tools/interface/validation.h"
#include "tools/interface/with_file_context.h"

namespace thicklens {

std::string LengthUnitName(LengthUnit unit) {
  switch (unit) {
    case LengthUnit::kMillimetre:
      return "mm";
    case LengthUnit::kCentimetre:
      return "cm";
    case LengthUnit::kMetre:
      return "m";
    case LengthUnit::kTum5000:
      return "tum5000";
    case LengthUnit::kNone:
      break;
  }
  return "";
}

DepthMap DepthMap::Cropped(const model::PixelRect& rect) const {
  return WithFileContext(source.empty() ? "depth" : source, [&] {
    model::RawDepthMap map = model::CropDepth({width_px, height_px, values, is_integer}, rect);
    return DepthMap{map.width_px, map.height_px, std::move(map.values),
                    map.integer,  meaning,       source};
  });
}

DepthMap ReadDepth(const std::string& path, const DepthMeaning& meaning) {
  checks::RequireValid(meaning);
  model::RawDepthMap map = io::ReadDepthMap(path);
  return {map.width_px, map.height_px, std::move(map.values), map.integer, meaning, path};
}

std::string EncodeDepth(const DepthMap& depth) {
  checks::RequireValid(depth);
  return io::EncodePfm({depth.width_px, depth.height_px, depth.values, depth.is_integer});
}

void WriteDepth(const std::string& path, const DepthMap& depth) {
  WriteFileAtomically(path, EncodeDepth(depth));
}

}  // namespace thicklens

#include "thicklens/depth.h"

#include <fmt/format.h>

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
    return DepthMap{map.width_px, map.height_px, std::move(map.values), map.integer,
                    meaning,      source,        largest_of_type,       holes,
                    notes,        warnings};
  });
}

DepthMap ReadDepth(const std::string& path, const DepthMeaning& meaning,
                   const DepthReadOptions& options) {
  checks::RequireValid(meaning);
  std::string why;
  if (!options.IsValid(meaning, &why)) throw OptionError(why.substr(0, why.find(':')), why);
  io::DepthFile file = io::ReadDepthFile(path, options.file);
  model::FlipDepth(options.flip, file.map.width_px, &file.map.values);
  DepthMap depth{file.map.width_px,
                 file.map.height_px,
                 std::move(file.map.values),
                 file.map.integer,
                 meaning,
                 path,
                 file.map.largest_of_type,
                 options.holes,
                 std::move(file.notes),
                 std::move(file.warnings)};
  if (!options.near_mm) return depth;
  const double full_scale = depth.largest_of_type.value_or(1);
  const model::InverseScale scale =
      model::InverseScaleBetween(*options.far_mm, *options.near_mm, full_scale);
  depth.meaning.inverse_scale_dpt = scale.scale_dpt;
  depth.meaning.inverse_offset_dpt = scale.offset_dpt;
  depth.notes.push_back(
      fmt::format("The value 0 lies at {:g} mm, the value {:g} at {:g} mm, linear in 1/z.",
                  *options.far_mm, full_scale, *options.near_mm));
  return depth;
}

std::string EncodeDepth(const DepthMap& depth) {
  checks::RequireValid(depth);
  return io::EncodePfm({depth.width_px, depth.height_px, depth.values, depth.is_integer});
}

void WriteDepth(const std::string& path, const DepthMap& depth) {
  WriteFileAtomically(path, EncodeDepth(depth));
}

}  // namespace thicklens

#include "thicklens/depth.h"

#include <fmt/format.h>

#include <utility>

#include "thicklens/base/output_file.h"
#include "thicklens/io/depth_io.h"
#include "tools/interface/depth_reports.h"
#include "tools/interface/run_scope.h"
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
    std::vector<float> of_part;
    if (!confidence.empty())
      of_part = model::CropDepth({width_px, height_px, confidence, false}, rect).values;
    return DepthMap{map.width_px,
                    map.height_px,
                    std::move(map.values),
                    map.integer,
                    meaning,
                    source,
                    largest_of_type,
                    holes,
                    notes,
                    warnings,
                    flip,
                    is_lossy,
                    near_value,
                    std::move(of_part)};
  });
}

namespace {

io::DepthReading FileReading(const DepthReadOptions& options) {
  io::DepthReading reading;
  reading.channel = options.channel;
  switch (options.pfm_scale) {
    case PfmScale::kByRule:
      reading.pfm_scale = io::PfmScale::kByRule;
      break;
    case PfmScale::kApplied:
      reading.pfm_scale = io::PfmScale::kApplied;
      break;
    case PfmScale::kIgnored:
      reading.pfm_scale = io::PfmScale::kIgnored;
      break;
  }
  return reading;
}

// A photograph in the place of its depth map is refused; one with a map inside says so.
io::DepthFile ReadFileOrSayWhatIsInside(const std::string& path, const io::DepthReading& reading,
                                        const RunScope& run) {
  try {
    return io::ReadDepthFile(path, reading);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& error) {
    std::string inside;
    try {
      const auto found = io::ReadEmbeddedDepthFile(path).depth;
      if (found) inside = found->description;
    } catch (const Interrupted&) {
      throw;
    } catch (const Error&) {
      inside.clear();  // the first reason is the one that was asked for
    }
    if (inside.empty()) throw;
    throw Error(fmt::format(
        "{}; the file is a photograph with a depth map inside ({}): take it from there by {}",
        error.what(), inside, run.Option("ReadEmbeddedDepth")));
  }
}

}  // namespace

DepthMap ReadDepth(const std::string& path, const DepthMeaning& meaning,
                   const DepthReadOptions& options, const RunControl& control) {
  checks::RequireValid(control);
  checks::RequireValid(meaning);
  std::string why;
  if (!options.IsValid(meaning, &why)) throw OptionError(why.substr(0, why.find(':')), why);
  const RunScope run(control);
  io::DepthFile file = ReadFileOrSayWhatIsInside(path, FileReading(options), run);
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
                 std::move(file.warnings),
                 options.flip,
                 file.is_lossy};
  if (!options.near_mm) return depth;
  const double full_scale = depth.largest_of_type.value_or(1);
  const model::InverseScale scale =
      model::InverseScaleBetween(*options.far_mm, *options.near_mm, full_scale);
  depth.near_value = full_scale;
  depth.meaning.inverse_scale_dpt = scale.scale_dpt;
  depth.meaning.inverse_offset_dpt = scale.offset_dpt;
  depth.notes.push_back(
      fmt::format("The value 0 lies at {:g} mm, the value {:g} at {:g} mm, linear in 1/z.",
                  *options.far_mm, full_scale, *options.near_mm));
  return depth;
}

std::optional<DepthMap> ReadEmbeddedDepth(const std::string& path, int width_px, int height_px,
                                          model::DepthFlip flip, const RunControl& control) {
  checks::RequireValid(control);
  if (width_px < 0 || height_px < 0 || (width_px == 0) != (height_px == 0)) {
    throw OptionError("width_px", fmt::format("width_px, height_px: two sides >= 1, or two zeros, "
                                              "are expected, found {} and {}",
                                              width_px, height_px));
  }
  const RunScope run(control);
  std::optional<io::EmbeddedDepth> found = std::move(io::ReadEmbeddedDepthFile(path).depth);
  if (!found) return std::nullopt;
  if (!found->has_unit) {
    throw Error(fmt::format(
        "{}: the depth map inside has no unit of length ({}): its depths are known up to a factor "
        "only; take it from there by {}, scale it, and give it as a depth map of its own",
        path, found->description, run.Option("io::ReadEmbeddedDepthFile")));
  }
  if (width_px > 0) found = io::Enlarged(*found, width_px, height_px, path);
  model::RawDepthMap depths = io::DepthsOf(*found);
  DepthMap map;
  map.width_px = depths.width_px;
  map.height_px = depths.height_px;
  map.values = std::move(depths.values);
  model::FlipDepth(flip, map.width_px, &map.values);
  map.flip = flip;
  map.meaning.kind = found->kind;
  if (found->kind != DepthKind::kInverse) map.meaning.unit = LengthUnit::kMillimetre;
  map.source = path;
  map.notes = std::move(found->notes);
  map.notes.insert(map.notes.begin(),
                   fmt::format("The depth map inside is used: {}.", found->description));
  map.warnings = std::move(found->warnings);
  return map;
}

model::RawDepthMap MarkedDepth(const DepthMap& depth, const RunControl& control) {
  checks::RequireValid(control);
  checks::RequireValid(depth);
  RunScope run(control);
  ReportReading(depth, &run);
  return MarkedMap(depth, &run);
}

std::string EncodeDepth(const DepthMap& depth) {
  checks::RequireValid(depth);
  return io::EncodePfm({depth.width_px, depth.height_px, depth.values, depth.is_integer});
}

void WriteDepth(const std::string& path, const DepthMap& depth) {
  WriteFileAtomically(path, EncodeDepth(depth));
}

}  // namespace thicklens

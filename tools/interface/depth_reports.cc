#include "tools/interface/depth_reports.h"

#include <fmt/format.h>

#include <cstddef>
#include <string>

#include "tools/interface/with_file_context.h"

namespace thicklens {
namespace {

std::string NameOf(const DepthMap& depth) { return depth.source.empty() ? "depth" : depth.source; }

}  // namespace

void ReportReading(const DepthMap& map, RunScope* run) {
  for (const std::string& note : map.notes) run->Inform(fmt::format("{}: {}", NameOf(map), note));
  for (const std::string& warning : map.warnings)
    run->Warn(fmt::format("{}: {}", NameOf(map), warning));
}

void ReportHoles(const DepthMap& map, const model::DepthHoles& holes, RunScope* run) {
  const auto percent = [&](std::size_t count) {
    return 100 * static_cast<double>(count) / static_cast<double>(holes.pixels);
  };
  if (holes.zeros_form_areas) {
    run->Warn(fmt::format(
        "{}: {:.1f} % of its values are 0 and taken as 'no depth', but they form whole areas, like "
        "the far end of a relative map: if 0 is a value there, state it by {}",
        NameOf(map), percent(holes.zero), run->Option("depth.holes.zero_is_value")));
  }
  if (holes.largest > 0) {
    run->Warn(fmt::format(
        "{}: {:.1f} % of its values are {:g}, the largest of its type, far above all others: they "
        "are taken as 'no depth'; if they are depths, state it by {}",
        NameOf(map), percent(holes.largest), map.largest_of_type.value_or(0),
        run->Option("depth.holes.largest_is_value")));
  }
  if (holes.negative > 0) {
    run->Warn(fmt::format("{}: {:.1f} % of its values are negative and taken as 'no depth'",
                          NameOf(map), percent(holes.negative)));
  }
  for (const model::SuspectedMark& mark : holes.suspects) {
    // The float is printed with as many digits as it has.
    const auto value = static_cast<float>(mark.value);
    run->Warn(
        fmt::format("{}: {} pixels ({:.1f} %) have exactly the value {}, {}: if it means 'no "
                    "depth', state it by "
                    "{} {}",
                    NameOf(map), mark.pixels, percent(mark.pixels), value,
                    map.meaning.kind == DepthKind::kDisparity && (value == -1 || value == -16)
                        ? "and no other value is below 0, as where a stereo matcher found nothing"
                        : "far beyond all others",
                    run->Option("depth.holes"), value));
  }
}

model::RawDepthMap MarkedMap(const DepthMap& map, RunScope* run, model::DepthHoles* holes) {
  model::RawDepthMap raw{map.width_px, map.height_px, map.values, map.is_integer,
                         map.largest_of_type};
  const model::DepthHoles found = WithFileContext(
      NameOf(map), [&] { return model::MarkHoles(map.meaning.kind, map.holes, &raw); });
  if (run != nullptr) ReportHoles(map, found, run);
  if (holes != nullptr) *holes = found;
  return raw;
}

}  // namespace thicklens

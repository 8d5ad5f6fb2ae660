#include "tools/report/target_words.h"

#include <fmt/format.h>

#include <cmath>
#include <vector>

#include "thicklens/base/printable_text.h"

namespace thicklens::tools {
namespace {

using nlohmann::json;

json EstimateOf(const model::Estimate& estimate) {
  return {{"value", estimate.value}, {"sigma", estimate.sigma}};
}

}  // namespace

std::string TargetLine(const calib::TargetFinding& target) {
  if (target.measured_as.empty()) return "";
  std::string line = "measured as " + target.measured_as;
  const calib::SpotFinding& spots = target.spots;
  if (spots.done) {
    line += fmt::format(": {} of {} {} points, {} measurements", spots.used, spots.found,
                        spots.are_bright ? "bright" : "dark", spots.measured);
    std::vector<std::string> left_out;
    for (const auto& [reason, count] : spots.left_out)
      left_out.push_back(fmt::format("{} {}", count, reason));
    if (!left_out.empty()) line += fmt::format("; left out: {}", fmt::join(left_out, ", "));
  }
  return line;
}

json TargetJson(const calib::TargetFinding& target) {
  const calib::SpotFinding& spots = target.spots;
  json left_out = json::array();
  for (const auto& [reason, count] : spots.left_out)
    left_out.push_back({{"reason", reason}, {"count", count}});
  const calib::ReliefFinding& relief = target.relief;
  json zones = json::array(), parts = json::array();
  for (std::size_t i = 0; i < relief.sharpest_mm.size(); ++i) {
    const auto& sharpest = relief.sharpest_mm[i];
    const int part = i < relief.part_of_zone.size() ? relief.part_of_zone[i] : -1;
    zones.push_back({{"sharpest_mm", sharpest ? EstimateOf(*sharpest) : json(nullptr)},
                     {"part", part >= 0 ? json(part) : json(nullptr)}});
  }
  for (const calib::ReliefPart& part : relief.parts)
    parts.push_back({{"nearer_mm", EstimateOf(part.nearer_mm)}, {"share", part.share}});
  json region = nullptr;
  if (relief.region)
    region = {relief.region->x, relief.region->y, relief.region->width, relief.region->height};
  // A number that was not measured is null.
  const auto count = [](int value, bool is_measured) {
    return is_measured ? json(value) : json(nullptr);
  };
  return {{"measured_as", target.measured_as},
          {"points",
           {{"done", spots.done},
            {"message", PrintableUtf8(spots.message)},
            {"are_bright", spots.are_bright},
            {"found", count(spots.found, spots.done)},
            {"used", count(spots.used, spots.done)},
            {"measured", count(spots.measured, spots.done)},
            {"left_out", std::move(left_out)}}},
          {"relief",
           {{"measured", relief.measured},
            {"message", PrintableUtf8(relief.message)},
            {"is_relief", relief.is_relief},
            {"columns", count(relief.columns, relief.measured)},
            {"rows", count(relief.rows, relief.measured)},
            {"zones", std::move(zones)},
            {"parts", std::move(parts)},
            {"region_px", std::move(region)},
            {"region_share", relief.region ? json(relief.region_share) : json(nullptr)}}}};
}

}  // namespace thicklens::tools

#include "tools/options/exif_check.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"

namespace thicklens::tools {
namespace {

using nlohmann::json;

std::string FindingText(const ExifFinding& finding) {
  return fmt::format("{}: the photograph's EXIF states {}, the camera file {} ({})",
                     finding.quantity, finding.photo, finding.camera, finding.remark);
}

json ExifFindingsJson(const std::vector<ExifFinding>& findings, bool ignore) {
  json list = json::array();
  for (const ExifFinding& finding : findings) {
    list.push_back({{"quantity", finding.quantity},
                    {"photo", finding.photo},
                    {"camera", finding.camera},
                    {"verdict", ExifVerdictName(finding.verdict)},
                    {"remark", finding.remark}});
  }
  return {{"ignored", ignore}, {"findings", list}};
}

}  // namespace

std::string ExifVerdictName(ExifVerdict verdict) {
  if (verdict == ExifVerdict::kAgrees) return "agrees";
  return verdict == ExifVerdict::kUndecided ? "undecided" : "contradicts";
}

json RequireSameCamera(const std::string& photo_path, const std::string& camera_path,
                       const model::Camera& camera, const PhotoSize& size, bool ignore) {
  std::string damaged;
  const io::PhotoExif exif =
      io::ReadExifIfAny(photo_path, camera.sensor.width_px, camera.sensor.height_px, &damaged);
  if (!damaged.empty()) {
    spdlog::warn("{}; it is not compared with the camera file", PrintableUtf8(damaged));
    return nullptr;
  }
  if (exif.IsEmpty()) return nullptr;
  const std::vector<ExifFinding> findings = CompareExif(exif, camera, size);
  std::vector<std::string> contradictions;
  for (const ExifFinding& finding : findings) {
    if (finding.verdict == ExifVerdict::kAgrees) continue;
    if (finding.verdict == ExifVerdict::kContradicts && !ignore) {
      contradictions.push_back(FindingText(finding));
      continue;
    }
    spdlog::warn("{}: {}{}", PrintableUtf8(photo_path), PrintableUtf8(FindingText(finding)),
                 finding.verdict == ExifVerdict::kContradicts ? "; ignored (--ignore-exif)" : "");
  }
  if (!contradictions.empty()) {
    throw Error(
        fmt::format("{}: it was not taken with the camera and setting of {}: {}; calibrate that "
                    "setting, name its camera file, or give --ignore-exif if EXIF is wrong",
                    PrintableUtf8(photo_path), PrintableUtf8(camera_path),
                    PrintableUtf8(fmt::format("{}", fmt::join(contradictions, "; ")))));
  }
  return ExifFindingsJson(findings, ignore);
}

}  // namespace thicklens::tools

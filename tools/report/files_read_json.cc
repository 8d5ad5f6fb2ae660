#include "tools/report/files_read_json.h"

#include <optional>
#include <utility>

#include "thicklens/base/printable_text.h"

namespace thicklens::tools {
namespace {

using nlohmann::json;

template <typename Value>
json ValueOrNull(const std::optional<Value>& value) {
  return value ? json(*value) : json();
}

const char* TransferName(io::StatedTransfer transfer) {
  switch (transfer) {
    case io::StatedTransfer::kLinear:
      return "linear";
    case io::StatedTransfer::kSrgb:
      return "srgb";
    case io::StatedTransfer::kBt709:
      return "bt.709";
    case io::StatedTransfer::kGamma:
      return "gamma";
    case io::StatedTransfer::kPq:
      return "pq";
    case io::StatedTransfer::kHlg:
      return "hlg";
    case io::StatedTransfer::kAbsent:
      break;
  }
  return nullptr;
}

const char* AlphaName(io::AlphaKind alpha) {
  if (alpha == io::AlphaKind::kNone) return "none";
  return alpha == io::AlphaKind::kStraight ? "straight" : "associated";
}

json PrintableTexts(const std::vector<std::string>& texts) {
  json list = json::array();
  for (const std::string& text : texts) list.push_back(PrintableUtf8(text));
  return list;
}

json ProfileJson(const io::ImageFacts& facts) {
  if (facts.icc_profile.empty()) return nullptr;
  return {{"description", PrintableUtf8(facts.icc_description)},
          {"bytes", facts.icc_profile.size()}};
}

json RawJson(const io::ImageFacts& facts) {
  if (!facts.raw) return nullptr;
  const io::RawFacts& raw = *facts.raw;
  return {{"camera", PrintableUtf8(raw.camera)},
          {"mosaic", raw.mosaic},
          {"black_level", raw.black_level},
          {"white_level", raw.white_level},
          {"camera_white_balance", ValueOrNull(raw.camera_white_balance)},
          {"sensor_size_px", {raw.sensor_width_px, raw.sensor_height_px}},
          {"active_origin_px", {raw.active_left_px, raw.active_top_px}},
          {"active_size_px", {raw.active_width_px, raw.active_height_px}},
          {"treatment", raw.treatment}};
}

json VideoJson(const io::ImageFacts& facts) {
  if (!facts.video) return nullptr;
  const io::VideoFacts& video = *facts.video;
  return {{"container", video.container},
          {"codec", video.codec},
          {"lossless", video.is_lossless},
          {"pixel_format", video.pixel_format},
          {"chroma", video.chroma},
          {"matrix", video.matrix},
          {"matrix_stated", video.is_matrix_stated},
          {"full_range", video.is_full_range},
          {"range_stated", video.is_range_stated},
          {"pixel_aspect", video.pixel_aspect}};
}

json FactsJson(const io::ImageFacts& facts) {
  const char* const transfer = TransferName(facts.transfer);
  return {{"line", facts.OneLine()},
          {"file_kind", facts.file_kind},
          {"size_px", {facts.width_px, facts.height_px}},
          {"stored_size_px", {facts.stored_width_px, facts.stored_height_px}},
          {"page", facts.page},
          {"pages", facts.pages},
          {"part", PrintableUtf8(facts.part)},
          {"channels", PrintableTexts(facts.channels)},
          {"sample_type", facts.sample_type},
          {"container_bits", facts.container_bits},
          {"significant_bits", ValueOrNull(facts.significant_bits)},
          {"transfer", transfer == nullptr ? json() : json(transfer)},
          {"gamma", facts.transfer == io::StatedTransfer::kGamma ? json(facts.gamma) : json()},
          {"icc_profile", ProfileJson(facts)},
          {"chromaticities", ValueOrNull(facts.chromaticities)},
          {"orientation", facts.orientation},
          {"orientation_applied", facts.is_orientation_applied},
          {"alpha", AlphaName(facts.alpha)},
          {"raw", RawJson(facts)},
          {"video", VideoJson(facts)},
          {"notes", PrintableTexts(facts.notes)}};
}

}  // namespace

json FilesReadJson(const std::vector<io::FilesRead>& groups) {
  json list = json::array();
  for (const io::FilesRead& group : groups) {
    json entry = {{"files", PrintableTexts(group.files)}};
    entry.update(FactsJson(group.facts));
    list.push_back(std::move(entry));
  }
  return list;
}

json FileReadJson(const std::string& path, const io::ImageFacts* facts) {
  if (facts == nullptr) return json::array();
  return FilesReadJson({{{path}, *facts}});
}

}  // namespace thicklens::tools

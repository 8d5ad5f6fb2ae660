#include "tools/io/library/heif_boxes.h"

namespace thicklens::io {
namespace {

constexpr std::size_t kVersionAndFlags = 4;  // at the start of a full box, in bytes

}  // namespace

HeifBoxes::HeifBoxes(const std::string& bytes) : bytes_(bytes) {
  meta_ = Find({0, bytes.size(), ""}, 0, "meta");
}

// The value of bytes of which the highest comes first; bytes behind the file's end count as zero.
std::uint32_t HeifBoxes::Number(std::size_t at, std::size_t count) const {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < count; ++i)
    value = value << 8 | (at + i < bytes_.size() ? static_cast<std::uint8_t>(bytes_[at + i]) : 0U);
  return value;
}

std::vector<HeifBoxes::Box> HeifBoxes::Inside(std::size_t begin, std::size_t end) const {
  std::vector<Box> boxes;
  constexpr std::size_t kHeader = 8;
  while (begin + kHeader <= end) {
    std::size_t size = Number(begin, 4);
    const std::size_t header = size == 1 ? 2 * kHeader : kHeader;
    if (size == 1) size = Number(begin + 12, 4);  // of at most 4 GiB
    if (size == 0) size = end - begin;
    if (size < header || size > end - begin) break;
    boxes.push_back({begin + header, begin + size, bytes_.substr(begin + 4, 4)});
    begin += size;
  }
  return boxes;
}

HeifBoxes::Box HeifBoxes::Find(const Box& box, std::size_t skip, const std::string& type) const {
  for (const Box& inner : Inside(box.begin + skip, box.end)) {
    if (inner.type == type) return inner;
  }
  return {};
}

std::vector<HeifBoxes::Box> HeifBoxes::PropertiesOf(std::uint32_t item) const {
  const Box properties = Find(meta_, kVersionAndFlags, "iprp");
  const Box list_box = Find(properties, 0, "ipco");
  const std::vector<Box> list = Inside(list_box.begin, list_box.end);
  const Box links = Find(properties, 0, "ipma");
  std::vector<Box> of_item;
  std::size_t at = links.begin + kVersionAndFlags + 4;
  const std::uint32_t count = Number(links.begin + kVersionAndFlags, 4);
  const std::size_t id_bytes = Number(links.begin, 1) >= 1 ? 4 : 2;
  const bool has_long_links = (Number(links.begin + 3, 1) & 1U) != 0;
  for (std::uint32_t i = 0; i < count && at < links.end; ++i) {
    const bool is_asked = Number(at, id_bytes) == item;
    at += id_bytes;
    const std::uint32_t item_links = Number(at++, 1);
    for (std::uint32_t k = 0; k < item_links; ++k) {
      const std::uint32_t link = has_long_links ? Number(at, 2) & 0x7FFFU : Number(at, 1) & 0x7FU;
      at += has_long_links ? 2 : 1;
      if (is_asked && link >= 1 && link <= list.size()) of_item.push_back(list[link - 1]);
    }
  }
  return of_item;
}

std::optional<std::uint32_t> HeifBoxes::FirstTileOf(std::uint32_t item) const {
  const Box references = Find(meta_, kVersionAndFlags, "iref");
  const std::size_t id_bytes = Number(references.begin, 1) >= 1 ? 4 : 2;
  for (const Box& reference : Inside(references.begin + kVersionAndFlags, references.end)) {
    if (reference.type == "dimg" && Number(reference.begin, id_bytes) == item &&
        Number(reference.begin + id_bytes, 2) > 0) {
      return Number(reference.begin + id_bytes + 2, id_bytes);
    }
  }
  return std::nullopt;
}

int HeifBoxes::OrientationOf(std::uint32_t item, bool* is_cropped) const {
  // It is mirrored left to right or not, and then turned anticlockwise.
  bool is_mirrored = false;
  std::uint32_t turns = 0;
  for (const Box& property : PropertiesOf(item)) {
    const std::uint32_t value = Number(property.begin, 1) & 3U;
    if (property.type == "clap") *is_cropped = true;
    if (property.type == "irot") turns = (turns + value) % 4;
    if (property.type == "imir") {  // 0: upside down, 1: left to right, as libheif has it
      turns = ((value & 1U) == 1 ? 4 - turns : 6 - turns) % 4;
      is_mirrored = !is_mirrored;
    }
  }
  constexpr int kPlain[] = {1, 8, 3, 6}, kMirrored[] = {2, 5, 4, 7};
  return is_mirrored ? kMirrored[turns] : kPlain[turns];
}

std::optional<HeifColourCodes> HeifBoxes::OwnColourCodesOf(std::uint32_t item) const {
  for (const Box& property : PropertiesOf(item)) {
    if (property.type != "colr" || bytes_.compare(property.begin, 4, "nclx") != 0) continue;
    if (property.end - property.begin < 8) continue;
    return HeifColourCodes{Number(property.begin + 4, 2), Number(property.begin + 6, 2)};
  }
  return std::nullopt;
}

std::optional<HeifColourCodes> HeifBoxes::ColourCodesOf(std::uint32_t item) const {
  if (const std::optional<HeifColourCodes> own = OwnColourCodesOf(item)) return own;
  const std::optional<std::uint32_t> tile = FirstTileOf(item);
  return tile ? OwnColourCodesOf(*tile) : std::nullopt;
}

}  // namespace thicklens::io

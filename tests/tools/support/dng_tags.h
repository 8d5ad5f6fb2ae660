#ifndef THICKLENS_TESTS_TOOLS_SUPPORT_DNG_TAGS_H_
#define THICKLENS_TESTS_TOOLS_SUPPORT_DNG_TAGS_H_

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace thicklens::tools {

// A field of a TIFF directory.
struct TiffTag {
  enum Type : std::uint16_t { kShort = 3, kLong = 4, kRational = 5 };
  std::uint16_t number = 0;
  Type type = kShort;
  std::vector<std::uint32_t> values;  // two for each fraction; none: the field is removed
};

// Tags to add to, or to replace in, the directories of a DNG file.
struct DngTags {
  std::vector<TiffTag> main;    // of the first directory
  std::vector<TiffTag> exif;    // of the directory of EXIF, which becomes these
  std::vector<TiffTag> sensor;  // of the first sub-directory, which has the mosaic
};

// A DNG file in little-endian order with other directories, which are appended to it.
class DngEdit {
 public:
  explicit DngEdit(std::string dng) : bytes_(std::move(dng)) {}

  std::string With(const DngTags& tags) {
    constexpr std::uint16_t kSubDirectories = 330, kExif = 34665;
    Directory main = ReadDirectory(Number(4, 4));
    if (!tags.sensor.empty()) {
      Directory sensor = ReadDirectory(NumberIn(main.at(kSubDirectories), 8, 4));
      Put(tags.sensor, &sensor);
      Put({{kSubDirectories, TiffTag::kLong, {Append(sensor)}}}, &main);
    }
    if (!tags.exif.empty()) {
      Directory exif;
      Put(tags.exif, &exif);
      Put({{kExif, TiffTag::kLong, {Append(exif)}}}, &main);
    }
    Put(tags.main, &main);
    const std::string at = Digits(Append(main), 4);
    bytes_.replace(4, 4, at);
    return bytes_;
  }

 private:
  static constexpr std::size_t kEntryBytes = 12;
  using Directory = std::map<std::uint16_t, std::string>;  // entries of 12 bytes

  static std::string Digits(std::uint32_t value, std::size_t count) {
    std::string digits;
    for (std::size_t i = 0; i < count; ++i) digits += static_cast<char>(value >> (8 * i) & 0xFFU);
    return digits;
  }
  static std::uint32_t NumberIn(const std::string& text, std::size_t at, std::size_t count) {
    std::uint32_t value = 0;
    for (std::size_t i = count; i-- > 0;)
      value = value << 8U | static_cast<std::uint8_t>(text.at(at + i));
    return value;
  }
  std::uint32_t Number(std::size_t at, std::size_t count) const {
    return NumberIn(bytes_, at, count);
  }
  Directory ReadDirectory(std::size_t at) const {
    Directory directory;
    const std::size_t count = Number(at, 2);
    for (std::size_t i = 0; i < count; ++i) {
      const std::string entry = bytes_.substr(at + 2 + kEntryBytes * i, kEntryBytes);
      directory[static_cast<std::uint16_t>(NumberIn(entry, 0, 2))] = entry;
    }
    return directory;
  }

  void Put(const std::vector<TiffTag>& tags, Directory* directory) {
    for (const TiffTag& tag : tags) {
      if (tag.values.empty()) {
        directory->erase(tag.number);
        continue;
      }
      const std::size_t size = tag.type == TiffTag::kShort ? 2 : 4;
      std::string content;
      for (const std::uint32_t value : tag.values) content += Digits(value, size);
      const auto count = static_cast<std::uint32_t>(
          tag.type == TiffTag::kRational ? tag.values.size() / 2 : tag.values.size());
      if (content.size() > 4) {
        const auto at = static_cast<std::uint32_t>(bytes_.size());
        bytes_ += content;
        content = Digits(at, 4);
      }
      content.resize(4);
      (*directory)[tag.number] =
          Digits(tag.number, 2) + Digits(tag.type, 2) + Digits(count, 4) + content;
    }
  }

  std::uint32_t Append(const Directory& directory) {
    if (bytes_.size() % 2 != 0) bytes_ += '\0';
    const auto at = static_cast<std::uint32_t>(bytes_.size());
    bytes_ += Digits(static_cast<std::uint32_t>(directory.size()), 2);
    for (const auto& [number, entry] : directory) bytes_ += entry;
    bytes_ += std::string(4, '\0');
    return at;
  }

  std::string bytes_;
};

}  // namespace thicklens::tools

#endif  // THICKLENS_TESTS_TOOLS_SUPPORT_DNG_TAGS_H_

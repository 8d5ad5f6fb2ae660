// OME-XML: the positions of the planes of a stack. Schema: openmicroscopy.org, 2010 to 2016.
#include <expat.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstddef>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/io/readings.h"
#include "tools/io/tables/metadata_fields.h"
#include "tools/io/tables/reading_sources.h"

namespace thicklens::io {
namespace {

namespace fs = std::filesystem;

// More planes than a stack has; it limits what a short text may ask for.
constexpr int kMaxPlanes = 1'000'000;

using Attributes = std::map<std::string, std::string>;

std::string Shown(const std::string& text) {
  constexpr std::size_t kMost = 80;
  return text.size() <= kMost ? text : text.substr(0, kMost) + "...";
}

// Which plane: slice, channel, time.
using PlaneIndex = std::array<int, 3>;

// One element TiffData: planes in files.
struct TiffData {
  std::optional<int> page;
  PlaneIndex first = {0, 0, 0};
  std::optional<int> count;
  std::string file;
  bool has_first = false;
};

struct Pixels {
  std::string order = "XYZCT";
  PlaneIndex size = {1, 1, 1};
  std::optional<double> step;  // PhysicalSizeZ
  std::string step_unit;
  std::map<PlaneIndex, double> positions;
  std::set<std::string> units;  // of the positions; "": none is stated
  std::vector<TiffData> data;
};

struct Document {
  bool is_ome = false;
  std::string companion;  // the file that has the metadata
  std::vector<Pixels> images;
};

class OmeParser {
 public:
  explicit OmeParser(const std::string& place) : place_(place) {}

  Document Parse(const std::string& xml) {
    const std::unique_ptr<XML_ParserStruct, void (*)(XML_Parser)> parser(XML_ParserCreate(nullptr),
                                                                         XML_ParserFree);
    parser_ = parser.get();
    XML_SetUserData(parser_, this);
    XML_SetElementHandler(parser_, Begin, End);
    XML_SetEntityDeclHandler(parser_, RefuseEntity);
    const auto status = XML_Parse(parser_, xml.data(), static_cast<int>(xml.size()), XML_TRUE);
    if (!why_.empty()) throw Error(why_);
    if (status != XML_STATUS_OK) {
      throw Error(fmt::format("{}: not valid OME-XML, line {}, column {}: {}", place_,
                              XML_GetCurrentLineNumber(parser_),
                              XML_GetCurrentColumnNumber(parser_) + 1,
                              XML_ErrorString(XML_GetErrorCode(parser_))));
    }
    return std::move(document_);
  }

 private:
  // No exception may pass through the C library: the first error stops it.
  static void Begin(void* data, const XML_Char* name, const XML_Char** attributes) {
    auto* self = static_cast<OmeParser*>(data);
    if (!self->why_.empty()) return;
    try {
      Attributes values;
      for (; *attributes != nullptr; attributes += 2) values.emplace(attributes[0], attributes[1]);
      self->Take(LocalName(name), values);
    } catch (const std::exception& error) {
      self->Stop(error.what());
    }
  }
  static void End(void* data, const XML_Char* name) {
    auto* self = static_cast<OmeParser*>(data);
    if (LocalName(name) == "TiffData") self->is_in_data_ = false;
  }
  static void RefuseEntity(void* data, const XML_Char*, int, const XML_Char*, int, const XML_Char*,
                           const XML_Char*, const XML_Char*, const XML_Char*) {
    auto* self = static_cast<OmeParser*>(data);
    self->Stop(self->place_ + ": the XML declares entities, which no OME-XML needs");
  }
  void Stop(const std::string& why) {
    why_ = why;
    XML_StopParser(parser_, XML_FALSE);
  }

  static std::string LocalName(const std::string& name) {
    const std::size_t colon = name.find(':');
    return colon == std::string::npos ? name : name.substr(colon + 1);
  }

  std::string Place(const std::string& field) const {
    return fmt::format("{}: line {}: {}: ", place_, XML_GetCurrentLineNumber(parser_), field);
  }
  static const std::string* Find(const Attributes& values, const char* name) {
    const auto found = values.find(name);
    return found == values.end() ? nullptr : &found->second;
  }
  std::optional<int> Whole(const Attributes& values, const char* name, int lowest) const {
    const std::string* text = Find(values, name);
    if (text == nullptr) return std::nullopt;
    int value = 0;
    const auto [end, status] = std::from_chars(text->data(), text->data() + text->size(), value);
    const bool is_valid = status == std::errc() && end == text->data() + text->size() &&
                          value >= lowest && value <= kMaxPlanes;
    if (!is_valid) {
      throw Error(fmt::format("{}a whole number from {} to {} is expected, found '{}'", Place(name),
                              lowest, kMaxPlanes, Shown(*text)));
    }
    return value;
  }
  std::optional<double> Number(const Attributes& values, const char* name) const {
    const std::string* text = Find(values, name);
    if (text == nullptr) return std::nullopt;
    double value = 0;
    const auto [end, status] = std::from_chars(text->data(), text->data() + text->size(), value);
    constexpr double kMaxMagnitude = 1e30;
    const bool is_valid = status == std::errc() && end == text->data() + text->size() &&
                          value >= -kMaxMagnitude && value <= kMaxMagnitude;
    if (!is_valid) {
      throw Error(fmt::format("{}a number of at most 1e30 is expected, found '{}'", Place(name),
                              Shown(*text)));
    }
    return value;
  }

  void Take(const std::string& element, const Attributes& values) {
    if (element == "OME") document_.is_ome = true;
    if (element == "BinaryOnly") {
      if (const std::string* file = Find(values, "MetadataFile")) document_.companion = *file;
    }
    if (element == "Pixels") TakePixels(values);
    if (document_.images.empty()) return;
    Pixels& pixels = document_.images.back();
    if (element == "Pixels") is_in_data_ = false;  // a broken file may have it in TiffData
    if (element == "Plane") TakePlane(values, &pixels);
    if (element == "TiffData") {
      is_in_data_ = true;
      const auto z = Whole(values, "FirstZ", 0);
      const auto c = Whole(values, "FirstC", 0);
      const auto t = Whole(values, "FirstT", 0);
      pixels.data.push_back({Whole(values, "IFD", 0),
                             {z.value_or(0), c.value_or(0), t.value_or(0)},
                             Whole(values, "PlaneCount", 0),
                             "",
                             z || c || t});
      if (pixels.data.size() > kMaxPlanes) throw Error(place_ + ": too many elements TiffData");
    }
    if (element == "UUID" && is_in_data_) {
      if (const std::string* file = Find(values, "FileName")) pixels.data.back().file = *file;
    }
  }

  void TakePixels(const Attributes& values) {
    Pixels pixels;
    if (const std::string* order = Find(values, "DimensionOrder")) pixels.order = *order;
    std::string sorted = pixels.order;
    std::sort(sorted.begin(), sorted.end());
    if (sorted != "CTXYZ") {
      throw Error(fmt::format("{}an order of XYZCT is expected, found '{}'",
                              Place("DimensionOrder"), Shown(pixels.order)));
    }
    const char* names[] = {"SizeZ", "SizeC", "SizeT"};
    double planes = 1;
    for (std::size_t i = 0; i < 3; ++i) {
      pixels.size[i] = Whole(values, names[i], 1).value_or(1);
      planes *= pixels.size[i];
    }
    if (planes > kMaxPlanes) {
      throw Error(fmt::format("{}{} planes are stated; at most {} are read", Place("Pixels"),
                              planes, kMaxPlanes));
    }
    pixels.step = Number(values, "PhysicalSizeZ");
    const std::string* unit = Find(values, "PhysicalSizeZUnit");
    pixels.step_unit = unit == nullptr ? "um" : *unit;  // the default of the schema
    document_.images.push_back(std::move(pixels));
  }

  void TakePlane(const Attributes& values, Pixels* pixels) {
    const PlaneIndex index = {Whole(values, "TheZ", 0).value_or(0),
                              Whole(values, "TheC", 0).value_or(0),
                              Whole(values, "TheT", 0).value_or(0)};
    const auto position = Number(values, "PositionZ");
    if (!position) return;
    const std::string* unit = Find(values, "PositionZUnit");
    pixels->units.insert(unit == nullptr ? "" : *unit);
    const auto [known, added] = pixels->positions.emplace(index, *position);
    if (!added && known->second != *position) {
      throw Error(fmt::format("{}the plane z={} c={} t={} has two positions, {} and {}",
                              Place("PositionZ"), index[0], index[1], index[2], known->second,
                              *position));
    }
  }

  const std::string& place_;
  XML_Parser parser_ = nullptr;
  Document document_;
  bool is_in_data_ = false;
  std::string why_;
};

// The plane that follows in the order of the file.
PlaneIndex Next(PlaneIndex index, const Pixels& pixels) {
  for (const char axis : pixels.order) {
    const std::size_t i = axis == 'Z' ? 0U : axis == 'C' ? 1U : axis == 'T' ? 2U : 3U;
    if (i == 3) continue;
    if (++index[i] < pixels.size[i]) return index;
    index[i] = 0;
  }
  return index;
}

class PageReader {
 public:
  PageReader(const Pixels& pixels, const std::string& place, const model::ReadingOptions& options)
      : pixels_(pixels), place_(place), options_(options) {
    if (pixels_.units.size() > 1) {
      throw Error(fmt::format("{}: PositionZ has the units '{}' and '{}'; one is expected", place_,
                              Shown(*pixels_.units.begin()), Shown(*pixels_.units.rbegin())));
    }
    if (!pixels_.positions.empty()) {
      unit_ = *pixels_.units.begin();
      what_ = "PositionZ";
      // The schema defines no length for its reference frame, and none before 2015.
      const bool is_unknown = unit_.empty() || unit_ == "reference frame";
      if (is_unknown && options_.unit.empty() && !options_.scale_mm) {
        throw Error(
            fmt::format("{}: PositionZ has no unit of length ({}); state it by --unit (um for most "
                        "microscopes)",
                        place_, unit_.empty() ? "none is stated" : "'reference frame'"));
      }
      if (is_unknown) unit_.clear();
    } else if (pixels_.step) {
      unit_ = pixels_.step_unit;
      what_ = "PhysicalSizeZ times the slice";
    } else {
      throw Error(place_ + ": neither a plane has PositionZ nor the stack PhysicalSizeZ");
    }
  }

  PageReadings Read() const {
    PageReadings readings;
    int page = 0;
    for (const TiffData& data : Data()) {
      PlaneIndex index = data.first;
      page = data.page.value_or(data.file == last_file_ ? page : 0);
      last_file_ = data.file;
      for (int i = 0; i < CountOf(data); ++i, ++page) {
        if (readings.pages.size() >= kMaxPlanes) throw Error(place_ + ": too many planes");
        RequireInside(index);
        readings.pages.push_back({data.file, page, index[1], index[2], index[0], ReadingOf(index)});
        index = Next(index, pixels_);
      }
    }
    std::stable_sort(readings.pages.begin(), readings.pages.end(),
                     [](const auto& a, const auto& b) {
                       return std::tie(a.file, a.page) < std::tie(b.file, b.page);
                     });
    const auto repeat = std::adjacent_find(
        readings.pages.begin(), readings.pages.end(), [](const auto& a, const auto& b) {
          return std::tie(a.file, a.page) == std::tie(b.file, b.page);
        });
    if (repeat != readings.pages.end()) {
      throw Error(fmt::format("{}: page {} of '{}' is stated to be two planes", place_,
                              repeat->page, Shown(repeat->file)));
    }
    readings.description = fmt::format("{}, {}", what_, model::ReadingUnitName(unit_, options_));
    return readings;
  }

 private:
  int Planes() const { return pixels_.size[0] * pixels_.size[1] * pixels_.size[2]; }

  // Without TiffData, the pages of the file are the planes in their order.
  std::vector<TiffData> Data() const {
    return pixels_.data.empty() ? std::vector<TiffData>{TiffData{}} : pixels_.data;
  }
  // The defaults of the schema: one plane if the page is stated, or all planes.
  int CountOf(const TiffData& data) const {
    if (data.count) return *data.count;
    return data.page || data.has_first ? 1 : Planes();
  }
  void RequireInside(const PlaneIndex& index) const {
    for (std::size_t i = 0; i < 3; ++i) {
      if (index[i] < pixels_.size[i]) continue;
      throw Error(fmt::format(
          "{}: TiffData names the plane z={} c={} t={}, which is outside of the "
          "stated size z={} c={} t={}",
          place_, index[0], index[1], index[2], pixels_.size[0], pixels_.size[1], pixels_.size[2]));
    }
  }
  double ReadingOf(const PlaneIndex& index) const {
    double value = 0;
    if (pixels_.positions.empty()) {
      value = *pixels_.step * index[0];
    } else {
      const auto found = pixels_.positions.find(index);
      if (found == pixels_.positions.end()) {
        throw Error(fmt::format("{}: the plane z={} c={} t={} has no PositionZ, but others have",
                                place_, index[0], index[1], index[2]));
      }
      value = found->second;
    }
    return model::ReadingInMm(value, unit_, options_, place_ + ": " + what_ + ": ");
  }

  const Pixels& pixels_;
  const std::string& place_;
  const model::ReadingOptions& options_;
  std::string unit_, what_;
  mutable std::string last_file_;
};

bool IsOmeXml(const std::string& text) {
  return text.find("<OME") != std::string::npos || text.find(":OME") != std::string::npos;
}

}  // namespace

PageReadings ReadingsOfOmeXml(const std::string& xml, const std::string& place,
                              const model::ReadingOptions& options) {
  const Document document = OmeParser(place).Parse(xml);
  if (!document.is_ome) throw Error(place + ": the XML has no element OME; OME-XML is expected");
  if (!document.companion.empty() && document.images.empty()) {
    throw Error(
        fmt::format("{}: its metadata are in the companion file '{}'; give it by --readings", place,
                    Shown(document.companion)));
  }
  if (document.images.size() != 1) {
    throw Error(fmt::format("{}: {} images (elements Pixels); a sweep is one image of many planes",
                            place, document.images.size()));
  }
  return PageReader(document.images.front(), place, options).Read();
}

model::ReadingSet ReadingsOfOmeCompanion(const std::string& xml, const std::string& path,
                                         const model::ReadingOptions& options) {
  const PageReadings readings = ReadingsOfOmeXml(xml, path, options);
  model::ReadingSet set;
  set.source = path;
  set.folder = fs::path(path).parent_path().string();
  for (const PageReading& page : readings.pages) {
    const std::string place =
        fmt::format("{}: plane z={} c={} t={}: ", path, page.slice, page.channel, page.time);
    if (page.file.empty())
      throw Error(place + "no UUID with FileName says in which file the plane is");
    if (page.page != 0) {
      throw Error(
          fmt::format("{}it is page {} of '{}'; frames are files of one page each, or the pages of "
                      "one OME-TIFF",
                      place, page.page, Shown(page.file)));
    }
    set.rows.push_back({page.file, page.reading_mm, place});
  }
  FinishMetadata(fmt::format("{} of {}", readings.description, fs::path(path).filename().string()),
                 "", false, options, &set);
  set.description = fmt::format("{} of {}, {} files", readings.description,
                                fs::path(path).filename().string(), set.rows.size());
  return set;
}

model::ReadingSet ReadingsOfOmeFiles(const std::vector<std::string>& files,
                                     const model::ReadingOptions& options) {
  model::ReadingSet set;
  set.source = "the OME-XML of the images";
  std::string description;
  for (const std::string& file : files) {
    const std::string xml = ImageDescriptionOf(file);
    if (!IsOmeXml(xml))
      throw Error(file + ": its ImageDescription is no OME-XML, as an OME-TIFF has");
    const PageReadings readings = ReadingsOfOmeXml(xml, file, options);
    // Each file of a set repeats the XML of all.
    const std::string name = fs::path(file).filename().string();
    std::vector<PageReading> pages;
    for (const PageReading& page : readings.pages) {
      if (fs::path(page.file).filename() == name || page.file.empty()) pages.push_back(page);
    }
    if (pages.empty() && readings.pages.size() == 1) pages = readings.pages;  // it was renamed
    if (pages.size() != 1) {
      throw Error(
          fmt::format("{}: its OME-XML names {} pages of this file; frames are files of one "
                      "page each, or the pages of one OME-TIFF",
                      file, pages.size()));
    }
    description = readings.description;
    set.rows.push_back({file, pages.front().reading_mm, file + ": "});
  }
  if (set.rows.empty()) throw Error("no image, and therefore no OME-XML, is there");
  FinishMetadata("PositionZ", "", false, options, &set);
  set.description = fmt::format("{} in the OME-XML of {} files", description, set.rows.size());
  return set;
}

model::ReadingSet ReadingsOfPages(const std::string& description, const std::string& path,
                                  const model::ReadingOptions& options) {
  const std::string name = fs::path(path).filename().string();
  if (!IsOmeXml(description)) {
    throw Error(fmt::format(
        "{}: its ImageDescription is no OME-XML with positions of the pages; give a table by "
        "--readings, with a row for each page: '{}[0]', '{}[1]', ..",
        path, name, name));
  }
  PageReadings readings = ReadingsOfOmeXml(description, path, options);
  std::set<std::string> files;
  for (const PageReading& page : readings.pages) files.insert(fs::path(page.file).filename());
  // A set of files repeats the XML of all in each; a file that stands alone may have been renamed.
  if (files.size() > 1) {
    const auto is_other = [&](const PageReading& page) {
      return !page.file.empty() && fs::path(page.file).filename() != name;
    };
    readings.pages.erase(std::remove_if(readings.pages.begin(), readings.pages.end(), is_other),
                         readings.pages.end());
    if (readings.pages.empty())
      throw Error(fmt::format("{}: its OME-XML names other files, but no page of this one", path));
  }
  model::ReadingSet set;
  set.source = "its OME-XML";
  for (const PageReading& page : readings.pages) {
    if (page.channel != 0) {
      throw Error(fmt::format(
          "{}: page {} is of another channel: a sweep has one channel; extract its pages into a "
          "file",
          path, page.page));
    }
    const std::string row = fmt::format("{}[{}]", name, page.page);
    set.rows.push_back({row, page.reading_mm, fmt::format("{}: page {}: ", path, page.page)});
  }
  FinishMetadata("PositionZ", "", false, options, &set);
  set.description =
      fmt::format("{} in the OME-XML of {} pages", readings.description, set.rows.size());
  return set;
}

}  // namespace thicklens::io

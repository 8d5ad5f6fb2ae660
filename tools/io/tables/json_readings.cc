// JSON with the readings of a sweep: one file for all images, or one beside each.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "tools/io/image_names.h"
#include "tools/io/tables/reading_sources.h"

namespace thicklens::io {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

std::string Shown(const std::string& text) {
  constexpr std::size_t kMost = 80;
  return text.size() <= kMost ? text : text.substr(0, kMost) + "...";
}

// A number in the metadata of a frame.
struct Field {
  std::string name;  // with the names of the objects around it: "position.z"
  double value = 0;
};

// Names that are known to mean a position, in the order in which they are taken, with their unit.
struct KnownField {
  const char* name;
  const char* unit;
  bool is_focus_distance;
};
constexpr KnownField kKnownFields[] = {
    {"ZPositionUm", "um", false},      // Micro-Manager: where the drive was
    {"SlicePosition", "um", false},    // Micro-Manager 1.4: where it was sent
    {"position.z", "um", false},       // pymmcore-plus, "format": "frame-dict"
    {"mda_event.z_pos", "um", false},  // useq-schema
    {"LensPosition", "dpt", true},     // libcamera: rpicam-still --metadata, picamera2
};

// Collects the numbers of an object and of the objects in it. Micro-Manager writes some numbers as
// text.
void Collect(const json& object, const std::string& before, int depth, std::vector<Field>* fields) {
  constexpr int kMaxDepth = 4;
  constexpr std::size_t kMaxFields = 5000;
  if (depth > kMaxDepth || !object.is_object()) return;
  for (const auto& [key, value] : object.items()) {
    if (fields->size() >= kMaxFields) return;
    const std::string name = before + key;
    if (value.is_number()) {
      fields->push_back({name, value.get<double>()});
    } else if (value.is_object()) {
      Collect(value, name + ".", depth + 1, fields);
    }
  }
}

std::string LastPart(const std::string& name) {
  const std::size_t dot = name.rfind('.');
  return dot == std::string::npos ? name : name.substr(dot + 1);
}

// Which field is the reading: decided by the first frame, and the same for all.
struct Choice {
  std::string name;
  std::string unit;
  bool is_focus_distance = false;
  bool has_own_unit = false;  // by its name
};

std::string List(const std::vector<Field>& fields) {
  constexpr std::size_t kMost = 6;
  std::string text;
  for (std::size_t i = 0; i < std::min(fields.size(), kMost); ++i)
    text += (i == 0 ? "'" : ", '") + Shown(fields[i].name) + "'";
  if (fields.size() > kMost) text += fmt::format(" and {} more", fields.size() - kMost);
  return text;
}

// Whether the unit is known and is not one of a position: "ms".
bool IsOfAnotherQuantity(const std::string& unit) {
  model::ReadingOptions options;
  options.unit = unit;
  if (options.IsValid(nullptr)) return false;
  options.scale_mm = 1;
  return options.IsValid(nullptr);
}

// The unit that a text beside the number states: "unit", or "z_unit" for "z". Empty: none. A "unit"
// of seconds beside "z_mm" is that of another number.
std::string UnitBeside(const json& frame, const std::string& name, bool has_own_unit) {
  const json* object = &frame;
  std::string key = name;
  // A name of several parts may be a key with points, or objects in each other.
  while (object->is_object() && object->find(key) == object->end()) {
    const std::size_t dot = key.find('.');
    const auto inner = dot == std::string::npos ? object->end() : object->find(key.substr(0, dot));
    if (inner == object->end()) return "";
    object = &*inner;
    key.erase(0, dot + 1);
  }
  if (!object->is_object()) return "";
  for (const std::string& of_unit :
       {key + "_unit", key + "_units", key + "Unit", std::string("unit"), std::string("units"),
        std::string("Unit"), std::string("Units")}) {
    const auto found = object->find(of_unit);
    if (found == object->end() || !found->is_string()) continue;
    auto unit = found->get<std::string>();
    const bool is_of_other =
        has_own_unit && of_unit.rfind(key, 0) != 0 && IsOfAnotherQuantity(unit);
    if (!is_of_other) return unit;
  }
  return "";
}

// The units by their names: "microns" and "um" are one.
bool AreOneUnit(const std::string& one, const std::string& other) {
  return model::ReadingUnitName(one, {}) == model::ReadingUnitName(other, {});
}

void TakeUnit(const std::string& beside, const std::string& place,
              const model::ReadingOptions& options, Choice* choice) {
  if (beside.empty() || !options.unit.empty()) return;
  if (!choice->unit.empty() && !AreOneUnit(choice->unit, beside)) {
    throw Error(fmt::format("{}the unit '{}' is stated, but '{}' is in {}; state it by --unit",
                            place, Shown(beside), Shown(choice->name), Shown(choice->unit)));
  }
  choice->unit = beside;
}

bool IsFrameOfPymmcore(const json& frame) {
  const auto format = frame.find("format");
  return format != frame.end() && format->is_string() &&
         format->get_ref<const std::string&>() == "frame-dict";
}

Choice ChooseByName(const json& frame, const std::string& place,
                    const model::ReadingOptions& options) {
  std::vector<Field> fields;
  Collect(frame, "", 0, &fields);
  const auto find = [&](const std::string& name) {
    return std::find_if(fields.begin(), fields.end(),
                        [&](const Field& field) { return field.name == name; });
  };
  if (!options.column.empty()) {
    if (find(options.column) == fields.end()) {
      throw Error(fmt::format("{}--column: there is no number '{}'; there are {}", place,
                              Shown(options.column), fields.empty() ? "none" : List(fields)));
    }
    for (const KnownField& known : kKnownFields) {
      if (options.column == known.name) return {known.name, known.unit, known.is_focus_distance};
    }
    return {options.column, model::UnitOfReadingName(LastPart(options.column)).value_or(""), false};
  }
  for (const KnownField& known : kKnownFields) {
    const bool is_meant = std::string(known.name) != "position.z" || IsFrameOfPymmcore(frame);
    if (is_meant && find(known.name) != fields.end())
      return {known.name, known.unit, known.is_focus_distance};
  }
  std::vector<Field> readings;
  for (const Field& field : fields) {
    if (model::UnitOfReadingName(LastPart(field.name))) readings.push_back(field);
  }
  if (readings.size() == 1) {
    return {readings.front().name, *model::UnitOfReadingName(LastPart(readings.front().name)),
            false};
  }
  if (readings.size() > 1) {
    throw Error(
        fmt::format("{}which is the reading, {}? --column selects it", place, List(readings)));
  }
  std::string texts;
  for (const auto& [key, value] : frame.items()) {
    if (value.is_string() && model::UnitOfReadingName(key)) {
      texts = fmt::format("'{}' is the text \"{}\": write a number without quotation marks; ",
                          Shown(key), Shown(value.get<std::string>()));
    }
  }
  throw Error(fmt::format(
      "{}{}no number is named as a position (ZPositionUm, LensPosition, z, position, focus ...); "
      "--column selects one of {}",
      place, texts, fields.empty() ? "none" : List(fields)));
}

Choice Choose(const json& frame, const std::string& place, const model::ReadingOptions& options) {
  Choice choice = ChooseByName(frame, place, options);
  choice.has_own_unit = !choice.unit.empty();
  TakeUnit(UnitBeside(frame, choice.name, choice.has_own_unit), place, options, &choice);
  return choice;
}

double ReadingOf(const json& frame, const Choice& choice, const std::string& place,
                 const model::ReadingOptions& options) {
  std::vector<Field> fields;
  Collect(frame, "", 0, &fields);
  const auto found = std::find_if(fields.begin(), fields.end(),
                                  [&](const Field& field) { return field.name == choice.name; });
  if (found == fields.end())
    throw Error(fmt::format("{}the number '{}' is missing", place, Shown(choice.name)));
  constexpr double kMaxMagnitude = 1e30;
  if (!(found->value >= -kMaxMagnitude && found->value <= kMaxMagnitude)) {
    throw Error(fmt::format("{}'{}' must be a number of at most 1e30, found {}", place,
                            Shown(choice.name), found->value));
  }
  const std::string beside = UnitBeside(frame, choice.name, choice.has_own_unit);
  if (!beside.empty() && options.unit.empty() && !AreOneUnit(beside, choice.unit)) {
    throw Error(
        fmt::format("{}the unit '{}' is stated, but the readings before are in {}; state "
                    "it by --unit",
                    place, Shown(beside), model::ReadingUnitName(choice.unit, {})));
  }
  return model::ReadingInMm(found->value, choice.unit, options, place);
}

// One image and what the JSON says about it.
struct Frame {
  std::string file;
  std::string name;  // where it is in the JSON, for messages
  const json* metadata = nullptr;
};

bool StartsWith(const std::string& text, const std::string& beginning) {
  return text.compare(0, beginning.size(), beginning) == 0;
}

// Micro-Manager 1.4 has "FrameKey-TIME-CHANNEL-SLICE" with the name of the file inside, 2.0 has
// "Metadata-PATH"; pymmcore-plus has the name itself.
std::vector<Frame> FramesOfObject(const json& object, const std::string& path) {
  std::vector<Frame> frames;
  for (const auto& [key, value] : object.items()) {
    if (!value.is_object()) continue;
    const std::string name = "'" + Shown(key) + "'";
    if (StartsWith(key, "Metadata-")) {
      frames.push_back({key.substr(9), name, &value});
    } else if (StartsWith(key, "FrameKey-")) {
      const auto file = value.find("FileName");
      if (file == value.end() || !file->is_string())
        throw Error(fmt::format("{}: {}: the text 'FileName' is missing", path, name));
      frames.push_back({file->get<std::string>(), name, &value});
    }
  }
  if (!frames.empty()) return frames;
  for (const auto& [key, value] : object.items()) {
    const std::string ending = fs::path(key).extension().string();
    if (value.is_object() && ending.size() > 1)
      frames.push_back({key, "'" + Shown(key) + "'", &value});
  }
  return frames;
}

std::vector<Frame> FramesOfList(const json& list, const std::string& path,
                                const model::ReadingOptions& options) {
  std::vector<Frame> frames;
  for (std::size_t i = 0; i < list.size(); ++i) {
    const std::string name = fmt::format("element {}", i + 1);
    const json& frame = list[i];
    if (!frame.is_object())
      throw Error(
          fmt::format("{}: {}: an object with a file and a reading is expected", path, name));
    for (const auto& [key, value] : frame.items()) {
      const bool is_file =
          options.file_column.empty() ? model::IsNameOfFiles(key) : key == options.file_column;
      if (!is_file || !value.is_string()) continue;
      if (frames.size() > i) {
        throw Error(fmt::format("{}: {}: several texts name a file; --file-column selects one",
                                path, name));
      }
      frames.push_back({value.get<std::string>(), name, &frame});
    }
    if (frames.size() <= i) {
      const bool is_plan = frame.contains("z_pos") || frame.contains("index");
      throw Error(fmt::format("{}: {}: no text names the file of the image ({}); {}", path, name,
                              options.file_column.empty() ? "'file'" : options.file_column,
                              is_plan ? "a list of MDA events is a plan: the file "
                                        "_frame_metadata.json has what was recorded"
                                      : "--file-column selects it"));
    }
  }
  return frames;
}

// {"frames": [{"file": .., "z": ..}, ..]}: the only list of objects that name files. Null: there is
// none.
const json* ListIn(const json& object, const std::string& path,
                   const model::ReadingOptions& options) {
  const json* found = nullptr;
  std::string name;
  const auto has_file = [&](const json& one) {
    const auto fields = one.items();
    return one.is_object() && std::any_of(fields.begin(), fields.end(), [&](const auto& field) {
             return field.value().is_string() &&
                    (options.file_column.empty() ? model::IsNameOfFiles(field.key())
                                                 : field.key() == options.file_column);
           });
  };
  for (const auto& [key, value] : object.items()) {
    if (!value.is_array() || value.empty() || !has_file(value.front())) continue;
    if (found != nullptr) {
      throw Error(fmt::format("{}: the lists '{}' and '{}' may have the frames; write one of them",
                              path, Shown(name), Shown(key)));
    }
    found = &value;
    name = key;
  }
  return found;
}

// Whether a name comes first if the numbers in both are compared by their values: FrameKey-0-0-2 is
// before FrameKey-0-0-10, in which order they were recorded.
bool IsNaturallyBefore(const std::string& one, const std::string& other) {
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  std::size_t i = 0, k = 0;
  while (i < one.size() && k < other.size()) {
    if (!is_digit(one[i]) || !is_digit(other[k])) {
      if (one[i] != other[k]) return one[i] < other[k];
      ++i, ++k;
      continue;
    }
    const auto number = [&](const std::string& text, std::size_t* at) {
      const std::size_t begin = std::min(text.find_first_not_of('0', *at), text.size());
      *at = begin;
      while (*at < text.size() && is_digit(text[*at])) ++*at;
      return text.substr(begin, *at - begin);
    };
    const std::string left = number(one, &i), right = number(other, &k);
    if (left.size() != right.size()) return left.size() < right.size();
    if (left != right) return left < right;
  }
  return one.size() - i < other.size() - k;
}

// {"a.png": 95.5, ..} as a list of objects. The ending of "f/2.8" is none of a file; other endings
// than those of images are of files only where nothing else is.
json ListOfPairs(const json& object, bool any_ending) {
  const auto is_name = [&](const std::string& key) {
    const std::string ending = fs::path(key).extension().string();
    return IsImageName(key) || (any_ending && ending.size() > 1 &&
                                std::isalpha(static_cast<unsigned char>(ending[1])) != 0);
  };
  json list = json::array();
  for (const auto& [key, value] : object.items()) {
    if (value.is_number() && is_name(key)) list.push_back({{"file", key}, {"reading", value}});
  }
  std::sort(list.begin(), list.end(), [](const json& one, const json& other) {
    return IsNaturallyBefore(one["file"], other["file"]);
  });
  return list;
}

// Whether every line that is not empty is an object (JSON Lines); they become a list.
bool ParseLines(const std::string& text, json* list) {
  *list = json::array();
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string line = text.substr(begin, end - begin);
    begin = end + 1;
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    json one = json::parse(line, nullptr, false);
    if (!one.is_object()) return false;
    list->push_back(std::move(one));
  }
  return list->size() > 1;
}

[[noreturn]] void RefuseJson(const std::string& text, std::size_t at, const std::string& path,
                             const json::exception& error) {
  // "[json.exception.parse_error.101] parse error at line 1, column 2: WHY"
  const std::string what = error.what();
  const std::size_t begin =
      what.find(": ") == std::string::npos ? what.find("] ") : what.find(": ");
  const auto end = text.begin() + static_cast<std::ptrdiff_t>(std::min(at, text.size()));
  throw Error(fmt::format("{}:{}: not valid JSON: {}", path,
                          1 + std::count(text.begin(), end, '\n'),
                          Shown(begin == std::string::npos ? what : what.substr(begin + 2))));
}

// An acquisition that was aborted leaves out the last brace of metadata.txt.
json Parsed(const std::string& text, const std::string& path, model::ReadingSet* set) {
  try {
    return json::parse(text);
  } catch (const json::parse_error& error) {
    json lines;
    if (ParseLines(text, &lines)) return lines;
    const json completed = json::parse(text + "}", nullptr, false);
    if (completed.is_discarded()) RefuseJson(text, error.byte, path, error);
    set->notices.push_back(path + ": the last brace is missing (the recording was aborted?)");
    return completed;
  } catch (const json::out_of_range& error) {  // a number, which the message quotes
    const std::string what = error.what();
    const std::size_t first = what.find('\''), last = what.rfind('\'');
    const std::size_t at = first < last ? text.find(what.substr(first + 1, last - first - 1)) : 0;
    RefuseJson(text, at == std::string::npos ? 0 : at, path, error);
  }
}

}  // namespace

model::ReadingSet ReadingsOfJson(const std::string& text, const std::string& path,
                                 const model::ReadingOptions& options) {
  model::ReadingSet set;
  set.source = path;
  set.folder = fs::path(path).parent_path().string();
  const json parsed = Parsed(text, path, &set);
  std::vector<Frame> frames =
      parsed.is_array() ? FramesOfList(parsed, path, options) : FramesOfObject(parsed, path);
  json pairs;  // the frames point into it
  if (frames.empty() && parsed.is_object()) {
    pairs = ListOfPairs(parsed, false);
    const json* list = pairs.empty() ? ListIn(parsed, path, options) : &pairs;
    if (list == nullptr) {
      pairs = ListOfPairs(parsed, true);
      list = &pairs;
    }
    if (list != nullptr) frames = FramesOfList(*list, path, options);
  }
  if (frames.empty()) {
    const bool is_plan = parsed.is_object() && parsed.contains("z_plan");
    throw Error(fmt::format(
        "{}: no frame with a file and a reading; {}", path,
        is_plan ? "this is the plan of an acquisition (MDASequence): the file _frame_metadata.json "
                  "has what was recorded"
                : "keys FrameKey-... or Metadata-... (Micro-Manager), names of files, or a list of "
                  "objects with 'file' are expected"));
  }
  if (parsed.is_object() && pairs.is_null()) {
    std::stable_sort(frames.begin(), frames.end(), [](const Frame& one, const Frame& other) {
      return IsNaturallyBefore(one.name, other.name);
    });
  }
  std::optional<Choice> choice;
  std::map<std::string, std::string> known;
  for (const Frame& frame : frames) {
    const std::string place = fmt::format("{}: {}: ", path, frame.name);
    if (!choice) {
      choice = Choose(*frame.metadata, place, options);
      for (const char* key : {"unit", "units", "Unit", "Units"}) {
        const bool has_text = parsed.is_object() && parsed.contains(key) && parsed[key].is_string();
        if (!has_text) continue;
        const auto unit = parsed[key].get<std::string>();
        if (choice->has_own_unit && IsOfAnotherQuantity(unit)) continue;
        TakeUnit(unit, path + ": ", options, &*choice);
      }
    }
    const auto [other, added] = known.emplace(frame.file, frame.name);
    if (!added) {
      throw Error(fmt::format(
          "{}the file '{}' already has a reading, at {}; frames in one file are its pages, which "
          "this table cannot name",
          place, Shown(frame.file), other->second));
    }
    set.rows.push_back({frame.file, ReadingOf(*frame.metadata, *choice, place, options), place});
  }
  FinishMetadata(fmt::format("'{}' of {}", choice->name, fs::path(path).filename().string()),
                 choice->unit, choice->is_focus_distance, options, &set);
  return set;
}

namespace {

// rpicam-still and picamera2 leave the name to the user; these are usual.
std::string SidecarOf(const std::string& file) {
  const fs::path path(file);
  const std::string stem = (path.parent_path() / path.stem()).string();
  const std::vector<std::string> names = {file + ".json",          stem + ".json",
                                          stem + "_metadata.json", stem + ".metadata.json",
                                          stem + "_meta.json",     stem + "-metadata.json"};
  for (const std::string& name : names) {
    std::error_code failure;
    if (fs::exists(name, failure)) return name;
  }
  throw Error(fmt::format("{}: no JSON file is beside it; {} or {} is expected", file, names[1],
                          fs::path(names[0]).filename().string()));
}

}  // namespace

model::ReadingSet ReadingsOfSidecars(const std::vector<std::string>& files,
                                     const model::ReadingOptions& options) {
  model::ReadingSet set;
  set.source = "the JSON files beside the images";
  std::optional<Choice> choice;
  for (const std::string& file : files) {
    const std::string sidecar = SidecarOf(file);
    json parsed = Parsed(ReadTextFile(sidecar), sidecar, &set);
    if (parsed.is_array() && parsed.size() == 1) parsed = json(parsed[0]);  // of one frame
    const std::string place = sidecar + ": ";
    if (!parsed.is_object())
      throw Error(place + "an object with the metadata of one frame is expected");
    if (!choice) choice = Choose(parsed, place, options);
    set.rows.push_back({file, ReadingOf(parsed, *choice, place, options), place});
  }
  if (set.rows.empty()) throw Error("no image, and therefore no JSON file beside one, is there");
  FinishMetadata(fmt::format("'{}' of the JSON files beside the images", choice->name),
                 choice->unit, choice->is_focus_distance, options, &set);
  return set;
}

}  // namespace thicklens::io

#include "model/tables/reading_unit.h"

#include <fmt/format.h>

#include <cctype>
#include <cmath>
#include <cstddef>
#include <map>
#include <set>
#include <vector>

#include "model/tables/table_text.h"
#include "thicklens/base/error.h"
#include "thicklens/model/readings.h"

namespace thicklens::model {
namespace {

using Kind = ReadingUnit::Kind;

struct Spellings {
  ReadingUnit unit;
  const char* words;  // separated by spaces
};

// The first word is the name. Case does not matter, both micro signs are written as u, and the
// marks of TeX are left out ("$\\mu$m").
const Spellings kUnits[] = {
    {{"mm", Kind::kLength, 1},
     "mm millimeter millimeters millimetre millimetres millimètre millimètres milimetro milimetros "
     "мм 毫米"},
    {{"um", Kind::kLength, 1e-3},
     "um micron microns microm mum micrometer micrometers micrometre micrometres mikrometer "
     "micromètre "
     "micromètres мкм 微米"},
    {{"nm", Kind::kLength, 1e-6}, "nm nanometer nanometers nanometre nanometres нм 纳米"},
    {{"cm", Kind::kLength, 10}, "cm centimeter centimeters centimetre centimetres см 厘米"},
    {{"m", Kind::kLength, 1000}, "m meter meters metre metres"},
    {{"dm", Kind::kLength, 100}, "dm decimeter decimeters decimetre decimetres"},
    {{"pm", Kind::kLength, 1e-9}, "pm picometer picometers picometre picometres"},
    {{"angstrom", Kind::kLength, 1e-7},
     "angstrom angstroms \xC3\xA5ngstr\xC3\xB6m \xC3\x85ngstr\xC3\xB6m \xC3\xA5 \xC3\x85 "
     "\xE2\x84\xAB"},
    {{"mil", Kind::kLength, 0.0254}, "mil mils thou thous"},
    {{"ft", Kind::kLength, 304.8}, "ft foot feet"},
    {{"yd", Kind::kLength, 914.4}, "yd yds yard yards"},
    {{"in", Kind::kLength, 25.4}, "in inch inches zoll pouce pouces pulgada pulgadas \""},
    {{"dpt", Kind::kDioptre, 0},
     "dpt diopter diopters dioptre dioptres dioptrie dioptrien dioptrías 1/m m^-1 m-1"},
    {{"steps", Kind::kScaled, 0},
     "steps step stp microsteps microstep usteps ustep schritte schritt pasos passi"},
    {{"counts", Kind::kScaled, 0},
     "counts count cts ticks tick pulses pulse impulse impulses enc encoder adu lsb clicks click "
     "div divs division divisions"},
    {{"turns", Kind::kScaled, 0},
     "turns turn rev revs revolution revolutions rotations rotation umdrehung umdrehungen tours"},
    {{"s", Kind::kOther, 0}, "s sec secs second seconds sekunde sekunden ms us ns min h hr hours"},
    {{"deg", Kind::kOther, 0}, "deg degs degree degrees ° rad mrad urad arcsec arcmin grad"},
    {{"C", Kind::kOther, 0}, "c degc °c k °f celsius kelvin"},
    {{"V", Kind::kOther, 0}, "v mv uv volt volts a ma"},
    {{"px", Kind::kOther, 0}, "px pix pixel pixels"},
    {{"%", Kind::kOther, 0}, "% percent hz khz lux"},
};

std::string Normalised(const std::string& text) {
  std::string normal;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool is_micro =
        text.compare(i, 2, "\xC2\xB5") == 0 || text.compare(i, 2, "\xCE\xBC") == 0;
    if (is_micro) {
      normal += 'u';
      ++i;
    } else if (text[i] != ' ' && text[i] != '\t' && text[i] != '$' && text[i] != '\\') {
      normal += static_cast<char>(std::tolower(static_cast<unsigned char>(text[i])));
    }
  }
  if (!normal.empty() && normal.back() == '.') normal.pop_back();  // "mm."
  return normal;
}

std::map<std::string, ReadingUnit> UnitsByWord() {
  std::map<std::string, ReadingUnit> units;
  for (const Spellings& spellings : kUnits) {
    std::string words = spellings.words;
    words += ' ';
    for (std::size_t begin = 0; begin < words.size();) {
      const std::size_t end = words.find(' ', begin);
      units.emplace(words.substr(begin, end - begin), spellings.unit);
      begin = end + 1;
    }
  }
  return units;
}

}  // namespace

const char kUnitNames[] =
    "mm, um, nm, pm, angstrom, cm, dm, m, mil, in, ft, yd, dpt, steps, counts or turns";

std::optional<ReadingUnit> FindUnit(const std::string& text) {
  static const std::map<std::string, ReadingUnit> units = UnitsByWord();
  constexpr std::size_t kLongest = 32;
  if (text.size() > kLongest) return std::nullopt;
  const auto found = units.find(Normalised(text));
  if (found == units.end()) return std::nullopt;
  return found->second;
}

std::string UnitStatedIn(const std::string& line) {
  constexpr std::size_t kLongest = 400;
  static const std::set<std::string> names = {"unit",   "units",  "einheit", "einheiten", "unité",
                                              "unités", "unidad", "unidade", "unità",     "eenheid",
                                              "单位",   "単位",   "단위"};
  std::vector<std::string> words(1);
  bool has_mark = false;  // behind the word for a unit
  std::size_t name_at = 0;
  bool has_name = false;
  for (const char c : line.substr(0, kLongest) + " ") {
    const bool is_mark = std::string(":=,;\t|").find(c) != std::string::npos;
    const bool is_of_comment = c == '/' && words.back().empty();
    if (!is_mark && !is_of_comment && std::string(" \n#%[](){}\"'").find(c) == std::string::npos) {
      words.back() += c;
      continue;
    }
    if (!words.back().empty()) {
      if (!has_name && names.count(Normalised(words.back())) > 0) {
        has_name = true;
        name_at = words.size() - 1;
      }
      words.emplace_back();
    }
    if (has_name && is_mark && words.size() == name_at + 2) has_mark = true;
  }
  words.pop_back();
  if (!has_name) return "";
  const auto is_number = [&](std::size_t i) {
    return words[i].find_first_not_of("+-.0123456789") == std::string::npos &&
           words[i].find_first_of("0123456789") != std::string::npos;
  };
  std::string stated, stated_name, other;
  bool is_known = false;
  for (std::size_t i = name_at + 1; i < words.size(); ++i) {
    const auto unit = FindUnit(words[i]);
    if (!unit) continue;
    const bool is_first = has_mark && i == name_at + 1;
    const bool is_before_unit = i + 1 < words.size() && FindUnit(words[i + 1]).has_value();
    // A preposition: "units in mm".
    if (Normalised(words[i]) == "in" && i + 1 < words.size() && (is_before_unit || !is_first))
      continue;
    is_known = true;
    if (unit->kind == Kind::kOther && unit->name != "s") other = words[i];
    if (unit->kind == Kind::kOther || unit->name == stated_name) continue;
    if (i > name_at + 1 && is_number(i - 1)) {
      if (!stated.empty()) continue;  // a length: "units: mm; resolution 1 um"
      const bool is_factor = has_mark && i == name_at + 2 && words[i - 1] != "1";
      if (is_factor) return words[i - 1] + " " + words[i];  // a unit that is not known: "0.1 mm"
    }
    stated += (stated.empty() ? "" : " ") + words[i];
    stated_name = unit->name;
  }
  const bool is_alone = name_at == 0 && has_mark && words.size() > 1;
  if (!stated.empty() || !is_alone) return stated;
  if (is_known) return other;
  for (std::size_t i = 1; i < words.size(); ++i) stated += (i > 1 ? " " : "") + words[i];
  return stated;
}

std::string ReadingUnitName(const std::string& stated, const ReadingOptions& options) {
  const std::string& name = options.unit.empty() ? stated : options.unit;
  if (name.empty()) return options.scale_mm ? "steps" : "mm";
  const auto unit = FindUnit(name);
  return unit ? unit->name : name;
}

bool AreCountsWithoutLength(const std::string& stated, const ReadingOptions& options) {
  const auto unit = FindUnit(ReadingUnitName(stated, options));
  return unit && unit->kind == Kind::kScaled && !options.scale_mm;
}

double ReadingInMmOrCounts(double value, const std::string& stated, const ReadingOptions& options,
                           const std::string& place) {
  return AreCountsWithoutLength(stated, options) ? value
                                                 : ReadingInMm(value, stated, options, place);
}

double ReadingInMm(double value, const std::string& stated, const ReadingOptions& options,
                   const std::string& place) {
  const std::string name = ReadingUnitName(stated, options);
  const auto unit = FindUnit(name);
  if (!unit || unit->kind == Kind::kOther) {
    if (unit && options.scale_mm) return value * *options.scale_mm;  // the output of a sensor
    throw Error(fmt::format(
        "{}{}; state the unit by --unit ({}), or the length of one of it by --reading-scale with "
        "--unit steps",
        place,
        unit ? fmt::format("the unit '{}' is no unit of length",
                           Shown(options.unit.empty() ? stated : options.unit))
             : fmt::format("'{}' is taken for a unit, and none of that name is known", Shown(name)),
        kUnitNames));
  }
  if (unit->kind == Kind::kScaled) {
    if (!options.scale_mm) {
      throw Error(
          fmt::format("{}the readings are in {}; state their length in mm by "
                      "--reading-scale, or another unit by --unit",
                      place, unit->name));
    }
    return value * *options.scale_mm;
  }
  if (options.scale_mm) {
    throw Error(fmt::format(
        "{}the readings are in {}, which has a length; --reading-scale is for steps and counts "
        "(--unit steps, if the readings are that)",
        place, unit->name));
  }
  if (unit->kind == Kind::kLength) return value * unit->mm_per_unit;
  constexpr double kMmPerMetre = 1000;
  if (!(value > 0)) {
    throw Error(
        fmt::format("{}{} dpt: a reading in dioptres must be above 0 (0 is infinity: leave "
                    "that frame out)",
                    place, value));
  }
  return kMmPerMetre / value;
}

bool ReadingOptions::IsValid(std::string* why) const {
  const auto fail = [why](const std::string& text) {
    if (why != nullptr) *why = text;
    return false;
  };
  if (!unit.empty()) {
    const auto found = FindUnit(unit);
    if (Normalised(unit).rfind("lens-d", 0) == 0) {
      return fail(
          "unit: readings in dioptres of a lens itself, whose focal length they change, are not "
          "supported. If the sensor stays, its focus distance in dioptres is the reading minus "
          "that at which infinity is in focus: give these differences as dpt");
    }
    if (!found || (found->kind == Kind::kOther && !scale_mm))
      return fail(fmt::format("unit: {} is expected, found '{}'", kUnitNames, Shown(unit)));
  }
  if (scale_mm && !(std::isfinite(*scale_mm) && *scale_mm != 0))
    return fail(
        fmt::format("scale_mm: a finite number other than 0 is expected, found {}", *scale_mm));
  if (!decimal.empty() && decimal != "comma" && decimal != "point")
    return fail(fmt::format("decimal: comma or point is expected, found '{}'", Shown(decimal)));
  if (!source.empty() && source != "exif" && source != "sidecar" && source != "ome")
    return fail(fmt::format("source: exif, sidecar or ome is expected, found '{}'", Shown(source)));
  if (!time_column.empty() && !file_column.empty())
    return fail("time_column: excludes file_column: a row is of a time or of a frame");
  static const std::set<std::string> units_of_time = {"s", "ms", "us", "ns", "min", "h"};
  if (!time_unit.empty() && units_of_time.count(time_unit) == 0) {
    return fail(fmt::format("time_unit: s, ms, us, ns, min or h is expected, found '{}'",
                            Shown(time_unit)));
  }
  if (!source.empty() && !name_pattern.empty())
    return fail("name_pattern: excludes source, which takes the readings from inside the files");
  if (!name_pattern.empty()) {
    const std::size_t at = name_pattern.find("{reading}");
    if (at == std::string::npos || name_pattern.find("{reading}", at + 1) != std::string::npos) {
      return fail(
          fmt::format("name_pattern: a text that contains {{reading}} once is expected, found '{}'",
                      Shown(name_pattern)));
    }
  }
  return true;
}

}  // namespace thicklens::model

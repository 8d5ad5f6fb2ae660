// The focus distance in EXIF, in the notes of some makers, and in XMP.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <exiv2/exiv2.hpp>
#include <optional>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "tools/io/metadata_image.h"
#include "tools/io/tables/metadata_fields.h"
#include "tools/io/tables/reading_sources.h"

namespace thicklens::io {
namespace {

std::optional<double> Ratio(const Exiv2::Metadatum& datum) {
  if (datum.count() == 0) return std::nullopt;
  double value = NAN;
  const Exiv2::TypeId type = datum.typeId();
  if (type == Exiv2::unsignedRational || type == Exiv2::signedRational) {
    const Exiv2::Rational fraction = datum.toRational();  // toFloat has single precision
    // All bits of the numerator mean infinity, and a denominator of 0 has no value.
    if (fraction.first == -1 || datum.toString().rfind("4294967295/", 0) == 0) return std::nullopt;
    value = static_cast<double>(fraction.first) / fraction.second;
  } else if (type == Exiv2::xmpText || type == Exiv2::asciiString) {
    const std::string text = datum.toString();
    const std::size_t slash = text.find('/');
    try {
      std::size_t end = 0;
      value = std::stod(text, &end);
      if (slash != std::string::npos && slash == end) value /= std::stod(text.substr(slash + 1));
    } catch (const std::exception&) {
      return std::nullopt;
    }
  } else {
    value = static_cast<double>(datum.toLong());
  }
  if (!std::isfinite(value)) return std::nullopt;
  return value;
}

// Olympus writes mm in the numerator, whatever the denominator.
std::optional<double> Numerator(const Exiv2::Metadatum& datum) {
  if (datum.count() == 0) return std::nullopt;
  const double mm = static_cast<double>(datum.toRational().first);
  if (!(mm > 0)) return std::nullopt;
  return mm;
}

// Canon: centimetres; all bits mean infinity.
std::optional<double> Centimetres(const Exiv2::Metadatum& datum) {
  constexpr double kInfinity = 65535;
  const auto cm = Ratio(datum);
  if (!cm || !(*cm > 0) || *cm >= kInfinity) return std::nullopt;
  return cm;
}

// Nikon: 0.01 m times 10^(value/40).
std::optional<double> Logarithm(const Exiv2::Metadatum& datum) {
  constexpr double kStepsPerDecade = 40, kMetres = 0.01;
  const auto steps = Ratio(datum);
  if (!steps || !(*steps > 0)) return std::nullopt;
  return kMetres * std::pow(10.0, *steps / kStepsPerDecade);
}

struct KnownKey {
  const char* key;
  const char* unit;
  std::optional<double> (*value)(const Exiv2::Metadatum&);
};

// In the order in which they are taken. Canon states two limits of the distance; --column selects
// the lower one.
constexpr KnownKey kKnownKeys[] = {
    {"Exif.Photo.SubjectDistance", "m", Ratio},
    {"Exif.Image.SubjectDistance", "m", Ratio},
    {"Xmp.exif.SubjectDistance", "m", Ratio},
    {"Xmp.aux.ApproximateFocusDistance", "m", Ratio},
    {"Exif.OlympusFi.FocusDistance", "mm", Numerator},
    {"Exif.NikonLd3.FocusDistance", "m", Logarithm},
    {"Exif.NikonLd2.FocusDistance", "m", Logarithm},
    {"Exif.CanonFi.FocusDistanceUpper", "cm", Centimetres},
    {"Exif.CanonFi.FocusDistanceLower", "cm", Centimetres},
    {"Exif.CanonSi.SubjectDistance", "cm", Centimetres},
};

// Keys that users write with exiftool, in any schema: Xmp.NAME.LensPosition.
constexpr std::pair<const char*, const char*> kKnownNames[] = {
    {"LensPosition", "dpt"}, {"FocusDistance", "m"}, {"FocusPosition", ""}};

struct Value {
  std::string key, unit;
  double value = 0;
};

template <typename Metadata>
std::optional<Value> OfKey(const Metadata& metadata, const std::string& key,
                           const std::string& unit,
                           std::optional<double> (*value)(const Exiv2::Metadatum&)) {
  for (const auto& datum : metadata) {
    if (datum.key() != key) continue;
    if (const auto number = value(datum)) return Value{key, unit, *number};
  }
  return std::nullopt;
}

std::string EndOf(const std::string& key) { return key.substr(key.rfind('.') + 1); }

std::optional<Value> ValueOf(const Exiv2::Image& image, const std::string& asked) {
  const Exiv2::ExifData& exif = image.exifData();
  const Exiv2::XmpData& xmp = image.xmpData();
  for (const KnownKey& known : kKnownKeys) {
    if (!asked.empty() && asked != known.key && asked != EndOf(known.key)) continue;
    auto found = OfKey(exif, known.key, known.unit, known.value);
    if (!found) found = OfKey(xmp, known.key, known.unit, known.value);
    if (found) return found;
  }
  const auto of_name = [&](const std::string& key) -> std::optional<std::string> {
    if (!asked.empty() && asked != key && asked != EndOf(key)) return std::nullopt;
    for (const auto& [name, unit] : kKnownNames) {
      if (EndOf(key) == name) return std::string(unit);
    }
    if (asked.empty()) return std::nullopt;
    return model::UnitOfReadingName(EndOf(key)).value_or("");
  };
  for (const auto& datum : xmp) {
    const auto unit = of_name(datum.key());
    const auto number = unit ? Ratio(datum) : std::nullopt;
    if (number) return Value{datum.key(), *unit, *number};
  }
  if (asked.empty()) return std::nullopt;
  for (const auto& datum : exif) {
    const auto unit = of_name(datum.key());
    const auto number = unit ? Ratio(datum) : std::nullopt;
    if (number) return Value{datum.key(), *unit, *number};
  }
  return std::nullopt;
}

template <typename Take>
auto WithMetadata(const std::string& path, const Take& take) {
  Exiv2::LogMsg::setLevel(Exiv2::LogMsg::mute);
  const std::string bytes = ReadWholeFile(path);
  try {
    return take(*ReadMetadata(bytes));
  } catch (const Exiv2::AnyError& error) {
    throw Error(fmt::format("{}: its metadata cannot be read: {}", path, error.what()));
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    throw Error(fmt::format("{}: its metadata cannot be read: {}", path, error.what()));
  }
}

}  // namespace

std::string ImageDescriptionOf(const std::string& path) {
  return WithMetadata(path, [](const Exiv2::Image& image) -> std::string {
    for (const auto& datum : image.exifData()) {
      if (datum.key() == "Exif.Image.ImageDescription") return datum.toString();
    }
    return "";
  });
}

model::ReadingSet ReadingsOfExif(const std::vector<std::string>& files,
                                 const model::ReadingOptions& options) {
  model::ReadingSet set;
  set.source = "the metadata of the images";
  std::string key, unit;
  for (const std::string& file : files) {
    const std::string place = file + ": ";
    const auto value = WithMetadata(file, [&](const Exiv2::Image& image) {
      return ValueOf(image, key.empty() ? options.column : key);
    });
    if (!value && options.column.empty()) {
      throw Error(fmt::format(
          "{}{}; a focus distance in EXIF or XMP ({}) is expected, or the key that --column names",
          place,
          key.empty()
              ? "EXIF and XMP state no finite focus distance"
              : fmt::format("{} has no finite number here (it is missing or infinite), and {} "
                            "has one",
                            key, files.front()),
          "SubjectDistance, ApproximateFocusDistance, LensPosition"));
    }
    if (!value) {
      throw Error(
          fmt::format("{}--column: EXIF and XMP have no number '{}'", place, options.column));
    }
    key = value->key;
    unit = value->unit;
    set.rows.push_back({file, model::ReadingInMm(value->value, unit, options, place), place});
  }
  if (set.rows.empty()) throw Error("no image, and therefore no EXIF, is there");
  FinishMetadata(key, unit, true, options, &set);
  return set;
}

}  // namespace thicklens::io

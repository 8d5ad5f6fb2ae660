#include "thicklens/io/exif.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <exception>
#include <exiv2/exiv2.hpp>
#include <limits>

#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"

namespace thicklens::io {
namespace {

// A larger mismatch of the two pitches is not explained by the rounding of the EXIF fractions.
constexpr double kMaxPitchMismatch = 0.01;

std::optional<double> PositiveValue(const Exiv2::ExifData& exif, const char* key) {
  const auto found = exif.findKey(Exiv2::ExifKey(key));
  if (found == exif.end() || found->count() == 0) return std::nullopt;
  const Exiv2::Rational fraction = found->toRational();  // toFloat has single precision
  const double value = static_cast<double>(fraction.first) / fraction.second;
  if (!(value > 0) || !std::isfinite(value)) return std::nullopt;
  return value;
}

// EXIF 2.3, FocalPlaneResolutionUnit: 2 inch (the default), 3 cm; files also use 4 mm and 5 um.
double ResolutionUnitMm(const Exiv2::ExifData& exif) {
  const double unit = PositiveValue(exif, "Exif.Photo.FocalPlaneResolutionUnit").value_or(2);
  if (unit == 3) return 10;
  if (unit == 4) return 1;
  if (unit == 5) return 1e-3;
  return 25.4;
}

std::optional<int> WholePixels(const Exiv2::ExifData& exif, const char* key) {
  const std::optional<double> value = PositiveValue(exif, key);
  constexpr double kMaxPx = 1e6;
  if (!value || *value != std::floor(*value) || *value > kMaxPx) return std::nullopt;
  return static_cast<int>(*value);
}

// EXIF 2.3: the unit is metres; all bits of the numerator set mean infinity, and 0 means unknown.
std::optional<double> SubjectDistanceMm(const Exiv2::ExifData& exif) {
  constexpr char kKey[] = "Exif.Photo.SubjectDistance";
  constexpr double kMmPerMetre = 1000;
  const auto found = exif.findKey(Exiv2::ExifKey(kKey));
  if (found == exif.end() || found->count() == 0) return std::nullopt;
  if (found->toString().rfind("4294967295/", 0) == 0 || found->toRational().first == -1) {
    return std::numeric_limits<double>::infinity();
  }
  const std::optional<double> metres = PositiveValue(exif, kKey);
  if (!metres) return std::nullopt;
  return *metres * kMmPerMetre;
}

void TakeImage(const Exiv2::ExifData& exif, PhotoExif* photo) {
  photo->subject_distance_mm = SubjectDistanceMm(exif);
  photo->focal_length_35mm = PositiveValue(exif, "Exif.Photo.FocalLengthIn35mmFilm");
  photo->digital_zoom = PositiveValue(exif, "Exif.Photo.DigitalZoomRatio");
  photo->made_width_px = WholePixels(exif, "Exif.Photo.PixelXDimension");
  photo->made_height_px = WholePixels(exif, "Exif.Photo.PixelYDimension");
  const auto orientation = exif.findKey(Exiv2::ExifKey("Exif.Image.Orientation"));
  if (orientation != exif.end() && orientation->count() > 0) {
    const std::int64_t value = orientation->toLong();
    if (value >= 1 && value <= 8) photo->orientation = static_cast<int>(value);
  }
}

// The resolution refers to the image as the camera made it. It says nothing about an image that
// was scaled or cropped afterwards, because how is unknown.
void TakePitch(const Exiv2::ExifData& exif, int width_px, int height_px, PhotoExif* photo) {
  const auto x_per_unit = PositiveValue(exif, "Exif.Photo.FocalPlaneXResolution");
  const auto y_per_unit = PositiveValue(exif, "Exif.Photo.FocalPlaneYResolution");
  if (!x_per_unit) {
    photo->why_no_pitch = "EXIF has no FocalPlaneXResolution";
    return;
  }
  if (!y_per_unit || std::abs(*y_per_unit / *x_per_unit - 1) <= kMaxPitchMismatch) {
    photo->made_pixel_pitch_mm = ResolutionUnitMm(exif) / *x_per_unit;
  }
  const double made_width_px = PositiveValue(exif, "Exif.Photo.PixelXDimension").value_or(width_px);
  const double made_height_px =
      PositiveValue(exif, "Exif.Photo.PixelYDimension").value_or(height_px);
  if (made_width_px != width_px || made_height_px != height_px) {
    photo->why_no_pitch =
        fmt::format("the images are {} x {} px, EXIF states {} x {}: they were scaled or cropped",
                    width_px, height_px, made_width_px, made_height_px);
    return;
  }
  if (y_per_unit && std::abs(*y_per_unit / *x_per_unit - 1) > kMaxPitchMismatch) {
    photo->why_no_pitch = fmt::format("EXIF has pixels that are not square ({} and {} per unit)",
                                      *x_per_unit, *y_per_unit);
    return;
  }
  photo->pixel_pitch_mm = ResolutionUnitMm(exif) / *x_per_unit;
}

}  // namespace

bool PhotoExif::IsEmpty() const {
  return !focal_length_mm && !f_number && !subject_distance_mm && !focal_length_35mm &&
         !made_pixel_pitch_mm && !made_width_px && !made_height_px && !digital_zoom &&
         orientation == 1;
}

PhotoExif ReadPhotoExif(const std::string& path, int width_px, int height_px) {
  Exiv2::LogMsg::setLevel(Exiv2::LogMsg::mute);
  PhotoExif photo;
  try {
    // The file is not opened by its name, which Exiv2 may take for a network address or for
    // standard input.
    const std::string bytes = ReadWholeFile(path);
    const auto image = Exiv2::ImageFactory::open(
        reinterpret_cast<const Exiv2::byte*>(bytes.data()),  // NOLINT: bytes
        static_cast<long>(bytes.size()));
    image->readMetadata();
    const Exiv2::ExifData& exif = image->exifData();
    photo.focal_length_mm = PositiveValue(exif, "Exif.Photo.FocalLength");
    photo.f_number = PositiveValue(exif, "Exif.Photo.FNumber");
    TakePitch(exif, width_px, height_px, &photo);
    const auto model = exif.findKey(Exiv2::ExifKey("Exif.Image.Model"));
    if (model != exif.end()) photo.model = model->toString();
    TakeImage(exif, &photo);
  } catch (const Exiv2::AnyError& error) {
    throw Error(fmt::format("{}: its metadata cannot be read: {}", path, error.what()));
  }
  return photo;
}

PhotoExif ReadExifIfAny(const std::string& path, int width_px, int height_px, std::string* why) {
  Exiv2::LogMsg::setLevel(Exiv2::LogMsg::mute);
  why->clear();
  try {
    if (Exiv2::ImageFactory::getType(path) == Exiv2::ImageType::none) return {};
    return ReadPhotoExif(path, width_px, height_px);
  } catch (const std::exception& error) {
    *why = error.what();
    return {};
  }
}

}  // namespace thicklens::io

#include "exif.h"

#include <fmt/format.h>

#include <cmath>
#include <exiv2/exiv2.hpp>

#include "thicklens/error.h"

namespace thicklens::tools {
namespace {

// Non-square pixels beyond this are no rounding of the EXIF fractions.
constexpr double kMaxPitchMismatch = 0.01;

std::optional<double> PositiveValue(const Exiv2::ExifData& exif, const char* key) {
  const auto found = exif.findKey(Exiv2::ExifKey(key));
  if (found == exif.end() || found->count() == 0) return std::nullopt;
  const Exiv2::Rational fraction = found->toRational();  // toFloat has single precision
  const double value = static_cast<double>(fraction.first) / fraction.second;
  if (!(value > 0) || !std::isfinite(value)) return std::nullopt;
  return value;
}

// EXIF 2.3, FocalPlaneResolutionUnit: 2 inch (the default), 3 cm; 4 mm and 5 um are in use too.
double ResolutionUnitMm(const Exiv2::ExifData& exif) {
  const double unit = PositiveValue(exif, "Exif.Photo.FocalPlaneResolutionUnit").value_or(2);
  if (unit == 3) return 10;
  if (unit == 4) return 1;
  if (unit == 5) return 1e-3;
  return 25.4;
}

// The resolution is that of the picture as the camera made it: of a picture that was made smaller
// or cut since, nobody knows which, it says nothing.
void TakePitch(const Exiv2::ExifData& exif, int width_px, int height_px, PhotoExif* photo) {
  const auto x_per_unit = PositiveValue(exif, "Exif.Photo.FocalPlaneXResolution");
  const auto y_per_unit = PositiveValue(exif, "Exif.Photo.FocalPlaneYResolution");
  if (!x_per_unit) {
    photo->why_no_pitch = "EXIF has no FocalPlaneXResolution";
    return;
  }
  const double made_width_px = PositiveValue(exif, "Exif.Photo.PixelXDimension").value_or(width_px);
  const double made_height_px =
      PositiveValue(exif, "Exif.Photo.PixelYDimension").value_or(height_px);
  if (made_width_px != width_px || made_height_px != height_px) {
    photo->why_no_pitch =
        fmt::format("the pictures are {} x {} px, EXIF speaks of {} x {}: scaled or cut", width_px,
                    height_px, made_width_px, made_height_px);
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

PhotoExif ReadPhotoExif(const std::string& path, int width_px, int height_px) {
  Exiv2::LogMsg::setLevel(Exiv2::LogMsg::mute);
  PhotoExif photo;
  try {
    const auto image = Exiv2::ImageFactory::open(path);
    image->readMetadata();
    const Exiv2::ExifData& exif = image->exifData();
    photo.focal_length_mm = PositiveValue(exif, "Exif.Photo.FocalLength");
    photo.f_number = PositiveValue(exif, "Exif.Photo.FNumber");
    TakePitch(exif, width_px, height_px, &photo);
    const auto model = exif.findKey(Exiv2::ExifKey("Exif.Image.Model"));
    if (model != exif.end()) photo.model = model->toString();
  } catch (const Exiv2::AnyError& error) {
    throw Error(fmt::format("{}: its metadata cannot be read: {}", path, error.what()));
  }
  return photo;
}

}  // namespace thicklens::tools

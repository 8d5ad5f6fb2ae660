#include "thicklens/io/exif.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <exception>
#include <exiv2/exiv2.hpp>
#include <limits>

#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/io/image_file.h"
#include "tools/io/metadata_image.h"

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

bool IsSquare(double x_per_unit, double y_per_unit) {
  return std::abs(y_per_unit / x_per_unit - 1) <= kMaxPitchMismatch;
}

std::string NotSquare(double x_per_unit, double y_per_unit) {
  return fmt::format("EXIF has pixels that are not square ({} and {} per unit)", x_per_unit,
                     y_per_unit);
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
  if (!y_per_unit || IsSquare(*x_per_unit, *y_per_unit)) {
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
  if (y_per_unit && !IsSquare(*x_per_unit, *y_per_unit)) {
    photo->why_no_pitch = NotSquare(*x_per_unit, *y_per_unit);
    return;
  }
  photo->pixel_pitch_mm = ResolutionUnitMm(exif) / *x_per_unit;
  photo->pitch_source = "EXIF FocalPlaneXResolution";
}

// ---- The pixel pitch of a raw file.

// Pixels per length on the sensor, and the field that states them.
struct StatedSampling {
  double x_per_unit = 0;
  std::optional<double> y_per_unit;
  double unit_mm = 0;
  std::string field;
};

// ISO 12234-2 (TIFF/EP), FocalPlaneResolutionUnit: 1 inch, 2 metre, 3 cm, 4 mm, 5 um. Files also
// have 2 for inches, as in EXIF. No sensor has pixels as small as those that this mistake makes.
double TiffEpUnitMm(double unit, double x_per_unit) {
  constexpr double kInchMm = 25.4, kMetreMm = 1000, kSmallestPitchMm = 0.4e-3;
  if (unit == 3) return 10;
  if (unit == 4) return 1;
  if (unit == 5) return 1e-3;
  if (unit == 2 && kInchMm / x_per_unit < kSmallestPitchMm) return kMetreMm;
  return kInchMm;
}

// EXIF has the tags 0xA20E to 0xA210 in its own directory. TIFF/EP has 0x920E to 0x9210 in the
// first directory or in that of the main image, the one whose NewSubfileType is 0.
std::optional<StatedSampling> SamplingOf(const Exiv2::ExifData& exif) {
  StatedSampling sampling;
  if (const auto x = PositiveValue(exif, "Exif.Photo.FocalPlaneXResolution")) {
    sampling.x_per_unit = *x;
    sampling.y_per_unit = PositiveValue(exif, "Exif.Photo.FocalPlaneYResolution");
    sampling.unit_mm = ResolutionUnitMm(exif);
    sampling.field = "EXIF FocalPlaneXResolution";
    return sampling;
  }
  for (const std::string group : {"SubImage1", "SubImage2", "SubImage3", "SubImage4", "Image"}) {
    const std::string directory = "Exif." + group + ".";
    const auto x = PositiveValue(exif, (directory + "FocalPlaneXResolution").c_str());
    if (!x) continue;
    const auto kind = exif.findKey(Exiv2::ExifKey(directory + "NewSubfileType"));
    const bool is_main = kind == exif.end() || kind->count() == 0 || kind->toLong() == 0;
    if (group != "Image" && !is_main) continue;
    sampling.x_per_unit = *x;
    sampling.y_per_unit = PositiveValue(exif, (directory + "FocalPlaneYResolution").c_str());
    const auto unit = PositiveValue(exif, (directory + "FocalPlaneResolutionUnit").c_str());
    sampling.unit_mm = TiffEpUnitMm(unit.value_or(2), *x);
    sampling.field = "TIFF/EP FocalPlaneXResolution";
    return sampling;
  }
  return std::nullopt;
}

// Whether an image of this size, turned or not, has the sensor's pixels one by one: it may lack a
// few at the edges of the active area, and it may have some of the masked margins.
bool IsAtSamplingOf(const RawFacts& raw, double width_px, double height_px) {
  constexpr double kMinShare = 0.95;
  const auto size = std::minmax(width_px, height_px);
  const auto active = std::minmax(raw.active_width_px, raw.active_height_px);
  const auto sensor = std::minmax(raw.sensor_width_px, raw.sensor_height_px);
  return size.first >= kMinShare * active.first && size.second >= kMinShare * active.second &&
         size.first <= std::max(sensor.first, active.first) &&
         size.second <= std::max(sensor.second, active.second);
}

// Compares with the diagonal of the sensor that follows from the equivalent focal length. Binned
// pixels and sRAW files differ by 1.45 and more; rounded focal lengths, distortion and other aspect
// ratios by less than the limit. Empty: nothing contradicts the pitch.
std::string WhyOtherDiagonal(const RawFacts& raw, double pitch_mm, const PhotoExif& photo) {
  constexpr double kFilmDiagonalMm = 43.267, kMaxFactor = 1.35;
  if (!photo.focal_length_mm || !photo.focal_length_35mm) return "";
  if (photo.digital_zoom && *photo.digital_zoom > 1) return "";  // the equivalent may include it
  const double diagonal_mm = kFilmDiagonalMm * *photo.focal_length_mm / *photo.focal_length_35mm;
  const double by_pitch_mm = pitch_mm * std::hypot(raw.active_width_px, raw.active_height_px);
  const double factor = by_pitch_mm / diagonal_mm;
  if (factor < kMaxFactor && factor > 1 / kMaxFactor) return "";
  return fmt::format(
      "{:.4g} um by its FocalPlaneXResolution would make the diagonal of the sensor {:.4g} mm, but "
      "{:.4g} mm follows from its focal lengths ({:.4g} mm, {:.4g} mm for 35 mm film): one of "
      "these fields is not of this file's pixels",
      1e3 * pitch_mm, by_pitch_mm, diagonal_mm, *photo.focal_length_mm, *photo.focal_length_35mm);
}

// The resolution counts pixels of the image whose size EXIF states, usually the camera's own JPEG.
void TakeRawPitch(const Exiv2::ExifData& exif, int width_px, int height_px, const RawFacts& raw,
                  PhotoExif* photo) {
  const std::optional<StatedSampling> sampling = SamplingOf(exif);
  if (!sampling) {
    photo->why_no_pitch =
        "the raw file has no FocalPlaneXResolution, neither of EXIF nor of TIFF/EP";
    return;
  }
  if (sampling->y_per_unit && !IsSquare(sampling->x_per_unit, *sampling->y_per_unit)) {
    photo->why_no_pitch = NotSquare(sampling->x_per_unit, *sampling->y_per_unit);
    return;
  }
  const double pitch_mm = sampling->unit_mm / sampling->x_per_unit;
  if (!raw.why_resampled.empty()) {
    photo->why_no_pitch =
        "which pixels its FocalPlaneXResolution counts is not stated: " + raw.why_resampled;
    return;
  }
  const std::string area = fmt::format("the active area of the raw file's sensor is {} x {} px",
                                       raw.active_width_px, raw.active_height_px);
  if (!IsAtSamplingOf(raw, width_px, height_px)) {
    photo->why_no_pitch = fmt::format("the images are {} x {} px, {}: they were scaled or cropped",
                                      width_px, height_px, area);
    return;
  }
  const double made_width_px =
      PositiveValue(exif, "Exif.Photo.PixelXDimension").value_or(raw.active_width_px);
  const double made_height_px =
      PositiveValue(exif, "Exif.Photo.PixelYDimension").value_or(raw.active_height_px);
  if (!IsAtSamplingOf(raw, made_width_px, made_height_px)) {
    photo->why_no_pitch = fmt::format(
        "its FocalPlaneXResolution counts pixels of an image of {} x {} px, {}: whether that image "
        "was scaled or cropped is not stated",
        made_width_px, made_height_px, area);
    return;
  }
  photo->why_no_pitch = WhyOtherDiagonal(raw, pitch_mm, *photo);
  if (!photo->why_no_pitch.empty()) return;
  photo->pixel_pitch_mm = pitch_mm;
  photo->pitch_source = sampling->field;
}

}  // namespace

bool PhotoExif::IsEmpty() const {
  return !focal_length_mm && !f_number && !subject_distance_mm && !focal_length_35mm &&
         !made_pixel_pitch_mm && !made_width_px && !made_height_px && !digital_zoom &&
         orientation == 1;
}

PhotoExif ReadPhotoExif(const std::string& path, int width_px, int height_px, const RawFacts* raw) {
  Exiv2::LogMsg::setLevel(Exiv2::LogMsg::mute);
  PhotoExif photo;
  try {
    const std::string bytes = ReadWholeFile(path);
    const auto image = ReadMetadata(bytes);
    const Exiv2::ExifData& exif = image->exifData();
    photo.focal_length_mm = PositiveValue(exif, "Exif.Photo.FocalLength");
    photo.f_number = PositiveValue(exif, "Exif.Photo.FNumber");
    const auto model = exif.findKey(Exiv2::ExifKey("Exif.Image.Model"));
    if (model != exif.end()) photo.model = model->toString();
    TakeImage(exif, &photo);
    if (raw == nullptr) {
      TakePitch(exif, width_px, height_px, &photo);
    } else {
      TakeRawPitch(exif, width_px, height_px, *raw, &photo);
      // EXIF states the size of the camera's own JPEG, which says nothing about these pixels.
      photo.made_width_px = photo.made_height_px = std::nullopt;
      photo.made_pixel_pitch_mm = std::nullopt;
    }
  } catch (const Exiv2::AnyError& error) {
    throw Error(fmt::format("{}: its metadata cannot be read: {}", path, error.what()));
  }
  return photo;
}

PhotoExif ReadExifIfAny(const std::string& path, int width_px, int height_px, std::string* why,
                        const RawFacts* raw) {
  Exiv2::LogMsg::setLevel(Exiv2::LogMsg::mute);
  why->clear();
  try {
    if (!CanHoldMetadata(ReadWholeFile(path))) return {};
    return ReadPhotoExif(path, width_px, height_px, raw);
  } catch (const std::exception& error) {
    *why = error.what();
    return {};
  }
}

}  // namespace thicklens::io

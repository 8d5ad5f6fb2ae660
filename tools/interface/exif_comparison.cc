// How far a photograph's EXIF agrees with a camera; docs/light-fields.md states the rules.
#include "tools/interface/exif_comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <utility>

#include "thicklens/model/thick_lens.h"

namespace thicklens {
namespace {

// Engraved focal lengths are within 5 % at most (ISO 517 states this for f-numbers and for focal
// lengths).
constexpr double kNominalFocal = 0.05;
// Half of a third of a stop: a factor of 2^(1/12) in the f-number.
constexpr double kNominalFNumber = 0.06;
constexpr double kCoarseDistance = 0.1;  // encoders of focus rings
constexpr double kOtherDistance = 1.5;   // a factor
constexpr double kNominalPitch = 0.03, kOtherPitch = 0.1;
constexpr double kNominalField = 0.03, kOtherField = 0.15;
constexpr double kFullFrameDiagonalMm = 43.2666, kFullFrameWidthMm = 36;

// Returns half a unit of the last decimal digit of the number.
double RoundingOf(double value) {
  double unit = 1;
  for (int digits = 0; digits < 4; ++digits) {
    const double scaled = value / unit;
    if (std::abs(scaled - std::round(scaled)) < 1e-6) return unit / 2;
    unit /= 10;
  }
  return unit / 2;
}

double ToleranceOf(const model::Camera& camera, const std::string& field) {
  const auto found = camera.statements.find(field);
  return found == camera.statements.end() ? 0 : found->second.tolerance;
}

std::string WithTolerance(double value, double tolerance) {
  return tolerance > 0 ? fmt::format("{:.6g} +- {:.3g}", value, tolerance)
                       : fmt::format("{:.6g}", value);
}

// Returns how far a number lies outside an interval; 0 if it is inside.
double Outside(double value, double low, double high) {
  return std::max({0.0, low - value, value - high});
}

ExifComparison FocalLengthFinding(double exif_mm, const model::Camera& camera) {
  const model::ThickLens& lens = camera.lens;
  const auto [low_mm, high_mm] = std::minmax(lens.front_focal_length_mm, lens.rear_focal_length_mm);
  const double tolerance_mm = std::max(ToleranceOf(camera, "lens.front_focal_length_mm"),
                                       ToleranceOf(camera, "lens.rear_focal_length_mm"));
  const double off_mm = Outside(exif_mm, low_mm, high_mm) - RoundingOf(exif_mm) - tolerance_mm;
  ExifComparison finding{"focal length", fmt::format("{:.6g} mm", exif_mm),
                         low_mm == high_mm
                             ? WithTolerance(low_mm, tolerance_mm) + " mm"
                             : fmt::format("{} to {} mm", WithTolerance(low_mm, tolerance_mm),
                                           WithTolerance(high_mm, tolerance_mm)),
                         ExifComparison::Verdict::kAgrees, ""};
  if (off_mm <= 0) return finding;
  const bool may_be_nominal = tolerance_mm == 0 && off_mm <= kNominalFocal * high_mm;
  finding.verdict =
      may_be_nominal ? ExifComparison::Verdict::kUndecided : ExifComparison::Verdict::kContradicts;
  finding.remark = may_be_nominal
                       ? "EXIF has nominal values; a stated tolerance of the camera file decides"
                       : "a zoom at another setting, or another lens";
  return finding;
}

// F-numbers are set in steps of a third of a stop, so f/2 does not stand for all numbers from 1.5
// to 2.5.
double RoundingOfFNumber(double number) {
  return std::min(RoundingOf(number), number < 10 ? 0.05 : 0.5);
}

ExifComparison FNumberFinding(double exif_number, const model::Camera& camera) {
  const model::ThickLens& lens = camera.lens;
  const double number = lens.front_focal_length_mm / (2 * lens.aperture_radius_mm);
  const double tolerance =
      number * (ToleranceOf(camera, "lens.front_focal_length_mm") / lens.front_focal_length_mm +
                ToleranceOf(camera, "lens.aperture_radius_mm") / lens.aperture_radius_mm);
  const double off = std::abs(exif_number - number) - RoundingOfFNumber(exif_number) - tolerance;
  ExifComparison finding{"f-number", fmt::format("{:.4g}", exif_number),
                         fmt::format("{} (f1/(2 r))", WithTolerance(number, tolerance)),
                         ExifComparison::Verdict::kAgrees, ""};
  if (off <= 0) return finding;
  const bool is_near = off <= kNominalFNumber * number;
  finding.verdict =
      is_near ? ExifComparison::Verdict::kUndecided : ExifComparison::Verdict::kContradicts;
  finding.remark = is_near ? "f-numbers are marked in rounded steps"
                           : "the aperture setting differs from that of the calibration";
  return finding;
}

std::optional<ExifComparison> FocusDistanceFinding(double exif_mm, const model::Camera& camera) {
  if (!camera.calibration || !camera.calibration->image_distance_mm) return std::nullopt;
  const double zf_mm = camera.focus_depth_mm();
  const double far_mm = zf_mm + camera.image_distance_mm();
  const auto in_words = [](double mm) {
    return std::isinf(mm) ? std::string("infinity") : fmt::format("{:.5g} mm", mm);
  };
  ExifComparison finding{"focus distance", in_words(exif_mm),
                         fmt::format("{} (zf, from the aperture; {} from the sensor)",
                                     in_words(zf_mm), in_words(far_mm)),
                         ExifComparison::Verdict::kAgrees, ""};
  // A focus ring at infinity and a calibration at a large distance may be the same position.
  constexpr double kFarMm = 10000;
  if (std::isinf(exif_mm) || std::isinf(zf_mm)) {
    if (std::min(exif_mm, zf_mm) >= kFarMm) return finding;
    finding.verdict = ExifComparison::Verdict::kContradicts;
  } else {
    constexpr double kMmPerMetre = 1000;
    // Whole metres may be exact or rounded: a value that agrees only within half a metre of
    // rounding is left undecided.
    constexpr double kMaxRoundingMm = 50;
    const double whole_mm = kMmPerMetre * RoundingOf(exif_mm / kMmPerMetre);
    const double close_mm = exif_mm < kFarMm / 2 ? std::min(kMaxRoundingMm, whole_mm) : whole_mm;
    const auto lies_within = [&](double share_below, double share_above, double rounding_mm) {
      return Outside(exif_mm, zf_mm * share_below - rounding_mm,
                     far_mm * share_above + rounding_mm) == 0;
    };
    if (lies_within(1 - kCoarseDistance, 1 + kCoarseDistance, close_mm)) return finding;
    finding.verdict = lies_within(1 / kOtherDistance, kOtherDistance, whole_mm)
                          ? ExifComparison::Verdict::kUndecided
                          : ExifComparison::Verdict::kContradicts;
  }
  finding.remark =
      finding.verdict == ExifComparison::Verdict::kUndecided
          ? "cameras state the distance only roughly"
          : "the lens was focused at another distance than in the calibration, so d1 differs";
  return finding;
}

// Returns whether the image has the size that the camera made, or the size of the camera file's
// sensor.
bool IsOfSize(const io::PhotoExif& exif, int width_px, int height_px) {
  if (!exif.made_width_px || !exif.made_height_px) return true;
  const auto made = std::minmax(*exif.made_width_px, *exif.made_height_px);
  const auto here = std::minmax(width_px, height_px);
  return made == here;  // rotated or not
}

// Scaled pixels have a pitch that is larger by the same factor.
std::optional<ExifComparison> SizeFinding(const io::PhotoExif& exif, const model::Camera& camera,
                                          const PhotoSize& size) {
  if (!exif.made_width_px || !exif.made_height_px) return std::nullopt;
  const model::Sensor& sensor = camera.sensor;
  ExifComparison finding{"image size",
                         fmt::format("{} x {} px", *exif.made_width_px, *exif.made_height_px),
                         fmt::format("{} x {} px", sensor.width_px, sensor.height_px),
                         ExifComparison::Verdict::kAgrees, ""};
  const bool fits = size.is_part_of_sensor || IsOfSize(exif, size.width_px, size.height_px);
  if (fits || IsOfSize(exif, sensor.width_px, sensor.height_px)) return finding;
  const double across = static_cast<double>(*exif.made_width_px) / size.width_px;
  const double down = static_cast<double>(*exif.made_height_px) / size.height_px;
  const bool is_scaled = std::abs(across / down - 1) < 0.01;
  if (is_scaled && exif.made_pixel_pitch_mm &&
      std::abs(*exif.made_pixel_pitch_mm * across / sensor.pixel_pitch_mm - 1) <= kNominalPitch) {
    return finding;  // the camera file describes images scaled in the same way
  }
  finding.verdict = ExifComparison::Verdict::kUndecided;
  finding.remark = fmt::format(
      "the photograph of {} x {} px was {} after it was taken: the pixel pitch and principal point "
      "of the camera file must be those of such images",
      size.width_px, size.height_px,
      is_scaled ? fmt::format("scaled by 1/{:.4g}, or cropped,", across)
                : std::string("cropped or scaled"));
  return finding;
}

std::optional<ExifComparison> PitchFinding(const io::PhotoExif& exif, const model::Camera& camera) {
  if (!exif.pixel_pitch_mm) return std::nullopt;  // the size differs: SizeFinding reports it
  constexpr double kUmPerMm = 1000;
  const double pitch_mm = camera.sensor.pixel_pitch_mm;
  const double tolerance_mm = ToleranceOf(camera, "sensor.pixel_pitch_mm");
  ExifComparison finding{"pixel pitch", fmt::format("{:.4g} um", kUmPerMm * *exif.pixel_pitch_mm),
                         WithTolerance(kUmPerMm * pitch_mm, kUmPerMm * tolerance_mm) + " um",
                         ExifComparison::Verdict::kAgrees, ""};
  const double off = (std::abs(*exif.pixel_pitch_mm - pitch_mm) - tolerance_mm) / pitch_mm;
  if (off <= kNominalPitch) return finding;
  finding.verdict = off <= kOtherPitch ? ExifComparison::Verdict::kUndecided
                                       : ExifComparison::Verdict::kContradicts;
  finding.remark = finding.verdict == ExifComparison::Verdict::kUndecided
                       ? "EXIF may count pixels at the edge of the sensor that are not in images"
                       : "another sensor, or an image with other pixels";
  return finding;
}

// The ratio of the equivalent focal length to the focal length is that of the diagonals, or of the
// widths, of 36 x 24 mm and of the sensor: manufacturers use both.
std::optional<ExifComparison> FieldOfViewFinding(const io::PhotoExif& exif,
                                                 const model::Camera& camera,
                                                 const PhotoSize& size) {
  const model::Sensor& sensor = camera.sensor;
  if (!exif.focal_length_35mm || !exif.focal_length_mm || size.is_part_of_sensor ||
      !IsOfSize(exif, sensor.width_px, sensor.height_px)) {
    return std::nullopt;
  }
  const double width_mm = sensor.width_px * sensor.pixel_pitch_mm;
  const double height_mm = sensor.height_px * sensor.pixel_pitch_mm;
  const double by_diagonal = kFullFrameDiagonalMm / std::hypot(width_mm, height_mm);
  const double by_width = kFullFrameWidthMm / std::max(width_mm, height_mm);
  const double low = std::min(by_diagonal, by_width), high = std::max(by_diagonal, by_width);
  const double factor = *exif.focal_length_35mm / *exif.focal_length_mm;
  const double rounding =
      0.5 / *exif.focal_length_35mm + RoundingOf(*exif.focal_length_mm) / *exif.focal_length_mm;
  ExifComparison finding{
      "crop factor", fmt::format("{:.4g} ({:g} mm in 35 mm film)", factor, *exif.focal_length_35mm),
      fmt::format("{:.4g} (a sensor of {:.4g} x {:.4g} mm)", low, width_mm, height_mm),
      ExifComparison::Verdict::kAgrees, ""};
  const double off = Outside(factor, low, high) / factor - rounding;
  if (off <= kNominalField) return finding;
  finding.verdict = off <= kOtherField ? ExifComparison::Verdict::kUndecided
                                       : ExifComparison::Verdict::kContradicts;
  finding.remark = "another part of the sensor, another sensor, or another pixel pitch";
  return finding;
}

std::optional<ExifComparison> DigitalZoomFinding(const io::PhotoExif& exif) {
  constexpr double kNoZoom = 1.005;
  if (!exif.digital_zoom || *exif.digital_zoom <= kNoZoom) return std::nullopt;
  return ExifComparison{
      "digital zoom", fmt::format("{:.4g}", *exif.digital_zoom), "none stated",
      ExifComparison::Verdict::kUndecided,
      "the pixels are those of a cropped and enlarged image: the camera file must "
      "describe images with this zoom"};
}

std::optional<ExifComparison> OrientationFinding(const io::PhotoExif& exif) {
  if (exif.orientation == 1) return std::nullopt;
  return ExifComparison{
      "orientation", fmt::format("{}", exif.orientation), "as stored",
      ExifComparison::Verdict::kUndecided,
      "EXIF does not show whether photograph, depth map and principal point are rotated "
      "alike"};
}

}  // namespace

std::string ExifVerdictName(ExifComparison::Verdict verdict) {
  if (verdict == ExifComparison::Verdict::kAgrees) return "agrees";
  return verdict == ExifComparison::Verdict::kUndecided ? "undecided" : "contradicts";
}

std::vector<ExifComparison> CompareExif(const io::PhotoExif& exif, const Camera& camera,
                                        const PhotoSize& size) {
  std::vector<ExifComparison> findings;
  const auto add = [&](std::optional<ExifComparison> finding) {
    if (finding) findings.push_back(std::move(*finding));
  };
  // The lengths of an objective's lens are those of an equivalent, which no device states.
  const bool has_lengths = !camera.objective;
  if (has_lengths && exif.focal_length_mm) add(FocalLengthFinding(*exif.focal_length_mm, camera));
  if (has_lengths && exif.f_number) add(FNumberFinding(*exif.f_number, camera));
  if (has_lengths && exif.subject_distance_mm)
    add(FocusDistanceFinding(*exif.subject_distance_mm, camera));
  add(SizeFinding(exif, camera, size));
  add(PitchFinding(exif, camera));
  add(FieldOfViewFinding(exif, camera, size));
  add(DigitalZoomFinding(exif));
  add(OrientationFinding(exif));
  return findings;
}

}  // namespace thicklens

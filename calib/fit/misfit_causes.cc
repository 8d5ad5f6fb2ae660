#include "calib/fit/misfit_causes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace thicklens::calib {
namespace {

constexpr double kSignificant = 4;
constexpr double kMuchRemoved = 0.02;   // part of the field
constexpr double kMatters = 0.02;       // part of the sweep's length
constexpr double kAsStated = 1.5;       // times the stated error of the readings
constexpr double kClearlyBetter = 1.1;  // ratio of chi^2 with the two shapes of the blur
// Parts of the field are less certain than the whole, and their textures differ.
constexpr double kReach = 1.5;

double SweepLengthMm(const Calibration& calibration) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const FrameMeasurement& frame : calibration.frames) {
    if (!frame.in_blur_fit) continue;
    low = std::min(low, frame.reading_mm);
    high = std::max(high, frame.reading_mm);
  }
  return high - low;
}

}  // namespace

std::string CausesOfMisfit(const FocusSweep& sweep, const BlurEvidence& evidence,
                           const Calibration& calibration) {
  std::vector<std::string> causes;
  if (calibration.diagnostics.structure.HasBands()) causes.emplace_back("bands of the light");
  if (calibration.diagnostics.structure.HasFixedStructure())
    causes.emplace_back("structure that stays on the sensor");
  const FixedPattern& pattern = calibration.diagnostics.fixed_pattern;
  const double removed = pattern.divided_share + pattern.filled_share;
  if (removed > kMuchRemoved)
    causes.emplace_back(
        fmt::format("dust, or what was taken for it and removed on {:.2g} % of the "
                    "field",
                    100 * removed));
  const ScaleModel& scale = calibration.diagnostics.scale;
  // The image scale shows the readings' errors without the blur.
  const bool readings_are_as_stated = scale.done && sweep.reading_sigma_mm > 0 &&
                                      scale.reading_rms_mm < kAsStated * sweep.reading_sigma_mm;
  if (!readings_are_as_stated) causes.emplace_back("readings worse than stated");
  if (scale.kind == ScaleKind::kConstant)
    causes.emplace_back("borders that were filled in when the frames were aligned");
  causes.emplace_back(evidence.axial ? "other aberrations than the astigmatism"
                                     : "an aberrated or astigmatic lens");
  causes.emplace_back("sharpened or compressed images");
  causes.emplace_back("a wrong sensor.transfer");
  const bool is_gaussian = sweep.camera.psf == model::Psf::kGaussian;
  const auto& stated = is_gaussian ? evidence.gaussian_misfit : evidence.disc_misfit;
  const auto& other = is_gaussian ? evidence.disc_misfit : evidence.gaussian_misfit;
  if (!stated || !other || !(*other > kClearlyBetter * *stated))
    causes.emplace_back("another shape of the blur");
  std::string words =
      fmt::format("{} or {} may be the cause, and this sweep does not distinguish these causes",
                  fmt::join(causes.begin(), causes.end() - 1, ", "), causes.back());
  if (readings_are_as_stated)
    words += fmt::format(
        " (the readings are not the cause: they scatter by only {:.2g} mm about the image scale)",
        scale.reading_rms_mm);
  return words;
}

bool IsAstigmatic(const Calibration& calibration) {
  const FieldMap& field = calibration.diagnostics.field;
  const auto& astigmatism = field.astigmatism_mm;
  return astigmatism && field.along_x && field.along_y &&
         std::abs(astigmatism->value) >
             std::max(kSignificant * astigmatism->sigma, kMatters * SweepLengthMm(calibration));
}

std::string AstigmatismInWords(const Calibration& calibration) {
  if (!IsAstigmatic(calibration)) return "";
  const FieldMap& field = calibration.diagnostics.field;
  const model::Estimate& astigmatism = *field.astigmatism_mm;
  const model::Estimate& x = field.along_x->focus_depth_mm;
  const model::Estimate& y = field.along_y->focus_depth_mm;
  return fmt::format(
      "the blur along x is smallest at a depth of {:.2f} +- {:.2g} mm (kappa {:.3f}) and the blur "
      "along y at {:.2f} +- {:.2g} mm (kappa {:.3f}), {:.3g} +- {:.2g} mm {}: the lens is "
      "astigmatic, or the texture along x has other depths than the texture along y (turn the "
      "target by 90 degrees: only an effect of the lens stays the same). {}",
      x.value, x.sigma, field.along_x->blur_ratio.value, y.value, y.sigma,
      field.along_y->blur_ratio.value, std::abs(astigmatism.value), astigmatism.sigma,
      astigmatism.value < 0 ? "farther" : "nearer",
      calibration.diagnostics.blur.astigmatic_blur_px > 0
          ? "zf, d1 and kappa are those of the mean of both variances: zf is the medial focus, "
            "where "
            "the blur is the same along x and along y"
          : "One blur law does not describe both directions; the intervals of zf, d1 and kappa "
            "include the middle between both depths and both kappa");
}

std::string FieldAstigmatismInWords(const Calibration& calibration) {
  const auto& corner = calibration.diagnostics.field.field_astigmatism_mm;
  if (!corner || !(std::abs(corner->value) >
                   std::max(kSignificant * corner->sigma, kMatters * SweepLengthMm(calibration))))
    return "";
  return fmt::format(
      "the lens has field astigmatism: in the corner of the image the blur along the tangent is "
      "smallest {:.3g} +- {:.2g} mm {} than the blur along the radius. A tilted target is not the "
      "cause: it displaces both alike. One blur law does not describe both directions; the "
      "intervals of zf, d1 and kappa include the middle between both foci and both kappa, and a "
      "smaller roi_px in the middle of the field avoids it",
      std::abs(corner->value), corner->sigma, corner->value > 0 ? "farther" : "nearer");
}

bool AstigmatismExplains(double spread_mm, const Calibration& calibration) {
  return IsAstigmatic(calibration) &&
         spread_mm < kReach * std::abs(calibration.diagnostics.field.astigmatism_mm->value);
}

}  // namespace thicklens::calib

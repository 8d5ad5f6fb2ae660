#include "calib/registration/radial_causes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>

#include "calib/registration/frame_structure.h"

namespace thicklens::calib {
namespace {

// Relative change of the image height at the corner.
constexpr double kWorthReporting = 0.005, kGross = 0.05;
constexpr double kSignificant = 4;
// One standard deviation for photographic lenses. A distortion of 40 % is beyond any lens that
// forms a plain image.
constexpr double kLensDeviation = 0.1;

// All causes give the same displacements, to first order k (s - 1). They differ only in the other
// effects that each of them would show, which were looked for.
Diagnosis Compare(const model::Estimate& distortion, const FrameStructureFinding& structure) {
  Diagnosis diagnosis;
  diagnosis.symptom = "radial displacement of the frames against one another";
  diagnosis.chi2_of_none = std::pow(distortion.value / distortion.sigma, 2);
  const double as_lens = std::pow(distortion.value / kLensDeviation, 2);
  diagnosis.causes.push_back({kLensDistorts, std::min(as_lens, diagnosis.chi2_of_none)});
  diagnosis.causes.push_back({kTargetIsNotFlat, 0});
  if (!VignettingIsExcluded(structure)) diagnosis.causes.push_back({kVignettingShifts, 0});
  if (!FixedStructureIsExcluded(structure)) diagnosis.causes.push_back({kFixedStructureShifts, 0});
  SortCauses(&diagnosis);
  diagnosis.separates =
      "a flat target and frames divided by a photograph of an evenly lit white sheet leave the "
      "lens "
      "alone";
  return diagnosis;
}

// Names the structure that this sweep is too small or too short to show.
std::string OcclusionText(const FrameStructureFinding& structure) {
  const bool vignetting = !VignettingIsExcluded(structure);
  const bool fixed = !FixedStructureIsExcluded(structure);
  if (!vignetting && !fixed) return "";
  return fmt::format(". {} would do the same, and this sweep does not show whether there is any",
                     vignetting && fixed
                         ? "Vignetting, or structure that stays on the sensor (dust),"
                     : vignetting ? "Vignetting"
                                  : "Structure that stays on the sensor (dust)");
}

std::string CausesInWords(const Diagnosis& diagnosis, const FrameStructureFinding& structure) {
  const std::string seen = StructureInWords(structure);
  if (!seen.empty()) {
    return fmt::format(
        "{}. That draws the registrations in the same way. If it is not the cause, {}", seen,
        diagnosis.Names(kLensDistorts)
            ? "the lens distorts (undistort the images), or the target is not flat"
            : "the target is not flat: no lens distorts so much");
  }
  const std::string hidden = OcclusionText(structure);
  if (!diagnosis.Names(kLensDistorts)) {
    return "no lens distorts so much: the target is not flat (what is nearer moves more), or the "
           "frames do not show one and the same target; photograph a flat one" +
           hidden;
  }
  return "the lens distorts, or the target is not flat (what is nearer moves more), which look "
         "alike; a flat target tells them apart. If it is flat, undistort the images" +
         hidden;
}

}  // namespace

bool ShowsDistortion(const Calibration& calibration) {
  const auto& distortion = calibration.scale.distortion_at_corner;
  return distortion &&
         std::abs(distortion->value) > std::max(kWorthReporting, kSignificant * distortion->sigma);
}

std::optional<std::string> CheckDistortion(Calibration* calibration) {
  if (!ShowsDistortion(*calibration)) return std::nullopt;
  const model::Estimate& distortion = *calibration->scale.distortion_at_corner;
  Diagnosis diagnosis = Compare(distortion, calibration->structure);
  const std::string found = fmt::format(
      "the frames lie against one another as distorted images do, {:+.1f} +- {:.1f} % at the "
      "corner ({}): {}",
      100 * distortion.value, 100 * distortion.sigma,
      distortion.value > 0 ? "pincushion" : "barrel",
      CausesInWords(diagnosis, calibration->structure));
  calibration->diagnoses.push_back(std::move(diagnosis));
  if (std::abs(distortion.value) > kGross) return found;
  calibration->warnings.push_back(found +
                                  ". Depth and blur are those of an undistorted camera and a flat "
                                  "target");
  return std::nullopt;
}

std::string NonlinearityRemedy(const FrameStructureFinding& structure) {
  return structure.HasVignetting() || structure.HasFixedStructure()
             ? "measure offset_mm, divide the frames by a photograph of an evenly lit white sheet"
             : "measure offset_mm, check the rail's scale, undistort the images";
}

std::string NonlinearityText(const ScaleNonlinearity& nonlinearity,
                             const Calibration& calibration) {
  const std::string seen = StructureInWords(calibration.structure);
  const std::string causes =
      seen.empty()
          ? std::string(
                "The rail's scale is not linear, the images are distorted, the target is not "
                "flat, "
                "or "
                "the lens breathes; these look alike. A rail of known steps (a micrometer screw) "
                "tells "
                "the first of them from the others") +
                OcclusionText(calibration.structure)
          : fmt::format(
                "{}{}. That draws the image scale. If it is not the cause, the rail's scale is not "
                "linear, the images are distorted, the target is not flat, or the lens breathes",
                static_cast<char>(std::toupper(seen[0])), seen.substr(1));
  return fmt::format(
      "the readings bend against the image scale: in the middle of the sweep they lie {:+.2f} +- "
      "{:.2f} mm off the straight line through its ends. {}. A bench zero from the image scale is "
      "then less certain than its error says: the farther half of the sweep alone puts it {:+.1f} "
      "mm from where the nearer half does",
      nonlinearity.bow_mm.value, nonlinearity.bow_mm.sigma, causes, nonlinearity.zero_spread_mm);
}

}  // namespace thicklens::calib

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
// Registrations of simulated astigmatic sweeps show up to 6 %.
constexpr double kMaxByAstigmatism = 0.15;
// One standard deviation for photographic lenses. A distortion of 40 % is beyond any lens that
// forms a plain image.
constexpr double kLensDeviation = 0.1;

// All causes give the same displacements, to first order k (s - 1). They differ only in the other
// effects that each of them would show, which were looked for.
Diagnosis Compare(const model::Estimate& distortion, const FrameStructureFinding& structure,
                  bool is_astigmatic) {
  Diagnosis diagnosis;
  diagnosis.symptom = "radial displacement of the frames against one another";
  diagnosis.chi2_of_none = std::pow(distortion.value / distortion.sigma, 2);
  const double as_lens = std::pow(distortion.value / kLensDeviation, 2);
  diagnosis.causes.push_back({kLensDistorts, std::min(as_lens, diagnosis.chi2_of_none)});
  diagnosis.causes.push_back({kTargetIsNotFlat, 0});
  if (!VignettingIsExcluded(structure)) diagnosis.causes.push_back({kVignettingShifts, 0});
  if (!FixedStructureIsExcluded(structure)) diagnosis.causes.push_back({kFixedStructureShifts, 0});
  if (is_astigmatic) diagnosis.causes.push_back({kAstigmatismShifts, 0});
  SortCauses(&diagnosis);
  diagnosis.separates =
      is_astigmatic
          ? "with a smaller aperture the astigmatism is smaller, but a distortion is not"
          : "with a flat target and frames divided by a photograph of an evenly lit white sheet, "
            "only the lens remains as the cause";
  return diagnosis;
}

// Names the structure that this sweep is too small or too short to show.
std::string OcclusionText(const FrameStructureFinding& structure) {
  const bool vignetting = !VignettingIsExcluded(structure);
  const bool fixed = !FixedStructureIsExcluded(structure);
  if (!vignetting && !fixed) return "";
  return fmt::format(
      ". {} would have the same effect, and this sweep does not show whether this is present",
      vignetting && fixed ? "Vignetting, or structure that stays on the sensor (dust),"
      : vignetting        ? "Vignetting"
                          : "Structure that stays on the sensor (dust)");
}

// The lens as a cause. Frames from which a stated distortion was taken out show the rest.
std::string LensInWords(bool is_undistorted) {
  return is_undistorted ? "the lens still distorts after its stated distortion was taken out "
                          "(which depends on "
                          "focus and zoom and must be measured at those of the sweep)"
                        : "the lens distorts";
}

constexpr char kRemedy[] =
    "state the distortion of the lens by calibrate --distortion FILE, or undistort the images by "
    "thicklens undistort";

std::string CausesInWords(const Diagnosis& diagnosis, const FrameStructureFinding& structure,
                          bool is_undistorted) {
  const std::string seen = StructureInWords(structure);
  if (diagnosis.Names(kAstigmatismShifts)) {
    return "the blur along x changes against the blur along y from one end of the sweep to the "
           "other, as an astigmatic lens makes it, and this has the same effect. If it is not the "
           "cause, the lens distorts, or the target is not flat; a smaller aperture makes the "
           "astigmatism smaller, but not a distortion" +
           (seen.empty() ? OcclusionText(structure) : ". Besides, " + seen);
  }
  if (!seen.empty()) {
    return fmt::format(
        "{}. This displaces the registrations in the same way. If it is not the cause, {}", seen,
        diagnosis.Names(kLensDistorts)
            ? LensInWords(is_undistorted) +
                  (is_undistorted ? std::string() : fmt::format(" ({})", kRemedy)) +
                  ", or the target is not flat"
            : std::string("the target is not flat: no lens distorts so much"));
  }
  const std::string hidden = OcclusionText(structure);
  if (!diagnosis.Names(kLensDistorts)) {
    return "no lens distorts so much: the target is not flat (nearer parts move more), or the "
           "frames do not all show the same target; photograph a flat target" +
           hidden;
  }
  return LensInWords(is_undistorted) +
         ", or the target is not flat (nearer parts move more); these look alike, and a flat "
         "target "
         "distinguishes them" +
         (is_undistorted ? std::string() : fmt::format(". If the target is flat, {}", kRemedy)) +
         hidden;
}

}  // namespace

bool ShowsDistortion(const Calibration& calibration) {
  const auto& distortion = calibration.diagnostics.scale.distortion_at_corner;
  return distortion &&
         std::abs(distortion->value) > std::max(kWorthReporting, kSignificant * distortion->sigma);
}

std::optional<std::string> CheckDistortion(Calibration* calibration, bool is_astigmatic,
                                           bool is_undistorted) {
  if (!ShowsDistortion(*calibration)) return std::nullopt;
  const model::Estimate& distortion = *calibration->diagnostics.scale.distortion_at_corner;
  is_astigmatic = is_astigmatic && std::abs(distortion.value) < kMaxByAstigmatism;
  Diagnosis diagnosis = Compare(distortion, calibration->diagnostics.structure, is_astigmatic);
  const std::string found = fmt::format(
      "the frames are displaced against one another like distorted images, {:+.1f} +- {:.1f} % at "
      "the corner ({}): {}",
      100 * distortion.value, 100 * distortion.sigma,
      distortion.value > 0 ? "pincushion" : "barrel",
      CausesInWords(diagnosis, calibration->diagnostics.structure, is_undistorted));
  calibration->diagnostics.diagnoses.push_back(std::move(diagnosis));
  if (std::abs(distortion.value) > kGross && !is_astigmatic) return found;
  calibration->summary.warnings.push_back(
      found + ". The depth and the blur assume an undistorted camera and a flat target");
  return std::nullopt;
}

std::string NonlinearityRemedy(const FrameStructureFinding& structure) {
  return structure.HasVignetting() || structure.HasFixedStructure()
             ? "measure offset_mm, divide the frames by a photograph of an evenly lit white sheet"
             : "measure offset_mm, check the rail's scale, undistort the images (thicklens "
               "undistort)";
}

std::string NonlinearityText(const ScaleNonlinearity& nonlinearity,
                             const Calibration& calibration) {
  const std::string seen = StructureInWords(calibration.diagnostics.structure);
  const std::vector<std::string>& warnings = calibration.summary.warnings;
  const bool is_named =
      !seen.empty() &&
      std::any_of(warnings.begin(), warnings.end(), [&seen](const std::string& warning) {
        return warning.find(seen) != std::string::npos;
      });
  const std::string causes =
      is_named ? std::string(
                     "The structure fixed to the frame, named above, biases the image scale. If it "
                     "is not the cause, the rail's scale is not linear, the images are distorted, "
                     "the target is not flat, or the lens breathes")
      : seen.empty()
          ? std::string(
                "The rail's scale is not linear, the images are distorted, the target is not flat, "
                "or the lens breathes; these look alike. A rail of known steps (a micrometer "
                "screw) distinguishes the first of these causes from the others") +
                OcclusionText(calibration.diagnostics.structure)
          : fmt::format(
                "{}{}. This biases the image scale. If it is not the cause, the rail's scale is "
                "not linear, the images are distorted, the target is not flat, or the lens "
                "breathes",
                static_cast<char>(std::toupper(seen[0])), seen.substr(1));
  return fmt::format(
      "the readings bend against the image scale: in the middle of the sweep they deviate by "
      "{:+.2f} +- {:.2f} mm from the straight line through its ends. {}. A bench offset from the "
      "image scale is then less certain than its stated error: the bench offset from the farther "
      "half of the sweep differs by {:+.1f} mm from that of the nearer half",
      nonlinearity.bow_mm.value, nonlinearity.bow_mm.sigma, causes, nonlinearity.zero_spread_mm);
}

}  // namespace thicklens::calib

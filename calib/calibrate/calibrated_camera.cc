// The camera with what a calibration has found, as it is written.
#include <algorithm>
#include <filesystem>

#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/frame_checks.h"

namespace thicklens::calib {
namespace {

// Returns the file's name as in the table of readings, without its directory on this machine.
std::string FileName(const std::string& image) {
  return std::filesystem::path(image).filename().string();
}

}  // namespace

model::Camera CalibratedCamera(const model::Camera& camera, const Calibration& calibration,
                               bool use_source_recipe) {
  model::Camera result = camera;
  model::CameraCalibration found;
  if (calibration.diagnostics.grid.distortion_is_used)
    result.distortion = calibration.diagnostics.grid.lens;
  found.evidence.undistorted = result.distortion.has_value();
  found.evidence.frames_used = calibration.summary.frames_used;
  for (const FrameMeasurement& frame : calibration.frames) {
    if (!frame.rejection.empty())
      // The numbers of the reason are in the report: the file is for the values.
      found.evidence.frames_rejected.push_back(
          {FileName(frame.image), FailedCheck(frame.rejection)});
  }
  const auto estimate = [](const std::optional<Result>& r) -> std::optional<model::Estimate> {
    if (!r) return std::nullopt;
    return model::Estimate{r->value, r->sigma};
  };
  // Where the lens or the sensor moves, the zero of its scale is no depth.
  if (!model::MovesFocus(calibration.diagnostics.moves))
    found.bench_offset_mm = estimate(calibration.summary.bench_offset_mm);
  found.focus_positions = calibration.diagnostics.focus_positions;
  if (use_source_recipe) {
    found.evidence.method = "source-recipe";
    found.image_distance_mm =
        model::Estimate{calibration.diagnostics.paper_recipe.image_distance_mm, 0};
    found.blur_ratio = model::Estimate{calibration.diagnostics.paper_recipe.blur_ratio, 0};
    found.evidence.focus_depth_mm =
        model::Estimate{calibration.diagnostics.paper_recipe.focus_depth_mm, 0};
  } else {
    found.evidence.method = "joint-blur-fit";
    const auto& left_open = calibration.diagnostics.blur.undetermined;
    const auto is_fixed = [&](const char* name) {
      return std::find(left_open.begin(), left_open.end(), name) == left_open.end();
    };
    if (is_fixed("image_distance_mm"))
      found.image_distance_mm = estimate(calibration.summary.image_distance_mm);
    if (is_fixed("blur_ratio")) found.blur_ratio = estimate(calibration.summary.blur_ratio);
    if (is_fixed("blur_floor_px"))
      found.blur_floor_px = estimate(calibration.summary.blur_floor_px);
    found.covariance_order = calibration.diagnostics.covariance_order;
    found.covariance = calibration.diagnostics.covariance;
    found.evidence.focus_depth_mm = estimate(calibration.summary.focus_depth_mm);
    found.evidence.chi2_per_dof = calibration.diagnostics.blur.chi2_per_dof;
    found.evidence.blur_family = model::PsfName(calibration.diagnostics.blur.family);
    found.evidence.blur_band = calibration.diagnostics.blur.band;
  }
  result.calibration = found;
  return result;
}

}  // namespace thicklens::calib

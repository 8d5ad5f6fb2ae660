#include "calib/calibrate/recognised_target.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>

#include "calib/edges/lone_edge.h"
#include "calib/registration/spot_moments.h"

namespace thicklens::calib {
namespace {

constexpr double kPointsContrast = 0.02;  // QualityCheckOptions::min_relative_contrast of points

// The frame with the steepest gradients over its mean; none where no frame has light.
int SharpestFrame(const std::vector<FrameMeasurement>& frames) {
  int sharpest = -1;
  double steepest = 0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const FrameStatistics& s = frames[i].statistics;
    if (!(s.mean_linear > 0) || !(s.top_gradient / s.mean_linear > steepest)) continue;
    steepest = s.top_gradient / s.mean_linear;
    sharpest = static_cast<int>(i);
  }
  return sharpest;
}

}  // namespace

void RecogniseTarget(const std::function<cv::Mat(std::size_t)>& read_grey, FocusSweep* sweep,
                     Calibration* calibration) {
  const bool is_open = sweep->target == model::SweepTarget::kAuto;
  if (!is_open && sweep->target != model::SweepTarget::kTexture) return;
  const int sharpest = SharpestFrame(calibration->frames);
  if (sharpest < 0) return;
  const cv::Mat grey = read_grey(static_cast<std::size_t>(sharpest));
  if (ShowsLoneEdge(grey)) {
    sweep->target = model::SweepTarget::kPrintedEdge;
    calibration->summary.warnings.push_back(fmt::format(
        "the frames show one straight edge and nothing else{}: it is measured as target: "
        "printed-edge; state target: knife-edge if it has no softness of its own",
        is_open ? "" : ", though target: texture is stated"));
    return;
  }
  if (!is_open) return;
  const SpotPattern spots = FindSpots(grey);
  if (!spots.done || !spots.is_nothing_else) return;
  sweep->target = model::SweepTarget::kPoints;
  calibration->summary.warnings.push_back(fmt::format(
      "the frames show {} {} points and nothing else: they are measured as target: points; state "
      "target: texture to have their spectra measured instead",
      spots.centres_px.size(), spots.are_bright ? "bright" : "dark"));
}

QualityCheckOptions ChecksFor(model::SweepTarget target, QualityCheckOptions checks) {
  checks.edge_target |=
      target == model::SweepTarget::kKnifeEdge || target == model::SweepTarget::kPoints;
  if (target == model::SweepTarget::kPoints)
    checks.min_relative_contrast = std::min(checks.min_relative_contrast, kPointsContrast);
  return checks;
}

bool IsSparse(model::SweepTarget target) {
  return target == model::SweepTarget::kKnifeEdge || target == model::SweepTarget::kPrintedEdge ||
         target == model::SweepTarget::kPoints;
}

}  // namespace thicklens::calib

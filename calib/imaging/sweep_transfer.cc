#include "thicklens/calib/sweep_transfer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "thicklens/base/cancel.h"
#include "thicklens/base/parallel.h"
#include "thicklens/calib/blur_model.h"
#include "thicklens/model/blur_transfer.h"
#include "thicklens/model/conjugates.h"

namespace thicklens::calib {
namespace {

constexpr int kMaxEdges = 12;
constexpr char kEdgeEstimator[] = "edges";

void FindLevels(FrameTransfer* frame) {
  frame->mtf50 = FrequencyAtLevel(frame->curve, 0.5);
  frame->mtf10 = FrequencyAtLevel(frame->curve, 0.1);
}

// The transfer of floor, defocus and pixel along the rows [D31]. Beyond the first zero of a disc
// the transfer is negative (the contrast is reversed); the MTF is its modulus.
FrameTransfer Modelled(model::Psf psf, double floor_px, double defocus_px) {
  FrameTransfer frame;
  frame.curve.frequency_per_px = TransferFrequencies();
  for (const double f : frame.curve.frequency_per_px) {
    frame.curve.transfer.push_back(std::abs(model::GaussianTransfer(floor_px, f, 0) *
                                            model::DefocusTransfer(psf, defocus_px, f, 0) *
                                            model::PixelBoxTransfer(f, 0)));
  }
  FindLevels(&frame);
  return frame;
}

FrameTransfer ModelledAt(const FocusSweep& sweep, const BlurModel& law, double floor_px,
                         double depth_mm) {
  const double sigma_px = law.SigmaPx(depth_mm);
  return Modelled(sweep.camera.psf, floor_px,
                  std::sqrt(std::max(0.0, sigma_px * sigma_px - floor_px * floor_px)));
}

std::optional<FrameTransfer> Measured(const FocusSweep& sweep, std::size_t index) {
  const cv::Mat grey = LinearGrey(sweep.read_frame(index), sweep, index);
  const std::vector<SlantedEdgeResult> edges = MeasureSlantedEdges(grey, kMaxEdges);
  if (edges.empty()) return std::nullopt;
  FrameTransfer frame;
  frame.is_measured = true;
  frame.edges = static_cast<int>(edges.size());
  frame.curve = MeanCurve(edges);
  FindLevels(&frame);
  return frame;
}

bool HasEdges(const FocusSweep& sweep, const Calibration& calibration) {
  return sweep.target == model::SweepTarget::kKnifeEdge ||
         sweep.target == model::SweepTarget::kPrintedEdge ||
         calibration.diagnostics.blur.estimator == kEdgeEstimator;
}

}  // namespace

TransferUnits TransferUnitsOf(const model::Camera& camera) {
  TransferUnits units;
  units.sensor_lp_per_mm = 1 / camera.sensor.pixel_pitch_mm;
  if (!camera.calibration || !camera.calibration->image_distance_mm) return units;
  const double zf_mm = camera.focus_depth_mm();
  if (std::isfinite(zf_mm)) {
    units.object_lp_per_mm =
        units.sensor_lp_per_mm * model::MagnificationAtFocus(camera.lens, zf_mm);
  }
  return units;
}

SweepTransfer MeasureSweepTransfer(const FocusSweep& sweep, const Calibration& calibration,
                                   int threads) {
  SweepTransfer found;
  const std::optional<BlurModel> law = BlurModel::Of(sweep, calibration);
  const bool has_focus = law && calibration.summary.focus_depth_mm &&
                         IsDepth(calibration.summary.focus_depth_mm->value);
  double floor_px = 0;
  if (has_focus) {
    const double zf_mm = calibration.summary.focus_depth_mm->value;
    floor_px = law->SigmaPx(zf_mm);
    found.at_focus = ModelledAt(sweep, *law, floor_px, zf_mm);
  }
  const bool has_edges = HasEdges(sweep, calibration);
  std::vector<std::optional<FrameTransfer>> frames(calibration.frames.size());
  ParallelFor(static_cast<int>(frames.size()), threads, [&](int i) {
    const auto index = static_cast<std::size_t>(i);
    const FrameMeasurement& frame = calibration.frames[index];
    if (!frame.rejection.empty()) return;
    if (has_edges) frames[index] = Measured(sweep, index);
    if (!frames[index] && has_focus && IsDepth(frame.depth_mm))
      frames[index] = ModelledAt(sweep, *law, floor_px, frame.depth_mm);
    if (frames[index]) frames[index]->frame = index;
  });
  for (std::optional<FrameTransfer>& frame : frames) {
    if (frame) found.frames.push_back(std::move(*frame));
  }
  found.done = !found.frames.empty();
  found.message = found.done  ? "done"
                  : has_edges ? "no frame shows a slanted edge, and no blur was fitted"
                              : "the target has no slanted edge, and no blur was fitted";
  return found;
}

}  // namespace thicklens::calib

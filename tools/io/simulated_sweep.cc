#include "thicklens/io/simulated_sweep.h"

#include <cmath>
#include <cstdint>

#include "thicklens/io/image_io.h"
#include "thicklens/model/scene.h"

namespace thicklens::io {
namespace {

model::SweepTarget SweepTargetOf(model::TargetKind kind) {
  switch (kind) {
    case model::TargetKind::kPrintedEdge:
      return model::SweepTarget::kPrintedEdge;
    case model::TargetKind::kKnifeEdge:
      return model::SweepTarget::kKnifeEdge;
    case model::TargetKind::kPinholes:
    case model::TargetKind::kBeads:
      return model::SweepTarget::kPoints;
    default:
      return model::SweepTarget::kTexture;
  }
}

}  // namespace

// Image files of unknown origin are assumed to be sRGB, as a screen would show them.
model::LinearImage ReadTargetImage(const model::TargetOptions& target) {
  if (target.kind != model::TargetKind::kImage) return {};
  const model::EncodedImage stored = ToEncodedImage(ReadImageFile(target.image_path));
  return model::ToGrey(model::ToLinear(stored, model::TransferCurve::Srgb()));
}

model::SweepFile DescribeSweep(const model::SweepSimulationOptions& simulation,
                               const model::SweepSimulator& simulator, bool unknown_offset) {
  const model::SweepTruth& truth = simulator.truth();
  model::SweepFile sweep;
  sweep.target_grid = simulation.target.grid;
  sweep.camera_path = "camera.yaml";
  if (simulator.effects().on.Has(model::Effect::kReadingError)) {
    sweep.reading_sigma_mm = simulation.reading_sigma_mm;
  }
  sweep.reading_sigma_stated = true;
  if (simulation.counts_per_mm > 0) {
    sweep.readings_are_counts = true;
    // A whole count differs from the position by up to half of one.
    constexpr double kVarianceOfRounding = 1.0 / 12;
    sweep.reading_sigma_mm = std::hypot(sweep.reading_sigma_mm * simulation.counts_per_mm,
                                        std::sqrt(kVarianceOfRounding));
    if (!unknown_offset) sweep.focus_depth_mm = model::Estimate{truth.focus_depth_mm, 0};
  } else if (!unknown_offset) {
    sweep.offset_mm = model::Estimate{simulation.bench_offset_mm, 0};
  }
  sweep.direction = simulation.direction;
  if (simulation.moves != model::SweepMotion::kTarget) sweep.moves = simulation.moves;
  sweep.target = SweepTargetOf(simulation.target.kind);
  for (const model::SweepTruth::Frame& frame : truth.frames)
    sweep.frames.push_back({frame.image, frame.reading_mm});
  return sweep;
}

cv::Mat AsFile(const model::EncodedImage& image) {
  const cv::Mat values(image.height_px, image.width_px, CV_16UC(image.channels),
                       const_cast<std::uint16_t*>(image.values.data()));  // NOLINT: only read
  cv::Mat file;
  values.convertTo(file, image.bits == 8 ? CV_8U : CV_16U);
  return file;
}

}  // namespace thicklens::io

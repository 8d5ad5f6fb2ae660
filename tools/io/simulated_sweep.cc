#include "thicklens/io/simulated_sweep.h"

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
    default:
      return model::SweepTarget::kTexture;
  }
}

}  // namespace

// Picture files of unknown origin are assumed to be sRGB, as a screen would show them.
model::LinearPicture ReadTargetPicture(const model::TargetOptions& target) {
  if (target.kind != model::TargetKind::kPicture) return {};
  const model::StoredPicture stored = ToStoredPicture(ReadPictureFile(target.picture_path));
  return model::ToGrey(model::ToLinear(stored, model::TransferCurve::Srgb()));
}

model::SweepFile DescribeSweep(const model::SweepSimulationOptions& simulation,
                               const model::SweepSimulator& simulator, bool unknown_offset) {
  const model::SweepTruth& truth = simulator.truth();
  model::SweepFile sweep;
  sweep.camera_path = "camera.yaml";
  if (simulator.effects().on.Has(model::Effect::kReadingError)) {
    sweep.reading_sigma_mm = simulation.reading_sigma_mm;
  }
  sweep.reading_sigma_stated = true;
  if (!unknown_offset) sweep.offset_mm = model::Estimate{simulation.bench_offset_mm, 0};
  sweep.direction = simulation.direction;
  sweep.target = SweepTargetOf(simulation.target.kind);
  for (const model::SweepTruth::Frame& frame : truth.frames)
    sweep.frames.push_back({frame.image, frame.reading_mm});
  return sweep;
}

cv::Mat AsFile(const model::StoredPicture& picture) {
  const cv::Mat values(picture.height_px, picture.width_px, CV_16UC(picture.channels),
                       const_cast<std::uint16_t*>(picture.values.data()));  // NOLINT: only read
  cv::Mat file;
  values.convertTo(file, picture.bits == 8 ? CV_8U : CV_16U);
  return file;
}

}  // namespace thicklens::io

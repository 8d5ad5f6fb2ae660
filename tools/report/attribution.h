#ifndef THICKLENS_TOOLS_REPORT_ATTRIBUTION_H_
#define THICKLENS_TOOLS_REPORT_ATTRIBUTION_H_

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/estimator/compare.h"
#include "thicklens/model/effect_choice.h"
#include "thicklens/model/scene_simulator.h"
#include "thicklens/model/sweep_simulator.h"
#include "tools/report/picture_change.h"

namespace thicklens::tools {

// The change that each effect of image formation causes, found by removing the effect from a
// simulation that has all others: in the images, in the calibration from them, and in the estimate
// from them.

// The difference between two images, for display. Its unit is grey levels of stored values.
struct DifferencePicture {
  int width_px = 0, height_px = 0;
  std::vector<float> grey_levels;  // without the effect minus with it; empty: none
  std::string of;                  // "the picture", "frame 3, at 250 mm"
};

struct AttributedEffect {
  model::Effect effect = model::Effect::kDefocus;
  // The effect does not occur, so it was not simulated again.
  bool absent = false;
  double bound_grey_levels = 0;  // bound of its change; for noise its standard deviation
  bool kept_by_auto = true;
  PictureChange picture;  // over all frames of a sweep together
  DifferencePicture difference;
  double picture_seconds = 0;  // simulation time without the effect
};

// ---- Attribution for an image of a scene and the light field that is estimated from it.

struct SceneEffect : AttributedEffect {
  // Mean PSNR of the estimated views against the true ones, minus that with all effects, if the
  // photograph and the scene lack the effect.
  double light_field_db = 0;
  // This difference if the photograph has the effect and the estimate ignores it. Absent for
  // effects that an estimate does not model or cannot leave out. Without defocus the estimate is
  // the photograph warped by its depth.
  std::optional<double> ignored_db;
  double estimate_seconds = 0;
};

struct SceneAttribution {
  model::EffectSet on;  // effects of the scene that is the reference
  int u_count = 0, v_count = 0;
  double light_field_psnr_db = 0;
  double picture_seconds = 0, estimate_seconds = 0;
  double sampling_error_grey_levels = 0;  // rms, where it is largest
  std::vector<SceneEffect> effects;
  model::StoredPicture picture;
};

// ---- Attribution for a sweep and the calibration from it.

struct CalibratedValues {
  double image_distance_mm = 0, image_distance_sigma_mm = 0;
  double blur_ratio = 0, blur_ratio_sigma = 0;
};

struct SweepEffect : AttributedEffect {
  // Absent: the calibration was refused for the reason in `refusal`.
  std::optional<CalibratedValues> calibration;
  std::string refusal;
  double calibration_seconds = 0;
};

struct SweepAttribution {
  model::EffectSet on;
  int frames = 0;
  double true_image_distance_mm = 0, true_blur_ratio = 0;
  CalibratedValues calibration;
  double picture_seconds = 0, calibration_seconds = 0;
  std::vector<SweepEffect> effects;
};

// How attributions run. `progress` may throw to stop; it is called often, from several threads at
// once.
struct AttributionRun {
  int threads = 0;  // 0: one per core
  std::function<void(int done, int total)> progress;
};

// `pixels` are as in SceneSimulator. The reference is the image with all effects that
// `scene.effects` does not exclude: auto counts as all. Deterministic effects are judged before
// noise and rounding. Throws Error as SceneSimulator and the estimate do.
SceneAttribution AttributeScene(const model::SceneSimulationOptions& scene,
                                const std::vector<model::LayerPixels>& pixels,
                                const AttributionRun& run);

// With `unknown_offset` the calibration also finds the offset of the bench. Throws Error as
// SweepSimulator does, and if the sweep with all effects has no calibration.
SweepAttribution AttributeSweep(const model::SweepSimulationOptions& sweep,
                                const model::LinearPicture& target_picture, bool unknown_offset,
                                const AttributionRun& run);

// Returns the effects of the reference: all effects instead of those that auto would choose.
model::EffectChoice AllInsteadOfAuto(model::EffectChoice choice);
// Returns whether an effect belongs to readout and storage and is judged on stored values.
bool IsOfStorage(model::Effect effect);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_ATTRIBUTION_H_

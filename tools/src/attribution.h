#ifndef THICKLENS_TOOLS_ATTRIBUTION_H_
#define THICKLENS_TOOLS_ATTRIBUTION_H_

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "picture_change.h"
#include "thicklens/estimator/compare.h"
#include "thicklens/model/effect_choice.h"
#include "thicklens/model/scene_simulator.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::tools {

// What each effect of image formation changes, found by taking it away from a simulation that has
// all the others: in the pictures, in what is calibrated from them, in what is estimated from them.

// Which way a picture became another, for the eye. Grey levels of stored values.
struct DifferencePicture {
  int width_px = 0, height_px = 0;
  std::vector<float> grey_levels;  // without the effect less with it; empty: none
  std::string of;                  // "the picture", "frame 3, at 250 mm"
};

struct AttributedEffect {
  model::Effect effect = model::Effect::kDefocus;
  // Nothing of it is there: it was not simulated again.
  bool absent = false;
  double bound_grey_levels = 0;  // of what it can change; noise: its standard deviation
  bool kept_by_auto = true;
  PictureChange picture;  // of all frames of a sweep together
  DifferencePicture difference;
  double picture_seconds = 0;  // to simulate without it
};

// ---- A picture of a scene, and the light field that is estimated from it.

struct SceneEffect : AttributedEffect {
  // Mean PSNR of the estimated views against the true ones, less that with all effects. Where the
  // photograph and the scene lack the effect:
  double light_field_db = 0;
  // Where the photograph has it and the estimate is made without it; absent for what an estimate
  // does not model or cannot leave out. Without defocus it is the photograph warped by its depth.
  std::optional<double> ignored_db;
  double estimate_seconds = 0;
};

struct SceneAttribution {
  model::EffectSet on;  // with which the scene is compared
  int u_count = 0, v_count = 0;
  double light_field_psnr_db = 0;
  double picture_seconds = 0, estimate_seconds = 0;
  double sampling_error_grey_levels = 0;  // rms, where it is largest
  std::vector<SceneEffect> effects;
  model::StoredPicture picture;
};

// ---- A sweep, and the calibration from it.

struct CalibratedValues {
  double image_distance_mm = 0, image_distance_sigma_mm = 0;
  double blur_ratio = 0, blur_ratio_sigma = 0;
};

struct SweepEffect : AttributedEffect {
  // Absent: refused, for this reason.
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

// How they run: `progress` may throw to stop; it is called often, from several threads at once.
struct AttributionRun {
  int threads = 0;  // 0: one per core
  std::function<void(int done, int total)> progress;
};

// `pixels`: as SceneSimulator has it. What is compared is the picture with all effects that
// `scene.effects` does not exclude: auto counts as all. Deterministic effects are judged before
// noise and rounding. Throws Error as SceneSimulator and the estimate do.
SceneAttribution AttributeScene(const model::SceneSimulationOptions& scene,
                                const std::vector<model::LayerPixels>& pixels,
                                const AttributionRun& run);

// `unknown_offset`: the calibration is to find the offset of the bench. Throws Error as
// SweepSimulator does, and where the sweep with all effects has no calibration.
SweepAttribution AttributeSweep(const model::SweepSimulationOptions& sweep,
                                const model::LinearPicture& target_picture, bool unknown_offset,
                                const AttributionRun& run);

// What is compared with: all effects instead of those that auto would choose.
model::EffectChoice AllInsteadOfAuto(model::EffectChoice choice);
// Whether an effect is of what is read and stored, judged on stored values.
bool IsOfStorage(model::Effect effect);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_ATTRIBUTION_H_

#ifndef THICKLENS_MODEL_SCENE_ABLATION_H_
#define THICKLENS_MODEL_SCENE_ABLATION_H_

#include <functional>
#include <optional>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/ablation.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::model {

// The ablation of an image of a scene and of the light field that is estimated from it.

// The change that one effect causes to the image and to the estimated light field.
struct AblatedSceneEffect : AblatedEffect {
  // Mean PSNR of the estimated views against the true ones, minus that with all effects, if the
  // photograph and the scene lack the effect.
  double light_field_db = 0;
  // This difference if the photograph has the effect and the estimate ignores it. Absent for
  // effects that an estimate does not model or cannot leave out. Without defocus the estimate is
  // the photograph warped by its depth.
  std::optional<double> ignored_db;
  double estimate_seconds = 0;  // time of the estimate without the effect
};

// The changes of all effects, and the reference that has all of them.
struct SceneAblation {
  EffectSet on;                    // effects of the scene that is the reference
  int u_count = 0, v_count = 0;    // numbers of views across and down
  double light_field_psnr_db = 0;  // mean PSNR of the estimated views of the reference, dB
  double image_seconds = 0, estimate_seconds = 0;  // times of the reference
  double sampling_error_grey_levels = 0;           // rms, where it is largest
  std::vector<AblatedSceneEffect> effects;         // one per effect of the reference
  EncodedImage image;                              // the photograph of the reference
};

// The input of an estimate, and the true views at the places of its grid.
struct SceneToEstimate {
  const EncodedImage& photograph;  // the simulated photograph
  const Camera& camera;            // the camera with its true calibration
  const RawDepthMap& depth;        // the true depth z from Ap, mm
  const LightField& truth;         // the true views
  EffectSet on;                    // as the estimate models them
  std::function<void()> tell;      // to be called often; may throw to stop
};
// Estimates the views and returns their mean PSNR against the true ones, dB. It is a function of
// the caller, because the estimator is not part of this module.
using EstimatedPsnrDb = std::function<double(const SceneToEstimate&)>;

// `pixels` are as in SceneSimulator. The reference is the image with all effects that
// `scene.effects` does not exclude: auto counts as all. Deterministic effects are judged before
// noise and rounding. Throws Error as SceneSimulator and the estimate do.
THICKLENS_EXPORT SceneAblation AblateScene(const SceneSimulationOptions& scene,
                                           const std::vector<LayerPixels>& pixels,
                                           const EstimatedPsnrDb& estimate, const AblationRun& run);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SCENE_ABLATION_H_

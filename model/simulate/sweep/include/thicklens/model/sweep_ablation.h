#ifndef THICKLENS_MODEL_SWEEP_ABLATION_H_
#define THICKLENS_MODEL_SWEEP_ABLATION_H_

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/ablation.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::model {

// The ablation of a sweep and of the calibration from it.

struct CalibratedValues {
  double image_distance_mm = 0, image_distance_sigma_mm = 0;
  double blur_ratio = 0, blur_ratio_sigma = 0;
};

struct AblatedSweepEffect : AblatedEffect {
  // Absent: the calibration was refused for the reason in `refusal`.
  std::optional<CalibratedValues> calibration;
  std::string refusal;
  double calibration_seconds = 0;
};

struct SweepAblation {
  EffectSet on;
  int frames = 0;
  double true_image_distance_mm = 0, true_blur_ratio = 0;
  CalibratedValues calibration;
  double image_seconds = 0, calibration_seconds = 0;
  std::vector<AblatedSweepEffect> effects;
};

// A simulated sweep that is to be calibrated.
struct SweepToCalibrate {
  const SweepSimulationOptions& options;
  const SweepSimulator& simulator;
  std::function<EncodedImage(int frame)> stored_frame;
  std::function<void()> tell;  // to be called often; may throw to stop
};
struct SweepCalibration {
  std::optional<CalibratedValues> values;
  std::string refusal;  // the reason why there are no values
};
// Calibrates a sweep. It is a function of the caller, because the calibration is not part of this
// module.
using CalibrateSweep = std::function<SweepCalibration(const SweepToCalibrate&)>;

// The reference is as for AblateScene. Throws Error as SweepSimulator does, and if the sweep with
// all effects has no calibration.
THICKLENS_EXPORT SweepAblation AblateSweep(const SweepSimulationOptions& sweep,
                                           const LinearImage& target_image,
                                           const CalibrateSweep& calibrate, const AblationRun& run);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SWEEP_ABLATION_H_

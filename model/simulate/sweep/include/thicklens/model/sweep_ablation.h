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

// The two calibrated values that an ablation compares, with their standard deviations.
struct CalibratedValues {
  double image_distance_mm = 0, image_distance_sigma_mm = 0;  // d1 from Ap to the sensor, mm
  double blur_ratio = 0, blur_ratio_sigma = 0;                // kappa, dimensionless
};

// The change that one effect causes to the frames and to the calibration.
struct AblatedSweepEffect : AblatedEffect {
  // Absent: the calibration was refused for the reason in `refusal`.
  std::optional<CalibratedValues> calibration;
  std::string refusal;             // empty if there is a calibration
  double calibration_seconds = 0;  // time of the calibration without the effect
};

// The changes of all effects, and the reference that has all of them.
struct SweepAblation {
  EffectSet on;    // effects of the sweep that is the reference
  int frames = 0;  // number of frames
  double true_image_distance_mm = 0, true_blur_ratio = 0;  // d1, mm, and kappa of the simulation
  CalibratedValues calibration;                            // of the reference
  double image_seconds = 0, calibration_seconds = 0;       // times of the reference
  std::vector<AblatedSweepEffect> effects;                 // one per effect of the reference
};

// A simulated sweep that is to be calibrated.
struct SweepToCalibrate {
  const SweepSimulationOptions& options;  // what was simulated
  const SweepSimulator& simulator;        // gives camera and truth
  // Returns the encoded frame of an index.
  std::function<EncodedImage(int frame)> stored_frame;
  std::function<void()> tell;  // to be called often; may throw to stop
};
// The result of a calibration of a simulated sweep.
struct SweepCalibration {
  std::optional<CalibratedValues> values;  // absent: refused
  std::string refusal;                     // the reason why there are no values
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

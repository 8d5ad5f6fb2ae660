#ifndef THICKLENS_MODEL_ABLATION_H_
#define THICKLENS_MODEL_ABLATION_H_

#include <functional>
#include <string>
#include <vector>

#include "thicklens/model/effect_choice.h"
#include "thicklens/model/picture_change.h"

namespace thicklens::model {

// An ablation finds the change that each effect of image formation causes by removing the effect
// from a simulation that has all others.

// The difference between two images, for display. Its unit is grey levels of stored values.
struct DifferencePicture {
  int width_px = 0, height_px = 0;
  std::vector<float> grey_levels;  // without the effect minus with it; empty: none
  std::string of;                  // "the picture", "frame 3, at 250 mm"
};

struct AblatedEffect {
  Effect effect = Effect::kDefocus;
  // The effect does not occur, so it was not simulated again.
  bool absent = false;
  double bound_grey_levels = 0;  // bound of its change; for noise its standard deviation
  bool kept_by_auto = true;
  PictureChange picture;  // over all frames of a sweep together
  DifferencePicture difference;
  double picture_seconds = 0;  // simulation time without the effect
};

// How ablations run. `progress` may throw to stop; it is called often, from several threads at
// once.
struct AblationRun {
  int threads = 0;  // 0: one per core
  std::function<void(int done, int total)> progress;
};

// Returns the effects of the reference: all effects instead of those that auto would choose.
EffectChoice AllInsteadOfAuto(EffectChoice choice);
// Returns whether an effect belongs to readout and storage and is judged on stored values.
bool IsOfStorage(Effect effect);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_ABLATION_H_

#ifndef THICKLENS_MODEL_ABLATION_H_
#define THICKLENS_MODEL_ABLATION_H_

#include <functional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/effect_selection.h"
#include "thicklens/model/image_change.h"

namespace thicklens::model {

// An ablation finds the change that each effect of image formation causes by removing the effect
// from a simulation that has all others.

// The difference between two images, for display. Its unit is grey levels of encoded values.
struct DifferenceImage {
  int width_px = 0, height_px = 0;  // size of the image, px
  std::vector<float> grey_levels;   // without the effect minus with it; empty: none
  std::string of;                   // "the image", "frame 3, at 250 mm"
};

// The change that one effect causes, found by a simulation without it.
struct AblatedEffect {
  Effect effect = Effect::kDefocus;  // the effect that was left out
  // The effect does not occur, so it was not simulated again.
  bool absent = false;
  double bound_grey_levels = 0;  // bound of its change; for noise its standard deviation
  bool kept_by_auto = true;      // the choice kAuto would keep the effect
  ImageChange image;             // over all frames of a sweep together
  DifferenceImage difference;    // for display: the image, or one frame of a sweep
  double image_seconds = 0;      // simulation time without the effect
};

// How ablations run. `progress` may throw to stop; it is called often, from several threads at
// once.
struct AblationRun {
  int threads = 0;  // 0: one per core
  // Gets the steps that are done; empty: none.
  std::function<void(int done, int total)> progress;
};

// Returns the effects of the reference: all effects instead of those that auto would choose.
THICKLENS_EXPORT EffectSelectionOptions AllInsteadOfAuto(EffectSelectionOptions choice);
// Returns whether an effect belongs to readout and storage and is judged on encoded values.
THICKLENS_EXPORT bool IsOfStorage(Effect effect);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_ABLATION_H_

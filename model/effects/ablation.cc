#include "thicklens/model/ablation.h"

namespace thicklens::model {

EffectSelectionOptions AllInsteadOfAuto(EffectSelectionOptions choice) {
  if (choice.base == EffectSelectionOptions::Base::kAuto)
    choice.base = EffectSelectionOptions::Base::kAll;
  return choice;
}

bool IsOfStorage(Effect effect) {
  return effect == Effect::kShotNoise || effect == Effect::kReadNoise ||
         effect == Effect::kQuantisation;
}

}  // namespace thicklens::model

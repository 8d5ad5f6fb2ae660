#include "thicklens/model/ablation.h"

namespace thicklens::model {

EffectChoice AllInsteadOfAuto(EffectChoice choice) {
  if (choice.base == EffectChoice::Base::kAuto) choice.base = EffectChoice::Base::kAll;
  return choice;
}

bool IsOfStorage(Effect effect) {
  return effect == Effect::kShotNoise || effect == Effect::kReadNoise ||
         effect == Effect::kQuantisation;
}

}  // namespace thicklens::model

#include "tools/report/attribution.h"

namespace thicklens::tools {

model::EffectChoice AllInsteadOfAuto(model::EffectChoice choice) {
  if (choice.base == model::EffectChoice::Base::kAuto)
    choice.base = model::EffectChoice::Base::kAll;
  return choice;
}

bool IsOfStorage(model::Effect effect) {
  return effect == model::Effect::kShotNoise || effect == model::Effect::kReadNoise ||
         effect == model::Effect::kQuantisation;
}

}  // namespace thicklens::tools

#include "model/schema/effect_yaml.h"

#include <string>

#include "thicklens/base/error.h"

namespace thicklens::model {

void ReadEffectSelectionOptions(const YamlNode& root, EffectSelectionOptions* choice) {
  const auto names = [](const YamlNode& node) {
    EffectSet effects;
    for (const YamlNode& name : node.Elements()) {
      const std::string text = name.Text();
      try {
        effects.Add(EffectFromName(text));
      } catch (const Error& error) {
        throw name.ErrorHere(error.what());
      }
    }
    return effects;
  };
  if (const auto effects = root.Find("effects")) {
    if (effects->IsSequence()) {
      choice->base = EffectSelectionOptions::Base::kGiven;
      choice->given = names(*effects);
    } else {
      *choice = EffectSelectionOptionsFromText(effects->OneOf({"auto", "all", "none"}), "", "");
    }
  }
  if (const auto without = root.Find("without")) choice->without = names(*without);
  if (const auto tolerance = root.Find("tolerance")) {
    const std::string text = tolerance->Text();
    try {
      choice->tolerance = EffectToleranceFromText(text);
    } catch (const Error& error) {
      throw tolerance->ErrorHere(error.what());
    }
  }
}

void WriteEffects(const EffectSelectionRecord& record, YamlWriter* out) {
  out->List("effects", record.on);
  out->BeginMapInLine("left_out_grey_levels");
  for (const auto& [name, grey_levels] : record.left_out_grey_levels)
    out->Number(name, grey_levels);
  out->EndMap();
}

}  // namespace thicklens::model

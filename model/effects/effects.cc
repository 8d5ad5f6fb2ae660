#include "thicklens/model/effects.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <sstream>

#include "thicklens/base/error.h"

namespace thicklens::model {

std::string EffectUnitName(EffectUnit unit) {
  switch (unit) {
    case EffectUnit::kPx:
      return "px";
    case EffectUnit::kRelative:
      return "relative";
    case EffectUnit::kGreyLevels:
      return "grey-levels";
    case EffectUnit::kMm:
      return "mm";
  }
  throw Error("no such unit of an effect");
}

const std::vector<EffectFacts>& AllEffects() {
  static const std::vector<EffectFacts> facts = {
      {Effect::kThickness, "thickness",
       "two principal planes with f1 and f2, compared with the thin lens f1",
       "the thin lens of focal length f1, focused on the same plane", EffectUnit::kRelative, false},
      {Effect::kDefocus, "defocus", "blur of objects outside the plane of focus",
       "a pinhole in the middle of the aperture", EffectUnit::kPx, false},
      {Effect::kApertureShape, "aperture-shape", "the edge of a disc-shaped aperture",
       "the Gaussian aperture of the same blur", EffectUnit::kPx, false},
      {Effect::kFalloff, "falloff", "irradiance cos(alpha) cos^3(beta) toward the corners",
       "the irradiance of the principal point everywhere", EffectUnit::kRelative, false},
      {Effect::kVignetting, "vignetting",
       "rays that the aperture blocks if the UV plane is elsewhere",
       "each pixel has the aperture of the principal point", EffectUnit::kRelative, false},
      {Effect::kOcclusion, "occlusion",
       "near objects hide parts of far ones from parts of the lens",
       "the whole lens sees the same parts of a surface as its middle", EffectUnit::kPx, false},
      {Effect::kPixelBox, "pixel-box", "a pixel is the mean over its square",
       "a pixel samples the light at its centre", EffectUnit::kPx, false},
      {Effect::kLensFloor, "lens-floor", "blur floor: blur of the lens in its plane of focus",
       "a lens without aberrations", EffectUnit::kPx, false},
      {Effect::kDiffraction, "diffraction", "blur by the wave nature of light at the aperture",
       "rays", EffectUnit::kPx, false},
      {Effect::kShotNoise, "shot-noise", "electrons arrive one by one",
       "the mean number of electrons", EffectUnit::kGreyLevels, true},
      {Effect::kReadNoise, "read-noise", "noise of the sensor's electronics", "none",
       EffectUnit::kGreyLevels, true},
      {Effect::kQuantisation, "quantisation", "rounding of encoded values", "16 bits",
       EffectUnit::kGreyLevels, true},
      {Effect::kTransferCurve, "transfer-curve",
       "the encoding of linear light in the encoded values", "linear light is stored",
       EffectUnit::kGreyLevels, false},
      {Effect::kLampFalloff, "lamp-falloff", "a lamp beside the camera lights far targets less",
       "a target lit equally at all depths", EffectUnit::kRelative, false},
      {Effect::kFlicker, "flicker", "the lamp changes from frame to frame", "a steady lamp",
       EffectUnit::kRelative, true},
      {Effect::kMagnification, "magnification", "a farther target is smaller in the image",
       "the scale of the plane of focus at all depths", EffectUnit::kPx, false},
      {Effect::kDrift, "drift", "the target moves sideways from frame to frame",
       "the target does not move", EffectUnit::kPx, true},
      {Effect::kTilt, "tilt", "one side of the target is nearer than the other",
       "a target across the axis", EffectUnit::kMm, false},
      {Effect::kReadingError, "reading-error", "error of the bench's readings", "true readings",
       EffectUnit::kMm, true},
      {Effect::kShading, "shading",
       "the mount and filters take light toward the corners, as stated for the bench",
       "the light that the lens alone gives", EffectUnit::kRelative, false},
      {Effect::kDust, "dust", "specks on the sensor's cover take a part of the light",
       "a clean sensor", EffectUnit::kRelative, false},
      {Effect::kAberrations, "aberrations",
       "field curvature and astigmatism displace the plane of focus", "a flat plane of focus",
       EffectUnit::kMm, false},
      {Effect::kDistortion, "distortion", "the lens displaces the image toward the corners",
       "a lens without distortion", EffectUnit::kPx, false},
      {Effect::kBands, "bands",
       "a lamp that flickers while the shutter rolls makes rows brighter and darker",
       "an even light", EffectUnit::kRelative, true},
      {Effect::kExposureDrift, "exposure-drift",
       "the exposure of the camera changes evenly over the sweep", "one exposure",
       EffectUnit::kRelative, false},
  };
  return facts;
}

const EffectFacts& FactsOf(Effect effect) {
  return AllEffects().at(static_cast<std::size_t>(effect));
}

std::string EffectName(Effect effect) { return FactsOf(effect).name; }

Effect EffectFromName(const std::string& name) {
  for (const EffectFacts& facts : AllEffects()) {
    if (name == facts.name) return facts.effect;
  }
  throw Error(fmt::format("effect \"{}\" is unknown: it must be one of {}", name,
                          JoinedNames(EffectSet::All())));
}

EffectSet EffectSet::All() {
  EffectSet all;
  for (const EffectFacts& facts : AllEffects()) all.Add(facts.effect);
  return all;
}

std::vector<Effect> EffectSet::Effects() const {
  std::vector<Effect> effects;
  for (const EffectFacts& facts : AllEffects()) {
    if (Has(facts.effect)) effects.push_back(facts.effect);
  }
  return effects;
}

std::vector<std::string> EffectSet::Names() const {
  std::vector<std::string> names;
  for (const Effect effect : Effects()) names.push_back(EffectName(effect));
  return names;
}

EffectSet EffectSetFromNames(const std::string& names) {
  EffectSet effects;
  std::istringstream stream(names);
  for (std::string name; std::getline(stream, name, ',');) {
    const std::size_t first = name.find_first_not_of(' ');
    const std::size_t last = name.find_last_not_of(' ');
    effects.Add(
        EffectFromName(first == std::string::npos ? "" : name.substr(first, last - first + 1)));
  }
  return effects;
}

std::string JoinedNames(const EffectSet& effects) {
  return effects.empty() ? "none" : fmt::format("{}", fmt::join(effects.Names(), ", "));
}

}  // namespace thicklens::model

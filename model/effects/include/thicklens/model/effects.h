#ifndef THICKLENS_MODEL_EFFECTS_H_
#define THICKLENS_MODEL_EFFECTS_H_

#include <cstdint>
#include <initializer_list>
#include <string>
#include <vector>

#include "thicklens/base/export.h"

namespace thicklens::model {

// The effects of image formation. They are independent of each other: a forward model without an
// effect does what EffectFacts::without states, and spends no time on the effect.
enum class Effect {
  kThickness,      // two principal planes, compared with the thin lens
  kDefocus,        // blur of objects outside the plane of focus
  kApertureShape,  // the edge of a disc-shaped aperture
  kFalloff,        // irradiance cos(alpha) cos^3(beta) toward the corners
  kVignetting,     // rays that the aperture blocks if the UV plane is elsewhere
  kOcclusion,      // near objects hide far ones from parts of the lens
  kPixelBox,       // a pixel is the mean over its square
  kLensFloor,      // blur of the lens in its plane of focus
  kDiffraction,    // blur by the wave nature of light
  kShotNoise,      // electrons arrive one by one
  kReadNoise,      // noise of the sensor's electronics
  kQuantisation,   // rounding of encoded values
  kTransferCurve,  // encoding of linear light

  // The remaining effects belong to a bench that moves a target from frame to frame.

  kLampFalloff,    // a lamp beside the camera lights far targets less
  kFlicker,        // the lamp changes from frame to frame
  kMagnification,  // a farther target is smaller in the image
  kDrift,          // the target moves sideways from frame to frame
  kTilt,           // one side of the target is nearer than the other
  kReadingError,   // error of the bench's readings
  kShading,        // light lost toward the corners by the mount or by filters
  kDust,           // specks on the sensor's cover
  kAberrations,    // field curvature and astigmatism displace the plane of focus
  kDistortion,     // the lens displaces the image toward the corners
  kBands,          // rows that brighten together: a lamp under a rolling shutter
  kExposureDrift,  // the exposure changes over the sweep
};

// Unit of an impact.
enum class EffectUnit {
  kPx,          // px of the sensor: a displacement, or the sigma of a blur per axis
  kRelative,    // relative change of the irradiance
  kGreyLevels,  // grey levels of encoded values, 255 at full scale
  kMm,          // millimetres of depth
};
// "px", "relative", "grey-levels", "mm".
THICKLENS_EXPORT std::string EffectUnitName(EffectUnit unit);

// Static description of an effect. The texts are literals and always valid.
struct EffectFacts {
  Effect effect;        // the effect that is described
  const char* name;     // "thickness", "defocus", "aperture-shape", ...
  const char* what;     // description in words
  const char* without;  // the model that replaces the effect when it is off
  EffectUnit unit;      // unit of EffectImpact::amount
  bool random;          // true: the impact is a standard deviation over repeated exposures
};

THICKLENS_EXPORT const std::vector<EffectFacts>& AllEffects();  // in the order of the enumeration
// Returns the description of one effect.
THICKLENS_EXPORT const EffectFacts& FactsOf(Effect effect);
// Returns EffectFacts::name: "thickness", "defocus", ...
THICKLENS_EXPORT std::string EffectName(Effect effect);
// Inverse of EffectName. Throws Error, which lists the names, for any other name.
THICKLENS_EXPORT Effect EffectFromName(const std::string& name);

// A set of effects.
class THICKLENS_EXPORT EffectSet {
 public:
  EffectSet() = default;
  // Makes a set of the listed effects.
  EffectSet(std::initializer_list<Effect> effects) {
    for (const Effect effect : effects) Add(effect);
  }
  // The set of all effects of the enumeration.
  static EffectSet All();

  // Returns whether the effect is in the set.
  bool Has(Effect effect) const { return (bits_ & BitOf(effect)) != 0; }
  // Adds an effect; it may be in the set already.
  void Add(Effect effect) { bits_ |= BitOf(effect); }
  // Removes an effect; it need not be in the set.
  void Remove(Effect effect) { bits_ &= ~BitOf(effect); }
  // Returns the union of both sets.
  EffectSet With(const EffectSet& other) const { return EffectSet(bits_ | other.bits_); }
  // Returns this set without the effects of the other one.
  EffectSet Without(const EffectSet& other) const { return EffectSet(bits_ & ~other.bits_); }
  // Returns the intersection of both sets.
  EffectSet Both(const EffectSet& other) const { return EffectSet(bits_ & other.bits_); }
  // Returns whether the set has no effect.
  bool empty() const { return bits_ == 0; }
  // The effects of the set in the order of the enumeration.
  std::vector<Effect> Effects() const;
  std::vector<std::string> Names() const;  // in the order of the enumeration

  friend bool operator==(const EffectSet& a, const EffectSet& b) { return a.bits_ == b.bits_; }

 private:
  explicit EffectSet(std::uint32_t bits) : bits_(bits) {}
  static std::uint32_t BitOf(Effect effect) { return 1U << static_cast<unsigned>(effect); }

  std::uint32_t bits_ = 0;
};
// The set of a list of names separated by commas. Throws Error for an unknown name.
THICKLENS_EXPORT EffectSet EffectSetFromNames(const std::string& names);
// The names, separated by ", "; "none" if the set is empty.
THICKLENS_EXPORT std::string JoinedNames(const EffectSet& effects);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_EFFECTS_H_

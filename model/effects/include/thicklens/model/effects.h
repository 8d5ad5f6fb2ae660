#ifndef THICKLENS_MODEL_EFFECTS_H_
#define THICKLENS_MODEL_EFFECTS_H_

#include <cstdint>
#include <initializer_list>
#include <string>
#include <vector>

namespace thicklens::model {

// The effects of image formation. Each is a part of its own: a forward model without it does what
// EffectFacts::without says, and spends nothing on it.
enum class Effect {
  kThickness,
  kDefocus,
  kApertureShape,
  kFalloff,
  kVignetting,
  kOcclusion,
  kPixelBox,
  kLensFloor,
  kDiffraction,
  kShotNoise,
  kReadNoise,
  kQuantisation,
  kTransferCurve,
  // Of a bench that moves a target from frame to frame.
  kLampFalloff,
  kFlicker,
  kMagnification,
  kDrift,
  kTilt,
  kReadingError,
};

// What an impact is measured in.
enum class EffectUnit {
  kPx,          // of the sensor: a displacement, or the sigma of a blur per axis
  kRelative,    // of the irradiance
  kGreyLevels,  // of stored values, 255 at full scale
  kMm,          // of the depth
};
std::string EffectUnitName(EffectUnit unit);  // "px", "relative", "grey-levels", "mm"

struct EffectFacts {
  Effect effect;
  const char* name;     // "thickness", "defocus", "aperture-shape", ...
  const char* what;     // what it is, in words
  const char* without;  // what stands in its place
  EffectUnit unit;
  bool random;  // its impact is a standard deviation over repeated exposures
};

const std::vector<EffectFacts>& AllEffects();  // in the order of the enumeration
const EffectFacts& FactsOf(Effect effect);
std::string EffectName(Effect effect);
Effect EffectFromName(const std::string& name);  // throws Error that lists the names

class EffectSet {
 public:
  EffectSet() = default;
  EffectSet(std::initializer_list<Effect> effects) {
    for (const Effect effect : effects) Add(effect);
  }
  static EffectSet All();

  bool Has(Effect effect) const { return (bits_ & BitOf(effect)) != 0; }
  void Add(Effect effect) { bits_ |= BitOf(effect); }
  void Remove(Effect effect) { bits_ &= ~BitOf(effect); }
  EffectSet With(const EffectSet& other) const { return EffectSet(bits_ | other.bits_); }
  EffectSet Without(const EffectSet& other) const { return EffectSet(bits_ & ~other.bits_); }
  EffectSet Both(const EffectSet& other) const { return EffectSet(bits_ & other.bits_); }
  bool empty() const { return bits_ == 0; }
  std::vector<Effect> Effects() const;
  std::vector<std::string> Names() const;  // in the order of the enumeration

  friend bool operator==(const EffectSet& a, const EffectSet& b) { return a.bits_ == b.bits_; }

 private:
  explicit EffectSet(std::uint32_t bits) : bits_(bits) {}
  static std::uint32_t BitOf(Effect effect) { return 1U << static_cast<unsigned>(effect); }

  std::uint32_t bits_ = 0;
};
// Of names between commas. Throws Error for one that does not exist.
EffectSet EffectSetFromNames(const std::string& names);
std::string JoinedNames(const EffectSet& effects);  // between ", "; "none" for none

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_EFFECTS_H_

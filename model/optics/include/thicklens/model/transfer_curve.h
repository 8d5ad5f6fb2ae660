#ifndef THICKLENS_MODEL_TRANSFER_CURVE_H_
#define THICKLENS_MODEL_TRANSFER_CURVE_H_

#include <string>

#include "thicklens/base/export.h"

namespace thicklens::model {

// The curve from linear light to the value that an image file stores. Both are in [0, 1].
class THICKLENS_EXPORT TransferCurve {
 public:
  // The kind of curve: stored = light (kLinear), IEC 61966-2-1 (kSrgb), or stored = light^(1/gamma)
  // (kGamma).
  enum class Kind { kLinear, kSrgb, kGamma };

  TransferCurve() = default;
  // The curve stored = light.
  static TransferCurve Linear() { return TransferCurve(Kind::kLinear, 1); }
  // The curve of IEC 61966-2-1.
  static TransferCurve Srgb() { return TransferCurve(Kind::kSrgb, 1); }
  // The curve stored = light^(1/gamma). Throws Error unless `gamma` is finite and > 0.
  static TransferCurve Gamma(double gamma);

  // The curve of the name "linear", "srgb", or "gamma-" with an exponent from 0.1 to 10, as in
  // "gamma-2.2". Throws Error, which lists these names, for any other.
  static TransferCurve FromName(const std::string& name);
  // The name: "linear", "srgb", or "gamma-" with the exponent, as in "gamma-2.2".
  std::string Name() const;

  // Encode gives the encoded value, Decode is its inverse. The curve is IEC 61966-2-1 for srgb and
  // stored = light^(1/gamma) for gamma. Outside [0, 1] the curves srgb and gamma are continued as
  // odd functions, so that noise around 0 keeps its mean.
  double Encode(double light) const;
  // The linear light of an encoded value; see Encode.
  double Decode(double stored) const;

  friend bool operator==(const TransferCurve& a, const TransferCurve& b) {
    return a.kind_ == b.kind_ && a.gamma_ == b.gamma_;
  }

 private:
  TransferCurve(Kind kind, double gamma) : kind_(kind), gamma_(gamma) {}

  Kind kind_ = Kind::kSrgb;
  double gamma_ = 1;
};

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_TRANSFER_CURVE_H_

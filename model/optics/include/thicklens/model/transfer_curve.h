#ifndef THICKLENS_MODEL_TRANSFER_CURVE_H_
#define THICKLENS_MODEL_TRANSFER_CURVE_H_

#include <string>

#include "thicklens/base/export.h"

namespace thicklens::model {

// The curve from linear light to the value that an image file stores. Both are in [0, 1].
class THICKLENS_EXPORT TransferCurve {
 public:
  enum class Kind { kLinear, kSrgb, kGamma };

  TransferCurve() = default;
  static TransferCurve Linear() { return TransferCurve(Kind::kLinear, 1); }
  static TransferCurve Srgb() { return TransferCurve(Kind::kSrgb, 1); }
  static TransferCurve Gamma(double gamma) { return TransferCurve(Kind::kGamma, gamma); }

  // The curve of the name "linear", "srgb" or "gamma-2.2". Throws Error, which lists these names,
  // for any other.
  static TransferCurve FromName(const std::string& name);
  std::string Name() const;

  // Encode gives the encoded value, Decode is its inverse. The curve is IEC 61966-2-1 for srgb and
  // stored = light^(1/gamma) for gamma. Outside [0, 1] the curves srgb and gamma are continued as
  // odd functions, so that noise around 0 keeps its mean.
  double Encode(double light) const;
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

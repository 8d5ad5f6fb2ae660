#ifndef THICKLENS_MODEL_TRANSFER_CURVE_H_
#define THICKLENS_MODEL_TRANSFER_CURVE_H_

#include <string>

namespace thicklens::model {

// How linear light becomes the value that a picture file stores. Both are in [0, 1].
class TransferCurve {
 public:
  enum class Kind { kLinear, kSrgb, kGamma };

  TransferCurve() = default;
  static TransferCurve Linear() { return TransferCurve(Kind::kLinear, 1); }
  static TransferCurve Srgb() { return TransferCurve(Kind::kSrgb, 1); }
  static TransferCurve Gamma(double gamma) { return TransferCurve(Kind::kGamma, gamma); }

  // "linear", "srgb" or "gamma-2.2". Throws Error that lists these for anything else.
  static TransferCurve FromName(const std::string& name);
  std::string Name() const;

  // IEC 61966-2-1 for srgb; stored = light^(1/gamma) for gamma. Values outside [0, 1] are continued
  // as odd functions (srgb, gamma), so that noise around 0 keeps its mean.
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

#include "thicklens/model/transfer_curve.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>

#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

// [L1] IEC 61966-2-1. The curve is straight near black, where a power alone would have an infinite
// slope.
double EncodeSrgb(double light) {
  return light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055;
}

double DecodeSrgb(double stored) {
  return stored <= 0.04045 ? stored / 12.92 : std::pow((stored + 0.055) / 1.055, 2.4);
}

constexpr double kMinGamma = 0.1, kMaxGamma = 10;

// The exponent in the name "gamma-2.2".
std::optional<double> GammaOf(const std::string& name) {
  constexpr std::string_view kBegin = "gamma-";
  if (name.compare(0, kBegin.size(), kBegin) != 0) return std::nullopt;
  double gamma = 0;
  const char* const end = name.data() + name.size();
  const auto [rest, status] = std::from_chars(name.data() + kBegin.size(), end, gamma);
  if (status != std::errc() || rest != end || !(gamma >= kMinGamma && gamma <= kMaxGamma))
    return std::nullopt;
  return gamma;
}

}  // namespace

TransferCurve TransferCurve::Gamma(double gamma) {
  if (!(gamma > 0) || !std::isfinite(gamma)) {
    throw Error(fmt::format("gamma: a finite number > 0 is expected, found {}", gamma));
  }
  return TransferCurve(Kind::kGamma, gamma);
}

TransferCurve TransferCurve::FromName(const std::string& name) {
  if (name == "linear") return Linear();
  if (name == "srgb") return Srgb();
  if (const auto gamma = GammaOf(name)) return Gamma(*gamma);
  throw Error(
      fmt::format("transfer curve \"{}\" is unknown: it must be linear, srgb, or gamma- with an "
                  "exponent from {} to {}, as in gamma-2.2",
                  name, kMinGamma, kMaxGamma));
}

std::string TransferCurve::Name() const {
  switch (kind_) {
    case Kind::kLinear:
      return "linear";
    case Kind::kSrgb:
      return "srgb";
    case Kind::kGamma:
      break;
  }
  return fmt::format("gamma-{}", gamma_);
}

double TransferCurve::Encode(double light) const {
  if (kind_ == Kind::kLinear) return light;
  const double size = std::abs(light);
  return std::copysign(kind_ == Kind::kSrgb ? EncodeSrgb(size) : std::pow(size, 1 / gamma_), light);
}

double TransferCurve::Decode(double stored) const {
  if (kind_ == Kind::kLinear) return stored;
  const double size = std::abs(stored);
  return std::copysign(kind_ == Kind::kSrgb ? DecodeSrgb(size) : std::pow(size, gamma_), stored);
}

}  // namespace thicklens::model

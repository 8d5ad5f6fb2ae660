#include "tools/interface/stated_transfer.h"

#include <fmt/format.h>

#include <cmath>

namespace thicklens {
namespace {

constexpr double kRoundedExponent = 0.05;

// The exponent of light that is closest to the curve: files write sRGB as 2.2 too.
double ExponentOf(const TransferCurve& transfer) {
  if (transfer == TransferCurve::Linear()) return 1;
  if (transfer == TransferCurve::Srgb()) return 2.2;
  constexpr double kMiddle = 0.5;
  return std::log(transfer.Decode(kMiddle)) / std::log(kMiddle);
}

}  // namespace

std::optional<TransferCurve> StatedTransferOf(const io::ImageFacts& facts) {
  switch (facts.transfer) {
    case io::StatedTransfer::kLinear:
      return TransferCurve::Linear();
    case io::StatedTransfer::kSrgb:
      return TransferCurve::Srgb();
    case io::StatedTransfer::kGamma:
      if (!(facts.gamma >= 0.1 && facts.gamma <= 10)) return std::nullopt;  // no photograph's
      return TransferCurve::Gamma(facts.gamma);
    case io::StatedTransfer::kBt709:
    case io::StatedTransfer::kPq:
    case io::StatedTransfer::kHlg:
    case io::StatedTransfer::kAbsent:
      break;
  }
  return std::nullopt;
}

std::string StatedTransferName(const io::ImageFacts& facts) {
  if (const auto curve = StatedTransferOf(facts)) return curve->Name();
  switch (facts.transfer) {
    case io::StatedTransfer::kBt709:
      return "BT.709";
    case io::StatedTransfer::kPq:
      return "PQ";
    case io::StatedTransfer::kHlg:
      return "HLG";
    default:
      return "";
  }
}

std::string TransferContradiction(const io::ImageFacts& facts, const Camera& camera) {
  const std::string stated = StatedTransferName(facts);
  const TransferCurve& described = camera.sensor.transfer;
  if (stated.empty()) return "";
  const auto curve = StatedTransferOf(facts);
  const double expected = ExponentOf(described);
  if (curve && std::abs(ExponentOf(*curve) - expected) <= kRoundedExponent * expected) return "";
  return fmt::format(
      "the file states the transfer curve {}, {} has sensor.transfer: {}; the camera file's is "
      "used; if the file is right, correct the camera file",
      stated, camera.source.empty() ? fmt::format("camera '{}'", camera.name) : camera.source,
      described.Name());
}

}  // namespace thicklens

#include "model/simulate/scene/sampling_plan.h"

#include <algorithm>
#include <cmath>

namespace thicklens::model {
namespace {

constexpr int kMin = 16;

double ErrorAt(const EffectSite& place, const SamplingSpread& spread, const TransferCurve& transfer,
               int rays) {
  const double dark = std::clamp(place.dark, 0.0, 1.0);
  const double bright = std::clamp(place.bright, dark, 1.0);
  const double fall = static_cast<double>(kMin) / rays;
  const double of_irradiance =
      0.06 * 255 *
      (transfer.Encode(bright) - transfer.Encode(bright * (1 - std::min(spread.irradiance, 1.0)))) *
      std::pow(fall, 0.85);
  if (!(bright > dark)) return of_irradiance;
  const double range = 255 * (transfer.Encode(bright) - transfer.Encode(dark));
  const double encoded_per_light = range / (bright - dark);
  if (place.jump > 0) {
    const double jump = encoded_per_light * place.jump;
    return of_irradiance +
           std::hypot(0.026 * range, std::min(0.065 * jump * spread.defocus_px, 0.08 * range)) *
               std::pow(fall, 0.7);
  }
  const double slope = encoded_per_light * place.slope;
  const double aside = std::min(0.1 * slope * spread.airy_px, 0.05 * range);
  const double through = std::min(0.06 * slope * spread.defocus_px, 0.04 * range);
  return of_irradiance +
         std::hypot(0.02 * slope * spread.landing_px, through, aside) * std::pow(fall, 0.85);
}

}  // namespace

double SamplingError(const SceneBlock& block, const SamplingSpread& spread,
                     const TransferCurve& transfer, int rays) {
  double largest = 0;
  for (const EffectSite& place : block.places) {
    largest = std::max(largest, ErrorAt(place, spread, transfer, rays));
  }
  return largest;
}

int RaysWithin(const SceneBlock& block, const SamplingSpread& spread, const TransferCurve& transfer,
               double limit, int most) {
  if (!(limit > 0)) return most;
  for (int rays = kMin; rays < most; rays *= 2) {
    if (SamplingError(block, spread, transfer, rays) <= limit) return rays;
  }
  return most;
}

}  // namespace thicklens::model

#include "model/simulate/sensor_noise.h"

#include <cstddef>

#include "model/base/random_draws.h"
#include "thicklens/base/cancel.h"

namespace thicklens::model {
namespace {

constexpr std::size_t kValuesAtOnce = 4096;

}  // namespace

void AddSensorNoise(const SensorNoise& noise, const EffectSet& on, std::uint64_t seed,
                    std::uint32_t item, LinearImage* image) {
  const double full_well = noise.full_well_electrons;
  const bool shot = on.Has(Effect::kShotNoise);
  const bool read = on.Has(Effect::kReadNoise) && noise.read_noise_electrons > 0;
  if (!(full_well > 0) || !(shot || read)) return;
  RandomDraws shots(seed, RandomDraws::Purpose::kSensor, item);
  RandomDraws reads(seed, RandomDraws::Purpose::kReadout, item);
  std::size_t count = 0;
  for (float& light : image->values) {
    if (count++ % kValuesAtOnce == 0) ThrowIfCancelled();
    double electrons = static_cast<double>(light) * full_well;
    if (shot) electrons = shots.Poisson(electrons);
    if (read) electrons += noise.read_noise_electrons * reads.Normal();
    light = static_cast<float>(electrons / full_well);
  }
}

}  // namespace thicklens::model

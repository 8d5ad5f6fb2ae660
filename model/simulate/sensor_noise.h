#ifndef THICKLENS_MODEL_SIMULATE_SENSOR_NOISE_H_
#define THICKLENS_MODEL_SIMULATE_SENSOR_NOISE_H_

#include <cstdint>

#include "thicklens/model/effects.h"
#include "thicklens/model/scene.h"

namespace thicklens::model {

// Noise parameters of a sensor that counts electrons.
struct SensorNoise {
  double full_well_electrons = 0;  // at full scale; 0: unknown, no noise is added
  double read_noise_electrons = 0;
};

// Adds the Poisson noise of the mean light times full well and the Gaussian read noise, each if its
// effect (shot-noise, read-noise) is on. The random draws of each depend only on `seed` and `item`
// (a frame's index), whether or not the other is on.
void AddSensorNoise(const SensorNoise& noise, const EffectSet& on, std::uint64_t seed,
                    std::uint32_t item, LinearImage* image);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SENSOR_NOISE_H_

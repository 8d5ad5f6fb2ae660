#ifndef THICKLENS_MODEL_SIMULATE_SENSOR_NOISE_H_
#define THICKLENS_MODEL_SIMULATE_SENSOR_NOISE_H_

#include <cstdint>

#include "thicklens/model/effects.h"
#include "thicklens/model/scene.h"

namespace thicklens::model {

// Of a sensor that counts electrons.
struct SensorNoise {
  double full_well_electrons = 0;  // at full scale; 0: it is not known, and there is none
  double read_noise_electrons = 0;
};

// Poisson of the mean light times full well, plus the reading's Gaussian: those of shot-noise and
// read-noise that are on. The draws of each are those of seed and item (a frame's index) alone,
// whether the other is on or not.
void AddSensorNoise(const SensorNoise& noise, const EffectSet& on, std::uint64_t seed,
                    std::uint32_t item, LinearPicture* picture);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SENSOR_NOISE_H_

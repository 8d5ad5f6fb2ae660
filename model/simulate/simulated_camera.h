#ifndef THICKLENS_MODEL_SIMULATE_SIMULATED_CAMERA_H_
#define THICKLENS_MODEL_SIMULATE_SIMULATED_CAMERA_H_

#include <string>

#include "thicklens/model/camera.h"

namespace thicklens::model {

// Whether a simulation can take a camera for the truth: one with image distance and blur ratio
// that is focused at a finite depth, where views have their samples and a bench its scale and
// light.
bool IsSimulatable(const Camera& camera, std::string* why);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SIMULATED_CAMERA_H_

#ifndef THICKLENS_MODEL_SIMULATE_SIMULATED_CAMERA_H_
#define THICKLENS_MODEL_SIMULATE_SIMULATED_CAMERA_H_

#include <string>
#include <vector>

#include "thicklens/model/camera.h"

namespace thicklens::model {

// Returns true if a simulation can use a camera as the truth. The camera must have an image
// distance and a blur ratio, and its focus must be at a finite depth, at which views have their
// samples and a bench its scale and light. Otherwise sets `why` (may be null) and returns false.
bool IsSimulatable(const Camera& camera, std::string* why);

// Takes the distortion out of the camera of a simulation, which makes images of a lens without it.
// If the camera states one, `notices` gets a line that says so.
void TakeOutDistortion(Camera* camera, std::vector<std::string>* notices);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SIMULATED_CAMERA_H_

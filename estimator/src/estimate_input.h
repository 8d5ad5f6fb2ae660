#ifndef THICKLENS_ESTIMATOR_SRC_ESTIMATE_INPUT_H_
#define THICKLENS_ESTIMATOR_SRC_ESTIMATE_INPUT_H_

#include "thicklens/estimator/estimate.h"

namespace thicklens::estimator {

// Throws Error, naming field and value, unless an estimate can start from the input. A file must be
// named by whoever read it; here the numbers are.
void CheckInput(const EstimateInput& input);
// A light field of the input's sizes, without values of its own.
model::LightField FrameOf(const EstimateInput& input);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SRC_ESTIMATE_INPUT_H_

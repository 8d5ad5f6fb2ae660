#ifndef THICKLENS_ESTIMATOR_VIEWS_INPUT_CHECKS_H_
#define THICKLENS_ESTIMATOR_VIEWS_INPUT_CHECKS_H_

#include "thicklens/estimator/estimate_input.h"

namespace thicklens::estimator {

// Throws Error, naming field and value, unless an estimate can start from the input. The message
// names numbers only; the caller that read a file must name the file.
void CheckInput(const EstimateInput& input);
// Returns the light field that the input leads to, without its values.
model::LightField DescriptionOf(const EstimateInput& input);
// Returns DescriptionOf(input) with all values set to 0.
model::LightField FrameOf(const EstimateInput& input);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_VIEWS_INPUT_CHECKS_H_

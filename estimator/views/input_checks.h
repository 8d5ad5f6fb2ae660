#ifndef THICKLENS_ESTIMATOR_VIEWS_INPUT_CHECKS_H_
#define THICKLENS_ESTIMATOR_VIEWS_INPUT_CHECKS_H_

#include "thicklens/estimator/estimate_input.h"

namespace thicklens::estimator {

// Throws Error, naming field and value, unless an estimate can start from the input. A file must be
// named by whoever read it; here the numbers are.
void CheckInput(const EstimateInput& input);
// The light field that the input leads to, without its values.
model::LightField DescriptionOf(const EstimateInput& input);
// The same with values, all 0.
model::LightField FrameOf(const EstimateInput& input);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_VIEWS_INPUT_CHECKS_H_

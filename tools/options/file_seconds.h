#ifndef THICKLENS_TOOLS_OPTIONS_FILE_SECONDS_H_
#define THICKLENS_TOOLS_OPTIONS_FILE_SECONDS_H_

#include "thicklens/estimator/estimate_input.h"
#include "thicklens/estimator/time_model.h"

namespace thicklens::tools {

// Seconds that one thread needs to encode the files of all views. Encodes a file like a part of a
// view to measure how long that takes. 0 for numbers of channels that have no such files.
double FileSeconds(const estimator::EstimateInput& input);

// estimator::WorkloadOf with these seconds.
estimator::Workload MeasuredWorkload(const estimator::EstimateInput& input);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_FILE_SECONDS_H_

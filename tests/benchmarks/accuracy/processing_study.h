#ifndef THICKLENS_TESTS_BENCHMARKS_ACCURACY_PROCESSING_STUDY_H_
#define THICKLENS_TESTS_BENCHMARKS_ACCURACY_PROCESSING_STUDY_H_

#include <nlohmann/json.hpp>

#include "benchmarks/accuracy/trial.h"

namespace thicklens::accuracy {

// Measures what the processing in a camera does to kappa, and whether the frames show it: sweeps of
// case ii with three pairs of target and aperture, 320 x 240 px, are calibrated as they are, read
// with a wrong transfer curve, and after each kind of processing. There are `sweeps` sweeps of each
// pair. The change of kappa is that against the same sweep as it is. Prints the table as Markdown
// and returns it.
nlohmann::ordered_json RunProcessingStudy(const TrialSettings& settings, int sweeps, int threads);

}  // namespace thicklens::accuracy

#endif  // THICKLENS_TESTS_BENCHMARKS_ACCURACY_PROCESSING_STUDY_H_

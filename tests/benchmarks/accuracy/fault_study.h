#ifndef THICKLENS_TESTS_BENCHMARKS_ACCURACY_FAULT_STUDY_H_
#define THICKLENS_TESTS_BENCHMARKS_ACCURACY_FAULT_STUDY_H_

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "benchmarks/accuracy/trial.h"

namespace thicklens::accuracy {

// Dead leaves with one kind of damage to the whole sweep at a time, and the floor known: how far
// zf and kappa go, and how far beyond what the calibration states (2 sigma and the systematic
// interval). Prints a table per case.
nlohmann::ordered_json RunFaultStudy(const std::vector<std::string>& cases,
                                     const TrialSettings& settings, int threads);

}  // namespace thicklens::accuracy

#endif  // THICKLENS_TESTS_BENCHMARKS_ACCURACY_FAULT_STUDY_H_

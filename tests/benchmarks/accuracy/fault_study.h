#ifndef THICKLENS_TESTS_BENCHMARKS_ACCURACY_FAULT_STUDY_H_
#define THICKLENS_TESTS_BENCHMARKS_ACCURACY_FAULT_STUDY_H_

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "benchmarks/accuracy/trial.h"

namespace thicklens::accuracy {

// Calibrates dead leaves with one kind of damage to the whole sweep at a time and a known floor.
// Reports how far zf and kappa move, and by how much they leave the stated interval (2 sigma and
// the systematic interval). Prints one table per case.
nlohmann::ordered_json RunFaultStudy(const std::vector<std::string>& cases,
                                     const TrialSettings& settings, int threads);

}  // namespace thicklens::accuracy

#endif  // THICKLENS_TESTS_BENCHMARKS_ACCURACY_FAULT_STUDY_H_

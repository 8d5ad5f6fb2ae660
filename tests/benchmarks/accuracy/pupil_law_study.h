#ifndef THICKLENS_TESTS_BENCHMARKS_ACCURACY_PUPIL_LAW_STUDY_H_
#define THICKLENS_TESTS_BENCHMARKS_ACCURACY_PUPIL_LAW_STUDY_H_

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "benchmarks/accuracy/trial.h"

namespace thicklens::accuracy {

// Measures whether the intervals contain the truth whatever law the pupil follows. For each law,
// each case and both a given and an unknown bench offset, it calibrates `sweeps` sweeps of three
// aperiodic textures with floors drawn about the truth. A result is covered if the truth lies
// within its systematic interval widened by 2 sigma. Prints the table and returns it.
nlohmann::ordered_json RunPupilLawStudy(const std::vector<std::string>& cases,
                                        const TrialSettings& settings, int sweeps, int threads);

}  // namespace thicklens::accuracy

#endif  // THICKLENS_TESTS_BENCHMARKS_ACCURACY_PUPIL_LAW_STUDY_H_

#ifndef THICKLENS_TESTS_BENCHMARKS_ACCURACY_TABLES_H_
#define THICKLENS_TESTS_BENCHMARKS_ACCURACY_TABLES_H_

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "benchmarks/accuracy/summary.h"

namespace thicklens::accuracy {

// The trials that were run, in the order in which they are printed.
struct Run {
  TrialSettings settings;
  std::vector<std::string> cases;
  std::vector<model::TargetKind> targets;
  std::vector<Floor> floors;  // floors of the textures
  std::vector<Trial> trials;
};

// True if the texture has no period, so that the registration of its frames is unambiguous at any
// distance. A star is excluded as well, because it looks the same at each image scale.
bool IsAperiodic(model::TargetKind target);

// Prints the tables on the standard output and returns the same as JSON, with units in the keys:
// errors and failures per case and target, goals, coverage, and the smallest possible errors.
nlohmann::ordered_json PrintTables(const Run& run);

}  // namespace thicklens::accuracy

#endif  // THICKLENS_TESTS_BENCHMARKS_ACCURACY_TABLES_H_

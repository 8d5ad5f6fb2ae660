#ifndef THICKLENS_TESTS_BENCHMARKS_ACCURACY_TABLES_H_
#define THICKLENS_TESTS_BENCHMARKS_ACCURACY_TABLES_H_

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "benchmarks/accuracy/summary.h"

namespace thicklens::accuracy {

// What was run, in the order in which it is to be printed.
struct Run {
  TrialSettings settings;
  std::vector<std::string> cases;
  std::vector<model::TargetKind> targets;
  std::vector<Floor> floors;  // of the textures
  std::vector<Trial> trials;
};

// The texture has no period, so that its frames can be told apart wherever they lie. A star is left
// out as well: it looks the same at each image scale.
bool IsAperiodic(model::TargetKind target);

// Prints the tables on the standard output and gives back the same as JSON, units in the keys:
// errors and failures per case and target, goals, coverage, and what cannot be done better.
nlohmann::ordered_json PrintTables(const Run& run);

}  // namespace thicklens::accuracy

#endif  // THICKLENS_TESTS_BENCHMARKS_ACCURACY_TABLES_H_

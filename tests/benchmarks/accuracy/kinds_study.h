#ifndef THICKLENS_TESTS_BENCHMARKS_ACCURACY_KINDS_STUDY_H_
#define THICKLENS_TESTS_BENCHMARKS_ACCURACY_KINDS_STUDY_H_

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace thicklens::accuracy {

struct KindsOptions {
  std::string path;                // the kinds, configs/accuracy/benches.yaml
  std::vector<std::string> names;  // empty: all
  int sweeps = 60;                 // of each kind
  int mixtures = 0;                // sweeps with a random mixture of the disturbances, in addition
  std::uint64_t first_seed = 1;
  int threads = 0;
};

// Calibrates seeded sweeps of each kind and compares them with the truth and with the goals: the
// errors of zf and kappa, what the sigmas and the systematic intervals cover, the width of the
// intervals, silent errors and the reasons of refusals. Prints the table as Markdown and returns
// it. Throws Error for a file that is not valid.
nlohmann::ordered_json RunKindsStudy(const KindsOptions& options);

}  // namespace thicklens::accuracy

#endif  // THICKLENS_TESTS_BENCHMARKS_ACCURACY_KINDS_STUDY_H_

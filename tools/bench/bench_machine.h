#ifndef THICKLENS_TOOLS_BENCH_BENCH_MACHINE_H_
#define THICKLENS_TOOLS_BENCH_BENCH_MACHINE_H_

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace thicklens::tools {

// Returns the summary of a successful bench: its fields, and in `machine` the conditions of its
// times: processor, cores, build, BLAS, date.
nlohmann::json BenchSummary(nlohmann::json fields);

// Returns the memory bandwidth of `threads` threads in bytes per second, measured and counted as by
// the STREAM benchmark: a = b + 3 c reads two arrays and writes one, each far larger than any
// cache. The result is the best of a few runs.
double TriadBytesPerSecond(int threads);

double Median(std::vector<double> values);  // `values` must not be empty

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_BENCH_MACHINE_H_

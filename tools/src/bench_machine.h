#ifndef THICKLENS_TOOLS_BENCH_MACHINE_H_
#define THICKLENS_TOOLS_BENCH_MACHINE_H_

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace thicklens::tools {

// The summary of a bench that went well: its fields, and what times are to be read with, `machine`:
// processor, cores, build, BLAS, date.
nlohmann::json BenchSummary(nlohmann::json fields);
constexpr char kUnknownProcessor[] = "unknown";
std::string ProcessorName();  // or kUnknownProcessor

// Bytes a second that memory gives `threads` of them, as the STREAM benchmark does and counts it:
// of a = b + 3 c, two arrays read and one written, far larger than any cache. The best of a few
// runs.
double TriadBytesPerSecond(int threads);

double Median(std::vector<double> values);  // not empty

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_MACHINE_H_

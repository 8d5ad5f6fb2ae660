#include "tools/bench/bench_machine.h"

#include <algorithm>
#include <cstddef>
#include <string>
#include <thread>

#include "thicklens/base/parallel.h"
#include "thicklens/base/stopwatch.h"
#include "thicklens/base/utc_time.h"
#include "thicklens/estimator/blas.h"
#include "tools/system/build_info.h"
#include "tools/system/machine.h"

namespace thicklens::tools {
namespace {

void TriadOf(const float* b, const float* c, std::size_t count, float* a) {
  for (std::size_t i = 0; i < count; ++i) a[i] = b[i] + 3 * c[i];
}

}  // namespace

nlohmann::json BenchSummary(nlohmann::json fields) {
  fields["status"] = "ok";
  fields["reason"] = "";
  fields["machine"] = {{"processor", ProcessorName()},
                       {"cores", static_cast<int>(std::thread::hardware_concurrency())},
                       {"build", BuildInfo()},
                       {"blas", estimator::BlasDescription()},
                       {"date", NowIso8601()}};
  return fields;
}

double TriadBytesPerSecond(int threads) {
  constexpr std::size_t kCount = std::size_t{1} << 25U;
  constexpr int kParts = 64, kRuns = 5;
  std::vector<float> a(kCount), b(kCount, 1.0F), c(kCount, 2.0F);
  double best = 0;
  for (int run = 0; run < kRuns; ++run) {
    const Clock::time_point start = Clock::now();
    ParallelFor(kParts, threads, [&](int part) {
      constexpr std::size_t kOfPart = kCount / kParts;
      const std::size_t first = static_cast<std::size_t>(part) * kOfPart;
      TriadOf(b.data() + first, c.data() + first, kOfPart, a.data() + first);
    });
    const double seconds = SecondsSince(start);
    best = std::max(best, 3.0 * sizeof(float) * kCount / seconds);
  }
  return best;
}

double Median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : (values[middle - 1] + values[middle]) / 2;
}

}  // namespace thicklens::tools

// Benchmarks run in memory like the program's: in huge pages, and kept when it is freed.
#include <benchmark/benchmark.h>

#include "tools/system/program_memory.h"

int main(int argc, char** argv) {
  thicklens::tools::KeepFreedMemory();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}

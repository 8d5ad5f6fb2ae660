// Benchmarks use memory as the program does: in huge pages, which are kept when they are freed.
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

#ifndef THICKLENS_TOOLS_OPTIONS_BENCH_OPTIONS_H_
#define THICKLENS_TOOLS_OPTIONS_BENCH_OPTIONS_H_

#include <CLI/CLI.hpp>
#include <cstdint>

namespace thicklens::tools {

// Options that several benches share.
void AddRepeatOption(CLI::App* command, int* repeat);
void AddSeedOption(CLI::App* command, std::uint64_t* seed);
// Adds the size of a square simulated image of at least `least` px.
void AddSizeOption(CLI::App* command, int least, int* size_px);
// Adds one number of views for across and down.
void AddSquareViewsOption(CLI::App* command, int* views);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_BENCH_OPTIONS_H_

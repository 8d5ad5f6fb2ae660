#include "tools/options/bench_options.h"

namespace thicklens::tools {

void AddRepeatOption(CLI::App* command, int* repeat) {
  command->add_option("--repeat", *repeat, "Number of runs of each; the median is reported")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str()
      ->type_name("N");
}

void AddSeedOption(CLI::App* command, std::uint64_t* seed) {
  command->add_option("--seed", *seed, "Seed of the texture and the noise")
      ->capture_default_str()
      ->type_name("N");
}

void AddSizeOption(CLI::App* command, int least, int* size_px) {
  command->add_option("--size-px", *size_px, "Side of the simulated image")
      ->check(CLI::Range(least, 4096))
      ->capture_default_str()
      ->type_name("PX");
}

void AddSquareViewsOption(CLI::App* command, int* views) {
  command->add_option("--views", *views, "Number of views across and down")
      ->check(CLI::Range(2, 31))
      ->capture_default_str()
      ->type_name("N");
}

}  // namespace thicklens::tools

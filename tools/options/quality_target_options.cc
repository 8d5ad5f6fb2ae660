#include "tools/options/quality_target_options.h"

#include <fmt/format.h>

#include "tools/options/option_values.h"

namespace thicklens::tools {
std::string QualityTargetText(const estimator::QualityTarget& target) {
  std::string text;
  const auto add = [&](const std::string& option) { text += (text.empty() ? "" : " ") + option; };
  if (!target.quality.empty()) add("--quality " + target.quality);
  if (target.within_s) add(fmt::format("--within {:g}s", *target.within_s));
  if (target.psnr_loss_db) add(fmt::format("--psnr-loss {:g}dB", *target.psnr_loss_db));
  return text;
}

void AddQualityTargetOptions(CLI::App* command, estimator::QualityTarget* target) {
  CLI::Option* quality =
      command
          ->add_option(
              "--quality", target->quality,
              "Choose the solver by quality. draft: the fastest plan with half of the "
              "gain of the best plan over warping; standard: nine tenths; best. This option, "
              "--within and --psnr-loss replace the options of the solver, --prior, "
              "--strength, --check-blur, --photo and --device")
          ->check(CLI::IsMember({"draft", "standard", "best"}))
          ->type_name("NAME");
  CLI::Option* within = AddNumberWithUnit(command, "--within", "s", "2s",
                                          "Choose the most accurate solver that is expected to "
                                          "finish in that time, including reading and writing",
                                          &target->within_s);
  CLI::Option* loss =
      AddNumberWithUnit(command, "--psnr-loss", "dB", "0.1dB",
                        "Choose the fastest solver that is expected to lose no more PSNR than this "
                        "against the best one; can be combined with --within",
                        &target->psnr_loss_db);
  quality->excludes(within)->excludes(loss);
}

void ExcludeSolverOptions(CLI::App* command) {
  for (const char* chosen :
       {"--solver", "--prior", "--strength", "--check-blur", "--photo", "--tolerance",
        "--max-iterations", "--double", "--gamma", "--ridge", "--block-solver", "--block-px",
        "--stencil", "--splat", "--checkpoint", "--device"}) {
    for (const char* target : {"--quality", "--within", "--psnr-loss"}) {
      command->get_option(target)->excludes(command->get_option(chosen));
    }
  }
}

}  // namespace thicklens::tools

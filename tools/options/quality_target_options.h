#ifndef THICKLENS_TOOLS_OPTIONS_QUALITY_TARGET_OPTIONS_H_
#define THICKLENS_TOOLS_OPTIONS_QUALITY_TARGET_OPTIONS_H_

#include <CLI/CLI.hpp>
#include <string>

#include "thicklens/estimator/plan_choice.h"

namespace thicklens::tools {

// Returns the target as on the command line: "--within 2s --psnr-loss 0.1dB".
std::string QualityTargetText(const estimator::QualityTarget& target);

// Adds --quality, --within and --psnr-loss.
void AddQualityTargetOptions(CLI::App* command, estimator::QualityTarget* target);
// Makes them exclude the options of the solver, once all have been added.
void ExcludeSolverOptions(CLI::App* command);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_QUALITY_TARGET_OPTIONS_H_

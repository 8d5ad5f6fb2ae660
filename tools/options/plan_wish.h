#ifndef THICKLENS_TOOLS_OPTIONS_PLAN_WISH_H_
#define THICKLENS_TOOLS_OPTIONS_PLAN_WISH_H_

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

namespace thicklens::tools {

// The user's wish that replaces the choice of a solver.
struct PlanWish {
  std::string quality;                 // "draft", "standard", "best"; empty: not given
  std::optional<double> within_s;      // limit for the whole program
  std::optional<double> psnr_loss_db;  // relative to the best plan of the profile

  bool IsMade() const { return !quality.empty() || within_s || psnr_loss_db; }
  std::string Text() const;  // text as on the command line
};

// Adds --quality, --within and --psnr-loss. Call it after the options of the solver, which they
// exclude.
void AddPlanWishOptions(CLI::App* command, PlanWish* wish);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_PLAN_WISH_H_

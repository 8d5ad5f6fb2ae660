#ifndef THICKLENS_TOOLS_PLAN_WISH_H_
#define THICKLENS_TOOLS_PLAN_WISH_H_

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

namespace thicklens::tools {

// What a person asks for in place of a solver.
struct PlanWish {
  std::string quality;                 // "draft", "standard", "best"; empty: not said
  std::optional<double> within_s;      // of the whole program
  std::optional<double> psnr_loss_db;  // against the best of the profile

  bool IsMade() const { return !quality.empty() || within_s || psnr_loss_db; }
  std::string Text() const;  // as on the command line
};

// --quality, --within and --psnr-loss. Call it after the options of the solver, which they exclude.
void AddPlanWishOptions(CLI::App* command, PlanWish* wish);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_PLAN_WISH_H_

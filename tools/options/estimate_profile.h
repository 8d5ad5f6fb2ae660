#ifndef THICKLENS_TOOLS_OPTIONS_ESTIMATE_PROFILE_H_
#define THICKLENS_TOOLS_OPTIONS_ESTIMATE_PROFILE_H_

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tools/options/estimate_plan.h"
#include "tools/options/time_law.h"

namespace thicklens::tools {

// Measurements of one plan.
struct PlanProfile {
  EstimatePlan plan;
  TimeLaw law;
  // Relative errors of the times that the law predicts, including the reading time, for images of
  // sizes that the law was not made from: the median and the maximum.
  double median_error = 0, largest_error = 0;
  double psnr_db = 0;  // of the true views, mean over scenes and views
};

// The plans that `estimate` can choose from and their costs, measured once on one machine. File
// format: docs/file-formats.md.
struct EstimateProfile {
  std::string processor, build, date;  // build: as of `thicklens --version`
  int threads = 1;
  int runs = 1;              // runs of each plan and image; the laws use the median
  double probe_seconds = 0;  // ProbeSeconds() on that machine
  double warping_psnr_db = 0;
  // Maximum of each quantity over the measured images.
  PictureLoad largest;
  std::vector<PlanProfile> plans;
  std::string from;     // the file it was read from, or "the profile that ships"
  bool is_own = false;  // measured by the user, not the default profile

  double best_psnr_db() const;
  // Returns whether this build measured it on such a machine with `threads_here` threads.
  bool IsFromHere(int threads_here) const;
  double LossDb(const PlanProfile& plan) const { return best_psnr_db() - plan.psnr_db; }
};

nlohmann::json ProfileJson(const EstimateProfile& profile);
// Throws Error that names the file and the field.
EstimateProfile ReadProfile(const std::string& path);
// Returns the default profile of the program.
EstimateProfile DefaultProfile();

// Path of the user's own profile: $XDG_CONFIG_HOME/thicklens/profile.json, or the same below
// ~/.config. Empty if neither is known.
std::string UserProfilePath();
// Reads the named file, otherwise the user's own profile, otherwise the default profile.
EstimateProfile ProfileFor(const std::string& path);

// Seconds that an estimate of 256 x 256 px takes here and now with `threads` threads: the best of
// three, or of as many as start within 0.4 s.
double ProbeSeconds(int threads);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_ESTIMATE_PROFILE_H_

#ifndef THICKLENS_TOOLS_ESTIMATE_PROFILE_H_
#define THICKLENS_TOOLS_ESTIMATE_PROFILE_H_

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "estimate_plan.h"
#include "time_law.h"

namespace thicklens::tools {

// What is known of one plan.
struct PlanProfile {
  EstimatePlan plan;
  TimeLaw law;
  // Of what the law foresees, with the time that reading took, of pictures of sizes that it was not
  // made from, over what they took: the middle one of the relative errors, and the largest.
  double median_error = 0, largest_error = 0;
  double psnr_db = 0;  // of the true views, mean over scenes and views
};

// What `estimate` can choose from, and what it costs: measured once on one machine. File format:
// docs/file-formats.md.
struct EstimateProfile {
  std::string processor, build, date;  // build: as of `thicklens --version`
  int threads = 1;
  int runs = 1;              // of each plan and picture: the middle one is in the laws
  double probe_seconds = 0;  // of ProbeSeconds() there
  double warping_psnr_db = 0;
  // Of the pictures that were measured, the most of each.
  PictureLoad largest;
  std::vector<PlanProfile> plans;
  std::string from;     // the file it was read from, or "the profile that ships"
  bool is_own = false;  // somebody's measurement, and not the one that ships

  double best_psnr_db() const;
  // Whether it was measured by this build on such a machine with so many threads.
  bool IsFromHere(int threads_here) const;
  double LossDb(const PlanProfile& plan) const { return best_psnr_db() - plan.psnr_db; }
};

nlohmann::json ProfileJson(const EstimateProfile& profile);
// Throws Error that names the file and the field.
EstimateProfile ReadProfile(const std::string& path);
// The one that ships with the program.
EstimateProfile DefaultProfile();

// Where a person's own profile lies: $XDG_CONFIG_HOME/thicklens/profile.json, or the same below
// ~/.config. Empty if neither is known.
std::string UserProfilePath();
// The file that is named, else the person's own, else the one that ships.
EstimateProfile ProfileFor(const std::string& path);

// Seconds that an estimate of 256 x 256 px takes here, now, with so many threads: the best of
// three, or of as many as begin within .4 s.
double ProbeSeconds(int threads);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_ESTIMATE_PROFILE_H_

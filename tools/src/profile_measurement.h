#ifndef THICKLENS_TOOLS_PROFILE_MEASUREMENT_H_
#define THICKLENS_TOOLS_PROFILE_MEASUREMENT_H_

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "estimate_profile.h"

namespace thicklens::tools {

// A simulated picture that tells the terms of the law apart.
struct ProfileCase {
  enum class Use {
    kTime,          // a point of the law
    kTimeAndViews,  // judged, too: true views of large ones take longer to simulate than all else
    kCheck,         // larger than any of these, for the law to be held against
  };
  int size_px = 0;
  int views = 0;  // across and down
  bool colour = false;
  bool cards = false;   // else a slanted plane
  double aperture = 1;  // of BenchCamera's
  Use use = Use::kTime;
};
const std::vector<ProfileCase>& UsualProfileCases();

struct ProfileRun {
  std::vector<ProfileCase> cases = UsualProfileCases();  // one of them judged, at least
  int threads = 0;
  int repeat = 3;
  std::uint64_t seed = 1;
  std::string program;                                // thicklens; empty: the file that runs
  std::function<void(int done, int total)> progress;  // may throw to stop
};

// A profile, and what it was made from.
struct MeasuredProfile {
  EstimateProfile profile;
  std::vector<std::vector<TimedLoad>> loads;  // of each plan
  // Pictures that are larger than all of these, for the law to be held against.
  std::vector<std::vector<TimedLoad>> checks;
  int judged = 0;  // of the loads
};

// Runs `thicklens estimate` with each plan, from files to files in a folder of temporary files, on
// simulated pictures of several sizes, channels, numbers of views and strengths of blur, whose true
// views are known: slanted planes and cards before a wall. Each run is a process of its own, as a
// person's is: in one that has run before, memory is there already, which is a good part of the
// time of a small picture. Throws Error.
MeasuredProfile MeasureProfile(const std::vector<EstimatePlan>& plans, const ProfileRun& run);

// What of the plans is worth a choice: by the list of `bench accuracy` grid and blocks cost many
// times as much for less.
std::vector<EstimatePlan> PlansOfProfile();

std::string ProfileTable(const MeasuredProfile& measured);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_PROFILE_MEASUREMENT_H_

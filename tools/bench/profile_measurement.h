#ifndef THICKLENS_TOOLS_BENCH_PROFILE_MEASUREMENT_H_
#define THICKLENS_TOOLS_BENCH_PROFILE_MEASUREMENT_H_

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tools/options/estimate_profile.h"

namespace thicklens::tools {

// A simulated image that separates the terms of the time model.
struct ProfileCase {
  enum class Use {
    kTime,  // a point of the time model
    // also judged: simulating the true views of large images takes longer than everything else
    kTimeAndViews,
    kCheck,  // larger than the images of the other uses, to check the time model
  };
  int size_px = 0;
  int views = 0;  // across and down
  bool colour = false;
  bool cards = false;   // otherwise a slanted plane
  double aperture = 1;  // factor of the aperture of BenchCamera
  Use use = Use::kTime;
};
const std::vector<ProfileCase>& UsualProfileCases();

struct ProfileRun {
  std::vector<ProfileCase> cases = UsualProfileCases();  // at least one of them judged
  int threads = 0;
  int repeat = 3;
  std::uint64_t seed = 1;
  std::string program;  // path of thicklens; empty: the running program
  std::function<void(int done, int total)> progress;  // may throw to stop
};

// A profile, and the measurements that it was made from.
struct MeasuredProfile {
  estimator::EstimateProfile profile;
  std::vector<std::vector<estimator::TimedWorkload>> loads;  // one list for each plan
  // Images that are larger than all in `loads`, to check the time model.
  std::vector<std::vector<estimator::TimedWorkload>> checks;
  int judged = 0;  // number of judged loads
};

// Runs `thicklens estimate` with each plan, from files to files in a temporary folder, on simulated
// images of several sizes, channels, numbers of views and strengths of blur, whose true views are
// known: slanted planes, and cards in front of a wall. Each run is a process of its own, as for a
// user: a process that has run before already holds memory, and getting it takes a good part of the
// time of a small image. Throws Error.
MeasuredProfile MeasureProfile(const std::vector<estimator::EstimatePlan>& plans,
                               const ProfileRun& run);

// Returns the plans that are worth a choice: by the list of `bench accuracy`, grid and blocks cost
// many times as much and give less.
std::vector<estimator::EstimatePlan> PlansOfProfile();

std::string ProfileTable(const MeasuredProfile& measured);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_PROFILE_MEASUREMENT_H_

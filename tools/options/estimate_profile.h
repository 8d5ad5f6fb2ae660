#ifndef THICKLENS_TOOLS_OPTIONS_ESTIMATE_PROFILE_H_
#define THICKLENS_TOOLS_OPTIONS_ESTIMATE_PROFILE_H_

#include <nlohmann/json.hpp>
#include <string>

#include "thicklens/estimator/estimate_profile.h"

namespace thicklens::tools {

// Returns whether this build measured the profile on such a machine with `threads_here` threads.
bool IsFromHere(const estimator::EstimateProfile& profile, int threads_here);

nlohmann::json ProfileJson(const estimator::EstimateProfile& profile);
// Throws Error that names the file and the field.
estimator::EstimateProfile ReadProfile(const std::string& path);
// Returns the default profile of the program.
estimator::EstimateProfile DefaultProfile();

// Path of the user's own profile: $XDG_CONFIG_HOME/thicklens/profile.json, or the same below
// ~/.config. Empty if neither is known.
std::string UserProfilePath();
// Reads the named file, otherwise the user's own profile, otherwise the default profile.
estimator::EstimateProfile ProfileFor(const std::string& path);

// Seconds that an estimate of 256 x 256 px takes here and now with `threads` threads: the best of
// three, or of as many as start within 0.4 s.
double ProbeSeconds(int threads);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_ESTIMATE_PROFILE_H_

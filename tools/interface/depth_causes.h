#ifndef THICKLENS_TOOLS_INTERFACE_DEPTH_CAUSES_H_
#define THICKLENS_TOOLS_INTERFACE_DEPTH_CAUSES_H_

#include <string>

#include "thicklens/base/error.h"
#include "thicklens/depth.h"
#include "tools/interface/run_scope.h"

namespace thicklens {

// Returns what in the map itself may be the reason why its depths are impossible, with the remedy:
// another sign, compression, a relative map, or values beyond the one that stands for the near
// depth. Empty if it has none of these signs.
std::string CauseInMap(const DepthMap& map, const RunScope& run);

// Returns what is wrong with values beyond the one that DepthReadOptions::near_mm belongs to, and
// the scale that is probably meant; empty if there are none.
std::string ValuesBeyondNear(const DepthMap& map, const RunScope& run);

// Returns the text of an error with its cause: behind it, but in front of it, behind the map's
// name, if the map is compressed with losses, since the unit that the error doubts is then the less
// likely cause.
std::string WithCause(const DepthMap& map, const std::string& error, const std::string& cause);

// Runs `work`; the Error by which it refuses the map also names the cause in the map, if there is
// one.
template <typename Work>
auto NamingCauseInMap(const DepthMap& map, const RunScope& run, const Work& work) {
  try {
    return work();
  } catch (const Interrupted&) {
    throw;
  } catch (const OptionError&) {
    throw;
  } catch (const Error& error) {
    const std::string cause = CauseInMap(map, run);
    if (cause.empty()) throw;
    throw Error(WithCause(map, error.what(), cause));
  }
}

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_DEPTH_CAUSES_H_

#ifndef THICKLENS_TOOLS_SIMULATED_SWEEP_H_
#define THICKLENS_TOOLS_SIMULATED_SWEEP_H_

#include <opencv2/core/mat.hpp>

#include "thicklens/model/sweep_file.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::tools {

// The user's own picture in linear light; empty for other targets. Throws Error.
model::LinearPicture ReadTargetPicture(const model::TargetOptions& target);

// The sweep as the person at the bench would describe it; paths as seen from its own folder.
model::SweepFile DescribeSweep(const model::SweepSimulationOptions& simulation,
                               const model::SweepSimulator& simulator, bool unknown_offset);

// A picture as it would come out of its file.
cv::Mat AsFile(const model::StoredPicture& picture);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_SIMULATED_SWEEP_H_

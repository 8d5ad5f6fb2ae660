#ifndef THICKLENS_TOOLS_SIMULATED_SWEEP_H_
#define THICKLENS_TOOLS_SIMULATED_SWEEP_H_

#include <opencv2/core/mat.hpp>

#include "thicklens/model/sweep_file.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::tools {

// Reads the user's own image in linear light; empty for other targets. Throws Error.
model::LinearPicture ReadTargetPicture(const model::TargetOptions& target);

// Describes the sweep as a user at the bench would; paths are relative to the sweep's folder.
model::SweepFile DescribeSweep(const model::SweepSimulationOptions& simulation,
                               const model::SweepSimulator& simulator, bool unknown_offset);

// Returns an image as it would be read from its file.
cv::Mat AsFile(const model::StoredPicture& picture);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_SIMULATED_SWEEP_H_

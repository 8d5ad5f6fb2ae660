#ifndef THICKLENS_IO_SIMULATED_SWEEP_H_
#define THICKLENS_IO_SIMULATED_SWEEP_H_

#include <opencv2/core/mat.hpp>

#include "thicklens/base/export.h"
#include "thicklens/model/sweep_file.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::io {

// Reads the user's own image in linear light; empty for other targets. Throws Error.
THICKLENS_EXPORT model::LinearImage ReadTargetImage(const model::TargetOptions& target);

// Describes the sweep as a user at the bench would; paths are relative to the sweep's folder.
THICKLENS_EXPORT model::SweepFile DescribeSweep(const model::SweepSimulationOptions& simulation,
                                                const model::SweepSimulator& simulator,
                                                bool unknown_offset);

// Returns an image as it would be read from its file.
THICKLENS_EXPORT cv::Mat AsFile(const model::EncodedImage& image);

}  // namespace thicklens::io

#endif  // THICKLENS_IO_SIMULATED_SWEEP_H_

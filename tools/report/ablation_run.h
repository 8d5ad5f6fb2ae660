#ifndef THICKLENS_TOOLS_REPORT_ABLATION_RUN_H_
#define THICKLENS_TOOLS_REPORT_ABLATION_RUN_H_

#include <string>

#include "thicklens/model/scene_ablation.h"
#include "thicklens/model/sweep_ablation.h"
#include "tools/options/command_frame.h"
#include "tools/system/progress_line.h"

namespace thicklens::tools {

// Makes a run that shows its progress and ends when the user interrupts it.
model::AblationRun AblationRunWith(const CommonOptions& common, ProgressLine* progress);

// Runs model::AblateScene on the scene with the files that it names and with the estimate of the
// scene solver; without defocus the estimate is
// the photograph warped by its depth.
model::SceneAblation AblateSceneOf(const model::SceneSimulationOptions& scene,
                                   const model::AblationRun& run);

// Runs model::AblateSweep with calib::Calibrate for a simulation that was read from the file
// `path`; messages name the file. With `unknown_offset` the calibration also finds the offset of
// the bench.
model::SweepAblation AblateSweepOf(const std::string& path,
                                   const model::SweepSimulationOptions& sweep, bool unknown_offset,
                                   const model::AblationRun& run);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_ABLATION_RUN_H_

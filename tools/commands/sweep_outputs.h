#ifndef THICKLENS_TOOLS_COMMANDS_SWEEP_OUTPUTS_H_
#define THICKLENS_TOOLS_COMMANDS_SWEEP_OUTPUTS_H_

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "thicklens/base/output_file.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calibrate.h"
#include "thicklens/model/sweep_file.h"
#include "thicklens/run.h"
#include "tools/report/sweep_imaging.h"

namespace thicklens::tools {

// The files that `calibrate` makes of the frames of a sweep, besides the camera and the report:
// the all-in-focus image, the map of what is in focus where, and the measured PSF.

struct SweepOutputPaths {
  std::string image, focus_map, psf;  // empty: not asked for
};
void AddSweepOutputOptions(CLI::App* command, SweepOutputPaths* paths);
// Throws UsageError for a name whose ending stands for no kind of file that can have the content.
void CheckSweepOutputs(const SweepOutputPaths& paths);

// Throws UsageError for an output that is not made of the green sites of raw files.
void RequireFramesOfOutputs(const SweepOutputPaths& paths, model::SweepRaw raw);

// The files, claimed before anything is measured.
struct SweepOutputFiles {
  std::optional<OutputFile> image, focus_map, psf;
};
SweepOutputFiles ClaimSweepOutputs(const SweepOutputPaths& paths);

// Their contents; empty: there is none.
struct SweepOutputBytes {
  std::string image, focus_map, psf;
};
// Makes the contents that were asked for, the images of `sweep` and the PSF of `part`, which has
// the region that was calibrated, and describes them in `imaging`. The camera of the calibration
// gets the measured PSF with the name of its file as seen from `camera_output`. What cannot be made
// is a warning of the calibration.
void MakeSweepOutputs(const SweepOutputPaths& paths, const std::string& camera_output,
                      const calib::FocusSweep& sweep, const calib::FocusSweep& part,
                      const RunControl& control, Calibration* calibration, SweepImaging* imaging,
                      SweepOutputBytes* bytes);
void CommitSweepOutputs(const SweepOutputBytes& bytes, SweepOutputFiles* files);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_COMMANDS_SWEEP_OUTPUTS_H_

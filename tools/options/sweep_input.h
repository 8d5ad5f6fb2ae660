#ifndef THICKLENS_TOOLS_OPTIONS_SWEEP_INPUT_H_
#define THICKLENS_TOOLS_OPTIONS_SWEEP_INPUT_H_

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/calib/focus_sweep.h"
#include "thicklens/io/frame_files.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::tools {

// A sweep as the command line specifies it. Texts are as typed; empty: not given.
struct SweepArguments {
  std::string input;  // SWEEP.yaml, or a folder with `readings_csv`
  std::string readings_csv;
  std::string camera_path;
  std::string truth_path;
  std::string offset_mm;  // a number or "unknown"
  std::optional<double> offset_sigma_mm;
  std::string direction;
  std::optional<double> reading_sigma_mm;
  std::string floor_px;    // VALUE, VALUE:SIGMA or "unknown"
  std::string floor_from;  // a camera file
  std::string target;
  std::string roi;  // x,y,width,height

  // Returns the files that no output may replace.
  std::vector<std::string> Files() const;
};

struct SweepInput {
  model::SweepFile file;  // with the overrides of the command line
  calib::FocusSweep sweep;
  std::shared_ptr<io::FrameFiles> frame_files;
  std::optional<model::SweepTruth> truth;  // --truth, or truth.yaml beside the sweep's file
  std::vector<std::string> notices;        // one line each
};

// Reads the sweep's and the camera's file, and checks only that the frames exist. Throws Error, and
// UsageError for arguments that make no sense.
SweepInput ReadSweepInput(const SweepArguments& arguments);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_SWEEP_INPUT_H_

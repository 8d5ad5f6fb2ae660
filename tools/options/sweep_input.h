#ifndef THICKLENS_TOOLS_OPTIONS_SWEEP_INPUT_H_
#define THICKLENS_TOOLS_OPTIONS_SWEEP_INPUT_H_

#include <optional>
#include <string>
#include <vector>

#include "thicklens/run.h"
#include "thicklens/sweep.h"
#include "tools/options/interface_options.h"

namespace thicklens::tools {

// A sweep as the command line specifies it. Texts are as typed; empty: not given.
struct SweepArguments {
  std::string input;  // SWEEP.yaml, a folder with `readings_csv`, a stack or a video
  std::string readings_csv;
  std::string camera_path;
  std::string truth_path;
  std::string offset_mm;  // a number or "unknown"
  std::optional<double> offset_sigma_mm;
  std::string direction;
  std::string moves;  // "target", "camera", "lens" or "sensor"
  std::optional<double> reading_sigma_mm;
  // VALUE or VALUE:SIGMA
  std::string focus_depth_mm, working_distance_mm, image_distance_mm, tube_length_mm, magnification;
  std::optional<double> target_period_mm;
  std::string target_grid;  // PATTERN:COLUMNSxROWS:SQUARE_MM
  std::string grid_views;   // a folder
  std::optional<double> stage_alignment_deg;
  std::string floor_px;    // VALUE, VALUE:SIGMA or "unknown"
  std::string floor_from;  // a camera file
  std::string target;
  std::string roi;  // x,y,width,height
  std::optional<int> full_scale;
  std::string raw;  // "demosaiced" or "green"
  model::CorrectionFiles correction;
  std::string distortion;  // FILE, FILE:CAMERA or "none"
  model::ReadingOptions readings;
  model::VideoSelection video;

  // Returns the files that no output may replace.
  std::vector<std::string> Files() const;
};

// The statements of the command line. Throws UsageError for texts that make no sense.
SweepOverrides SweepOverridesOf(const SweepArguments& arguments);
// The options behind the members of SweepOverrides.
OptionNames SweepOptionNames();

// Reads the sweep's and the camera's file, and checks only that the frames exist. Messages name the
// options unless `run` says how to name them. Throws Error, and UsageError for arguments that make
// no sense.
Sweep ReadSweepInput(const SweepArguments& arguments, const RunControl& run = {});

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_SWEEP_INPUT_H_

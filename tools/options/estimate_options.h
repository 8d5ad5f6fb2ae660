#ifndef THICKLENS_TOOLS_OPTIONS_ESTIMATE_OPTIONS_H_
#define THICKLENS_TOOLS_OPTIONS_ESTIMATE_OPTIONS_H_

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/estimator/plan_choice.h"
#include "thicklens/model/sweep_file.h"
#include "tools/options/command_frame.h"
#include "tools/options/effect_options.h"
#include "tools/options/light_field_options.h"

namespace thicklens::tools {

// The command line of `thicklens estimate`. An empty or absent value was not given.
struct EstimateOptions {
  CommonOptions common;
  std::string image_path, depth_path, camera_path, output_folder, report_folder;
  DepthOptions depth;
  DepthFitOptions depth_fit;
  ViewsOption views;
  CropOption crop;
  std::string aperture_shape;
  std::string aperture_of;  // a light field whose views give the positions on the aperture
  int grid = 0;
  bool sparse = false;
  std::string sensor_origin;
  std::optional<double> lens_position;
  std::string distortion;    // FILE, FILE:CAMERA or "none"; empty: that of the camera file
  bool ignore_exif = false;  // for a photograph whose EXIF contradicts the camera file
  std::optional<double> st_depth_mm;
  model::CorrectionFiles correction;  // of the photograph
  std::string transfer;
  std::string orientation;  // "stored" or "displayed"
  std::string solver = "scene";
  std::optional<double> memory_limit_mib;
  bool keep_depth_noise = false;
  std::string refine_depth = "auto";
  std::string fill = "solver";  // or "telea"
  EffectOptions effects;
  std::string device = "auto";
  std::string store = "auto";   // views or scene; auto: scene unless another option asks for views
  std::string format = "auto";  // png, or tiff for a photograph with clipped highlights
  // Options of some solvers, as the help says.
  std::optional<std::string> prior, strength;
  bool check_blur = false;
  bool strict = false;               // refuse instead of a partial result
  std::optional<std::string> photo;  // captured, sharp or auto
  std::string clipped = "bounds";    // or data
  std::optional<double> tolerance;
  std::optional<int> max_iterations;
  bool double_precision = false;
  std::optional<std::string> block_solver, stencil, splat;
  std::optional<double> gamma, ridge;
  std::optional<int> block_px;
  std::string checkpoint_path;
  // A target that replaces the options above; a profile chooses them (empty path: the user's own
  // profile, or the default profile of the program).
  estimator::QualityTarget quality_target;
  std::string profile_path;

  bool by_blocks() const { return solver == "blocks"; }
  // Whether the light field is stored as its scene, and not as views.
  bool stores_scene() const;
  std::string report_path() const;  // path of the page in its folder; empty: none
};

void AddEstimateOptions(CLI::App* command, EstimateOptions* options);

// Throws UsageError for contradictory options: no given option is ignored silently.
void CheckEstimateUsage(const EstimateOptions& options);
// The part of CheckEstimateUsage for the solver's own options.
void CheckSolverUsage(const EstimateOptions& options);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_ESTIMATE_OPTIONS_H_

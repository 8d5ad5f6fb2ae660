#ifndef THICKLENS_TOOLS_ESTIMATE_OPTIONS_H_
#define THICKLENS_TOOLS_ESTIMATE_OPTIONS_H_

#include <CLI/CLI.hpp>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "commands.h"
#include "effect_options.h"
#include "light_field_options.h"
#include "plan_wish.h"
#include "thicklens/estimator/block_solver.h"
#include "thicklens/estimator/blur_check.h"
#include "thicklens/estimator/functional_solver.h"
#include "thicklens/estimator/scene_solver.h"

namespace thicklens::tools {

// The command line of `thicklens estimate`. What is empty or absent was not given.
struct EstimateOptions {
  CommonOptions common;
  std::string picture_path, depth_path, camera_path, output_folder, report_folder;
  DepthOptions depth;
  ViewsOption views;
  CropOption crop;
  std::string aperture_shape;
  std::string aperture_of;  // a light field whose views are those of the aperture
  int grid = 0;
  bool sparse = false;
  std::string sensor_origin;
  bool ignore_exif = false;  // of the photograph, where it contradicts the camera file
  std::optional<double> st_depth_mm;
  std::string transfer;
  std::string solver = "scene";
  std::optional<double> memory_limit_mib;
  bool keep_depth_noise = false;
  std::string fill = "solver";  // or "telea"
  EffectOptions effects{{}, {}, {}, "--effect-tolerance"};
  std::string device = "auto";
  std::string format = "png";
  // Of some solvers, as the help says.
  std::optional<std::string> prior, strength;
  bool check_blur = false;
  std::optional<double> tolerance;
  std::optional<int> max_iterations;
  bool double_precision = false;
  std::optional<std::string> block_solver, stencil, splat;
  std::optional<double> gamma, ridge;
  std::optional<int> block_px;
  std::string checkpoint_path;
  // In place of these: what it is to be like, chosen from a profile (empty: the person's own, or
  // the one that ships).
  PlanWish wish;
  std::string profile_path;

  bool by_blocks() const { return solver == "blocks"; }
  std::string report_path() const;  // of the page in its folder; empty: none
};

void AddEstimateOptions(CLI::App* command, EstimateOptions* options);

// Throws UsageError for what cannot be meant: nothing that is given is left out without a word.
void CheckEstimateUsage(const EstimateOptions& options);
// The part of it that speaks of the solver's own options.
void CheckSolverUsage(const EstimateOptions& options);

// What is given, and the solver's defaults else; `on`: the effects of the photograph that the
// solver is to take into account. Throws Error where that is not valid.
using Progress = std::function<void(int done, int total)>;
estimator::SceneOptions SceneOptionsOf(const EstimateOptions& options, const model::EffectSet& on,
                                       Progress progress);
estimator::BlurCheckOptions BlurCheckOptionsOf(const EstimateOptions& options,
                                               const model::EffectSet& on, Progress progress);
estimator::BlockOptions BlockOptionsOf(const EstimateOptions& options, const model::EffectSet& on,
                                       Progress progress);
estimator::FunctionalOptions FunctionalOptionsOf(const EstimateOptions& options,
                                                 const model::EffectSet& on, Progress progress);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_ESTIMATE_OPTIONS_H_

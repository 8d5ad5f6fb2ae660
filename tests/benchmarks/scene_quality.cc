// Measures the quality of light fields estimated from simulated scenes with noisy depth: the PSNR
// of all views against the truth, compared with that of the photograph warped by the same depth
// (DIBR).
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <exception>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/estimator/compare.h"
#include "thicklens/estimator/depth_noise.h"
#include "thicklens/estimator/estimate_checks.h"
#include "thicklens/estimator/scene_solver.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens {
namespace {

const std::vector<std::string> kScenes = {"in-focus", "slanted", "demo", "noise", "glossy"};

struct Arguments {
  std::vector<std::string> scenes = kScenes;
  std::vector<std::string> priors = {"tv"};
  std::vector<double> noises = {1};
  double depth_noise_px = 0.05;
  bool keep_depth_noise = false;
  int views = 7;
  int border_px = 8;
  int threads = 0;
  std::string json_path;
};

struct Row {
  std::string scene, prior;
  double noise_grey_levels = 0;
  double psnr_db = 0, dibr_psnr_db = 0, worst_gain_db = 0, seconds = 0;
  int views_above_dibr = 0, views = 0;
};

// Adds noise to the disparity, in px per view step, normal and independent from pixel to pixel.
void AddNoise(double sigma_px, std::uint64_t seed, estimator::DisparityMap* map) {
  const double step = map->step.cwiseAbs().maxCoeff();
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> normal(0, 1);
  for (float& disparity : map->disparity) {
    disparity += static_cast<float>(sigma_px / step * normal(engine));
  }
}

// One photograph, simulated with hundreds of rays per pixel, and its true views.
struct Simulated {
  estimator::EstimateInput input;
  model::LightField truth;
};
Simulated Simulate(const std::string& scene, double noise_grey_levels, const Arguments& arguments) {
  model::SceneSimulationOptions options = model::ReadSceneSimulation(
      std::string(THICKLENS_SOURCE_DIR "/configs/scenes/") + scene + ".yaml");
  options.noise_sigma_grey_levels = noise_grey_levels;
  const model::SceneSimulator simulator(options, {});
  const model::SceneRun run{arguments.threads, {}};
  Simulated simulated;
  simulated.truth = simulator.RenderLightField(arguments.views, arguments.views, run);
  estimator::EstimateInput& input = simulated.input;
  input.transfer = options.camera.sensor.transfer;
  input.image = model::ToLinear(simulator.Store(simulator.RenderNoiseless(run)), input.transfer);
  input.camera = options.camera;
  input.grid = simulated.truth.grid;
  input.weights = simulated.truth.weights;
  input.disparity = estimator::DisparityOnGrid(*input.grid, simulator.RenderDepth().values,
                                               input.image.width_px, input.image.height_px);
  AddNoise(arguments.depth_noise_px, options.seed, &input.disparity);
  const std::optional<double> found_px = estimator::DepthNoisePx(input.disparity);
  if (!arguments.keep_depth_noise && found_px && *found_px > estimator::kSmoothedNoisePx) {
    input.disparity = estimator::SmoothDepth(input.disparity, *found_px, arguments.threads).map;
  }
  return simulated;
}

Row Measure(const Simulated& simulated, const std::string& scene, double noise_grey_levels,
            const std::string& prior, const Arguments& arguments) {
  const estimator::EstimateInput& input = simulated.input;
  estimator::SceneOptions options;
  options.prior = estimator::PriorFromName(prior);
  estimator::SolverRun run;
  run.threads = arguments.threads;
  estimator::SceneSummary summary;
  const model::LightField estimate = estimator::EstimateScene(input, options, run, &summary);
  const estimator::DibrInput dibr{estimator::WithoutFalloff(input.image, *input.grid, *input.camera,
                                                            input.weights, arguments.threads),
                                  input.disparity};
  const estimator::LightFieldScores scores = estimator::CompareLightFields(
      simulated.truth, estimate, arguments.border_px, dibr, arguments.threads);
  Row row{scene, prior, noise_grey_levels};
  row.psnr_db = scores.mean.psnr_db;
  row.dibr_psnr_db = scores.dibr_mean->psnr_db;
  row.worst_gain_db = 1e9;
  row.views = static_cast<int>(scores.views.size());
  for (const estimator::ViewScores& view : scores.views) {
    const double gain_db = view.scores.psnr_db - view.dibr->psnr_db;
    row.worst_gain_db = std::min(row.worst_gain_db, gain_db);
    row.views_above_dibr += gain_db > 0 ? 1 : 0;
  }
  row.seconds = summary.setup_seconds + summary.solve_seconds + summary.views_seconds;
  return row;
}

void Print(const Row& row) {
  std::cout << fmt::format(
                   "| {:<8} | {:>5.1f} | {:<8} | {:>8.2f} | {:>6.2f} | {:>+6.2f} | {:>+6.2f} "
                   "| {:>3} of {:<3} | {:>5.2f} |\n",
                   row.scene, row.noise_grey_levels, row.prior, row.psnr_db, row.dibr_psnr_db,
                   row.psnr_db - row.dibr_psnr_db, row.worst_gain_db, row.views_above_dibr,
                   row.views, row.seconds)
            << std::flush;
}

nlohmann::json JsonOf(const Row& row, const Arguments& arguments) {
  return {{"scene", row.scene},
          {"noise_sigma_grey_levels", row.noise_grey_levels},
          {"depth_noise_px", arguments.depth_noise_px},
          {"prior", row.prior},
          {"psnr_db", row.psnr_db},
          {"dibr_psnr_db", row.dibr_psnr_db},
          {"worst_gain_db", row.worst_gain_db},
          {"views_above_dibr", row.views_above_dibr},
          {"views", {arguments.views, arguments.views}},
          {"seconds", row.seconds}};
}

void AddOptions(CLI::App* app, Arguments* arguments) {
  app->add_option("--scene", arguments->scenes, "of configs/scenes: " + CLI::detail::join(kScenes))
      ->check(CLI::IsMember(kScenes));
  app->add_option("--prior", arguments->priors, "of the solver (tv)");
  app->add_option("--noise", arguments->noises, "of the photograph, sigma in grey levels (1)")
      ->check(CLI::NonNegativeNumber);
  app->add_option("--depth-noise", arguments->depth_noise_px,
                  "of the depth, sigma in px of disparity per view step (0.05)")
      ->check(CLI::NonNegativeNumber);
  app->add_flag("--keep-depth-noise", arguments->keep_depth_noise,
                "does not smooth the depth, as `thicklens estimate` does");
  app->add_option("--views", arguments->views, "per axis (7)")->check(CLI::Range(2, 31));
  app->add_option("--border", arguments->border_px, "px that are left out (8)")
      ->check(CLI::Range(0, 60));
  app->add_option("--threads", arguments->threads, "0: one per core")->check(CLI::Range(0, 1024));
  app->add_option("--json", arguments->json_path, "writes the rows, too");
}

void Run(const Arguments& arguments) {
  nlohmann::json rows = nlohmann::json::array();
  std::cout << fmt::format("{0}x{0} views, depth noise {1:g} px per view step; PSNR in dB\n",
                           arguments.views, arguments.depth_noise_px)
            << "| scene    | noise | prior    | estimate |   DIBR |   gain |  worst | views above |"
               "     s |\n|---|---|---|---|---|---|---|---|---|\n";
  for (const std::string& scene : arguments.scenes) {
    for (const double noise : arguments.noises) {
      const Simulated simulated = Simulate(scene, noise, arguments);
      for (const std::string& prior : arguments.priors) {
        const Row row = Measure(simulated, scene, noise, prior, arguments);
        Print(row);
        rows.push_back(JsonOf(row, arguments));
      }
    }
  }
  if (arguments.json_path.empty()) return;
  std::ofstream out(arguments.json_path);
  out << nlohmann::json({{"rows", rows}}).dump(2) << "\n";
  if (!out) throw Error(arguments.json_path + ": cannot be written");
}

}  // namespace
}  // namespace thicklens

int main(int argc, char** argv) {
  CLI::App app{"Estimated light fields of simulated scenes against the truth"};
  thicklens::Arguments arguments;
  thicklens::AddOptions(&app, &arguments);
  CLI11_PARSE(app, argc, argv);
  try {
    thicklens::Run(arguments);
  } catch (const std::exception& error) {
    std::cerr << "error: " << error.what() << "\n";
    return 1;
  }
  return 0;
}

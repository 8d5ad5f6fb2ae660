#include "tools/report/estimate_summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <optional>
#include <utility>

#include "thicklens/base/printable_text.h"
#include "tools/system/peak_memory.h"

namespace thicklens::tools {
namespace {

using nlohmann::json;

constexpr double kEightBitLevels = 255;

std::string TransferFrom(const EstimateOptions& options) {
  if (!options.transfer.empty()) return "option";
  return options.camera_path.empty() ? "assumed" : "camera";
}

json PatchesJson(const std::vector<estimator::ResidualPatch>& patches) {
  json list = json::array();
  for (const estimator::ResidualPatch& patch : patches) {
    list.push_back({{"x_px", patch.x},
                    {"y_px", patch.y},
                    {"width_px", patch.width_px},
                    {"height_px", patch.height_px},
                    {"residual_rms", patch.rms}});
  }
  return list;
}

std::string NameOf(estimator::StrengthRule rule) {
  switch (rule) {
    case estimator::StrengthRule::kAuto:
      return "auto";
    case estimator::StrengthRule::kGcv:
      return "gcv";
    case estimator::StrengthRule::kGiven:
      break;
  }
  return "given";
}

void AddScene(const EstimateOptions& options, const EstimateOutcome& outcome, json* out) {
  const estimator::SceneSummary& scene = *outcome.scene;
  out->update({{"block_solver", nullptr},
               {"prior", estimator::PriorName(scene.prior)},
               {"strength", scene.strength},
               {"strength_rule", NameOf(SceneOptionsOf(options, {}, {}).strength_rule)},
               {"noise_sigma", scene.noise_sigma},
               {"device", scene.device},
               {"threads", scene.threads},
               {"predicted_memory_mib", scene.predicted_memory_mib},
               {"bands", scene.bands},
               {"iterations", scene.iterations},
               {"reweightings", scene.reweightings},
               {"converged", scene.converged},
               {"relative_residual", scene.relative_residual},
               {"rcond_min", nullptr},
               {"row_share", scene.row_share},
               {"occluded_fraction", scene.occluded_fraction},
               {"residual_rms", scene.residual_rms},
               {"residual_patches", PatchesJson(outcome.patches)},
               {"unexplained_share", nullptr},
               {"blur_check", nullptr}});
  if (outcome.blur) (*out)["blur_check"] = outcome.blur->Json();
  if (outcome.unexplained_share) (*out)["unexplained_share"] = *outcome.unexplained_share;
}

void AddBlocks(const EstimateOutcome& outcome, json* out) {
  const estimator::BlockSummary& blocks = *outcome.blocks;
  const model::LightFieldOrigin& origin = outcome.light_field.origin;
  // A direct solver has no iterations, and an iterative one no factorisation.
  json iterations, converged, rcond_min;
  if (blocks.rcond_min) {
    rcond_min = *blocks.rcond_min;
  } else {
    iterations = blocks.iterations;
    converged = blocks.converged;
  }
  out->update({{"block_solver", origin.block_solver},
               {"stencil", origin.stencil},
               {"splat", origin.splat},
               {"prior", "ridge"},
               {"strength", blocks.ridge},
               {"noise_sigma", nullptr},
               {"gamma", blocks.gamma},
               {"ridge", blocks.ridge},
               {"device", blocks.device},
               {"threads", blocks.threads},
               {"block_px", blocks.block_px},
               {"blocks", blocks.blocks.size()},
               {"blocks_from_checkpoint", blocks.blocks_from_store},
               {"predicted_memory_mib", blocks.predicted_memory_mib},
               {"iterations", iterations},
               {"converged", converged},
               {"relative_residual", blocks.relative_residual},
               {"rcond_min", rcond_min},
               {"row_share", nullptr},
               {"occluded_fraction", nullptr},
               {"residual_rms", nullptr}});
}

void AddFunctional(const estimator::FunctionalSummary& functional, json* out) {
  out->update({{"block_solver", nullptr},
               {"prior", "ridge"},
               {"strength", functional.ridge},
               {"noise_sigma", nullptr},
               {"gamma", functional.gamma},
               {"ridge", functional.ridge},
               {"device", "cpu"},
               {"threads", functional.threads},
               {"predicted_memory_mib", functional.predicted_memory_mib},
               {"iterations", functional.iterations},
               {"converged", functional.converged},
               {"relative_residual", functional.relative_residual},
               {"rcond_min", nullptr},
               {"row_share", nullptr},
               {"occluded_fraction", nullptr},
               {"residual_rms", nullptr}});
}

json InpaintingJson(const EstimateOutcome& outcome) {
  if (!outcome.inpainting) return nullptr;
  return {{"rays", outcome.inpainting->holes},
          {"filled", outcome.inpainting->filled},
          {"carried", outcome.inpainting->carried},
          {"views_visited", outcome.inpainting->views_visited},
          {"seconds", outcome.inpainting->seconds}};
}

// The end of a solver's iterations; a direct solver has none.
struct Iterations {
  int count = 0;
  bool converged = false;
  double relative_residual = 0;
};
std::optional<Iterations> IterationsOf(const EstimateOutcome& outcome) {
  const auto of = [](const auto& summary) {
    return Iterations{summary.iterations, summary.converged, summary.relative_residual};
  };
  if (outcome.scene) return of(*outcome.scene);
  if (outcome.functional) return of(*outcome.functional);
  if (outcome.blocks && !outcome.blocks->rcond_min) return of(*outcome.blocks);
  return std::nullopt;
}

std::string NotConverged(const Iterations& iterations) {
  return fmt::format(
      "not converged: the relative residual is {:.1e} after {} iterations; allow more "
      "(--max-iterations), or a larger residual (--tolerance)",
      iterations.relative_residual, iterations.count);
}

double HoleShare(const PreparedEstimate& prepared) {
  return static_cast<double>(prepared.depth.holes) /
         static_cast<double>(prepared.input.disparity.disparity.size());
}

std::string SolverText(const json& summary, const EstimateOutcome& outcome) {
  if (outcome.blocks) {
    const int found = outcome.blocks->blocks_from_store;
    return fmt::format(
        "solver       {} blocks of {} px{}, {} ({} stencil), gamma {:g}, ridge {:.3g}\n",
        summary["blocks"].get<int>(), summary["block_px"].get<int>(),
        found > 0 ? fmt::format(" ({} from the checkpoint)", found) : "",
        summary["block_solver"].get<std::string>(), summary["stencil"].get<std::string>(),
        summary["gamma"].get<double>(), summary["ridge"].get<double>());
  }
  if (outcome.functional) {
    return fmt::format("solver       {}: {}\n", summary["solver"].get<std::string>(),
                       outcome.functional->message);
  }
  const estimator::SceneSummary& scene = *outcome.scene;
  return fmt::format("solver       scene: {}\n", scene.message) +
         fmt::format("image        noise {:.2f} grey levels, residual {:.2f} (rms)\n",
                     kEightBitLevels * scene.noise_sigma, kEightBitLevels * scene.residual_rms);
}

std::string AccuracyText(const EstimateOutcome& outcome) {
  if (outcome.blocks && outcome.blocks->rcond_min) {
    return fmt::format("accuracy     relative residual {:.1e}, smallest rcond {:.1e}\n",
                       outcome.blocks->relative_residual, *outcome.blocks->rcond_min);
  }
  const Iterations iterations = IterationsOf(outcome).value_or(Iterations());
  return fmt::format("accuracy     relative residual {:.1e} after {} iterations{}\n",
                     iterations.relative_residual, iterations.count,
                     iterations.converged ? "" : ", not converged");
}

// The share of the calibrated blur that the samples of the aperture represent.
json ApertureBlurJson(const std::optional<estimator::ApertureBlur>& blur) {
  if (!blur) return nullptr;
  return {
      {"calibrated_sigma_mm", blur->calibrated_sigma_mm},
      {"sigma_mm", {blur->sigma_mm.x(), blur->sigma_mm.y()}},
      {"corner_change_percent", {100 * blur->corner_change.x(), 100 * blur->corner_change.y()}}};
}

std::string ApertureBlurText(const estimator::ApertureBlur& blur) {
  const auto along = [&](int axis, const char* name) {
    if (!(blur.sigma_mm[axis] > 0)) return fmt::format("none along {} (one view)", name);
    return fmt::format("{:.4g} mm along {} ({:+.2f} % in the corners)", blur.sigma_mm[axis], name,
                       100 * blur.corner_change[axis]);
  };
  return fmt::format("blur         aperture sigma {}, {}; calibrated {:.4g} mm\n", along(0, "u"),
                     along(1, "v"), blur.calibrated_sigma_mm);
}

std::string ConfidenceText(const estimator::ConfidenceShares& of_rays) {
  return fmt::format(
      "rays         {:.1f} % seen, {:.1f} % partly seen, {:.1f} % too blurred for details, {:.1f} "
      "% filled in\n",
      100 * of_rays.visible, 100 * of_rays.partly_visible, 100 * of_rays.blurred,
      100 * of_rays.filled_in);
}

std::string DepthText(const PreparedEstimate& prepared) {
  std::string text;
  if (prepared.depth.depth) {
    const model::DepthStatistics& depth = *prepared.depth.depth;
    text += fmt::format("depth        {:.6g} .. {:.6g} mm, median {:.6g} mm\n", depth.min_mm,
                        depth.max_mm, depth.median_mm);
  }
  const auto [least_px, most_px] = DisparityRangePx(prepared.input.disparity);
  text += fmt::format("disparity    {:.3f} .. {:.3f} px per view step\n", least_px, most_px);
  if (prepared.depth_noise_left_px) {
    text += fmt::format("depth noise  {:.3f} px per view step, smoothed along surfaces to {:.3f}\n",
                        *prepared.depth_noise_px, *prepared.depth_noise_left_px);
  }
  if (prepared.depth.holes > 0) {
    text += fmt::format("holes        {} px, filled along the surfaces around them ({:.1f} %)\n",
                        prepared.depth.holes, std::min(99.9, 100 * HoleShare(prepared)));
  }
  return text;
}

}  // namespace

void CheckOutcome(const PreparedEstimate& prepared, EstimateOutcome* outcome) {
  const estimator::DisparityMap& disparity = prepared.input.disparity;
  outcome->steps = estimator::CheckSteps(disparity, outcome->light_field.landing_step_px);
  outcome->depth_noise_px = prepared.depth_noise_px;
  outcome->depth_noise_left_px = prepared.depth_noise_left_px;
  if (!outcome->scene) return;
  outcome->patches = estimator::ResidualPatches(outcome->maps.residual,
                                                outcome->maps.occluded_fraction, disparity.width_px,
                                                disparity.height_px, outcome->scene->noise_sigma);
  outcome->unexplained_share = estimator::UnexplainedShare(
      outcome->maps.residual, outcome->maps.occluded_fraction, disparity.width_px,
      disparity.height_px, outcome->scene->noise_sigma);
}

std::vector<std::string> EstimateWarnings(const EstimateOptions& options,
                                          const PreparedEstimate& prepared,
                                          const EstimateOutcome& outcome) {
  std::vector<std::string> warnings;
  constexpr double kMaxHoles = 0.5;
  if (HoleShare(prepared) > kMaxHoles) {
    warnings.push_back(fmt::format(
        "{}: {} of its {} values are not depths: these areas are guessed from the "
        "others",
        options.depth_path, prepared.depth.holes, prepared.input.disparity.disparity.size()));
  }
  if (outcome.steps.share > 0) {
    warnings.push_back(
        fmt::format("{:.1f} % of the pixels move by more than {:g} px from view to view (up to "
                    "{:.1f} px): between such views the blur is sampled too coarsely{}",
                    100 * outcome.steps.share, estimator::kLargestStepPx, outcome.steps.largest_px,
                    options.camera_path.empty() ? "" : "; more --views make the steps smaller"));
  }
  const std::optional<double> noise_px =
      outcome.depth_noise_left_px ? outcome.depth_noise_left_px : outcome.depth_noise_px;
  if (noise_px && *noise_px > estimator::kLargestDepthNoisePx) {
    warnings.push_back(fmt::format(
        "{}: the depth has a noise of about {:.2f} px of disparity per view step{}; above {:g} px "
        "it costs more than the estimate gains; {}",
        options.depth_path, *noise_px, outcome.depth_noise_left_px ? " after smoothing" : "",
        estimator::kLargestDepthNoisePx,
        outcome.depth_noise_left_px ? "better depth is needed"
                                    : "without --keep-depth-noise it would be smoothed"));
  }
  const auto iterations = IterationsOf(outcome);
  if (iterations && !iterations->converged) warnings.push_back(NotConverged(*iterations));
  if (!outcome.patches.empty()) {
    const estimator::ResidualPatch& worst = outcome.patches.front();
    warnings.push_back(fmt::format(
        "{} patch(es) of the photograph are not explained, the worst at x {} .. {}, y {} .. {} px "
        "with a residual of {:.1f} grey levels (noise: {:.1f}): the depth is probably wrong there",
        outcome.patches.size(), worst.x, worst.x + worst.width_px - 1, worst.y,
        worst.y + worst.height_px - 1, kEightBitLevels * worst.rms,
        kEightBitLevels * outcome.scene->noise_sigma));
  }
  if (outcome.unexplained_share && *outcome.unexplained_share > estimator::kMaxUnexplained) {
    warnings.push_back(
        fmt::format("{:.0f} % of the photograph is not explained beyond its noise of {:.1f} grey "
                    "levels: most likely it is sharper than depth and aperture predict; {}",
                    100 * *outcome.unexplained_share, kEightBitLevels * outcome.scene->noise_sigma,
                    options.camera_path.empty() || options.depth.kind == "disparity"
                        ? "are --disparity-scale and --disparity-offset right?"
                        : "are the depth's unit, and the camera's aperture and focus, right?"));
  }
  constexpr double kUnexplained = 1.5;  // times the noise
  if (outcome.scene && !outcome.unexplained_share &&
      outcome.scene->residual_rms > kUnexplained * outcome.scene->noise_sigma) {
    warnings.push_back(fmt::format(
        "the photograph has a residual of {:.1f} grey levels (noise: {:.1f}), and the whole "
        "aperture sees hardly any part of it: the aperture is wide for an image of {} x {} px, or "
        "the depth is rough; which of them is unknown",
        kEightBitLevels * outcome.scene->residual_rms, kEightBitLevels * outcome.scene->noise_sigma,
        prepared.input.disparity.width_px, prepared.input.disparity.height_px));
  }
  const std::string blur = outcome.blur ? outcome.blur->Warning() : "";
  if (!blur.empty()) warnings.push_back(blur);
  return warnings;
}

json EstimateJson(const EstimateOptions& options, const PreparedEstimate& prepared,
                  const EstimateOutcome& outcome) {
  const model::LightField& light_field = outcome.light_field;
  const EstimateSeconds& seconds = outcome.seconds;
  const auto [least_px, most_px] = DisparityRangePx(prepared.input.disparity);
  const std::optional<Iterations> iterations = IterationsOf(outcome);
  const bool is_done = !iterations || iterations->converged;
  json out = {{"status", is_done ? "ok" : "partial"},
              {"reason", is_done ? "" : NotConverged(*iterations)},
              {"output", options.output_folder},
              {"solver", options.solver},
              {"views", {light_field.u_count, light_field.v_count}},
              {"size", {light_field.s_count, light_field.t_count}},
              {"channels", light_field.channels},
              {"transfer", prepared.input.transfer.Name()},
              {"transfer_from", TransferFrom(options)},
              {"aperture", prepared.aperture.Json()},
              {"exif", prepared.exif},
              {"seconds",
               {{"read", seconds.read},
                {"setup", seconds.setup},
                {"blur_check", seconds.blur_check},
                {"solve", seconds.solve},
                {"views", seconds.views},
                {"files", seconds.files},
                {"total", seconds.total}}},
              {"peak_rss_mib", PeakMemoryMib()},
              {"effects", light_field.origin.effects},
              {"effect_impacts", EffectsJson(prepared.effects)},
              {"holes_filled", prepared.depth.holes},
              {"holes_share", HoleShare(prepared)},
              {"clipped_fraction", outcome.clipped_fraction},
              {"rays",
               {{"visible_fraction", outcome.confidence.visible},
                {"partly_visible_fraction", outcome.confidence.partly_visible},
                {"blurred_share", outcome.confidence.blurred},
                {"filled_in_share", outcome.confidence.filled_in}}},
              {"disparity",
               {{"min_px", least_px},
                {"max_px", most_px},
                {"largest_step_px", outcome.steps.largest_px},
                {"coarse_share", outcome.steps.share},
                {"noise_px", nullptr},
                {"noise_left_px", nullptr}}},
              {"warnings", EstimateWarnings(options, prepared, outcome)}};
  if (outcome.depth_noise_px) out["disparity"]["noise_px"] = *outcome.depth_noise_px;
  if (outcome.depth_noise_left_px) {
    out["disparity"]["noise_left_px"] = *outcome.depth_noise_left_px;
  }
  if (prepared.depth.depth) {
    out["depth"] = {{"min_mm", prepared.depth.depth->min_mm},
                    {"median_mm", prepared.depth.depth->median_mm},
                    {"max_mm", prepared.depth.depth->max_mm}};
  }
  out["aperture_blur"] = ApertureBlurJson(prepared.aperture_blur);
  out["inpainting"] = InpaintingJson(outcome);
  if (outcome.scene) AddScene(options, outcome, &out);
  if (outcome.blocks) AddBlocks(outcome, &out);
  if (outcome.functional) AddFunctional(*outcome.functional, &out);
  return out;
}

std::string EstimateText(const PreparedEstimate& prepared, const EstimateOutcome& outcome,
                         const json& summary) {
  const model::LightField& light_field = outcome.light_field;
  const EstimateSeconds& seconds = outcome.seconds;
  std::string text = DepthText(prepared);
  text += fmt::format("light field  {} x {} views of {} x {} px, {} channel(s)\n",
                      light_field.u_count, light_field.v_count, light_field.s_count,
                      light_field.t_count, light_field.channels);
  text += fmt::format("aperture     {}\n", PrintableUtf8(prepared.aperture.InWords()));
  if (prepared.aperture_blur) text += ApertureBlurText(*prepared.aperture_blur);
  text += SolverText(summary, outcome);
  text += fmt::format("device       {}, {} thread(s)\n", summary["device"].get<std::string>(),
                      summary["threads"].get<int>());
  if (!prepared.effects.findings.empty()) text += EffectsText(prepared.effects);
  text += AccuracyText(outcome);
  if (outcome.blur) text += fmt::format("blur check   {}\n", outcome.blur->Summary());
  text += ConfidenceText(outcome.confidence);
  if (outcome.inpainting) text += fmt::format("inpainting   {}\n", outcome.inpainting->message);
  text += fmt::format(
      "time         {:.2f} s: set-up {:.2f}, {}solve {:.2f}, views {:.2f}, files {:.2f}\n",
      seconds.total, seconds.setup,
      outcome.blur ? fmt::format("blur check {:.2f}, ", seconds.blur_check) : "", seconds.solve,
      seconds.views, seconds.files);
  text += fmt::format("memory       {:.0f} MiB at most ({:.0f} predicted)\n",
                      summary["peak_rss_mib"].get<double>(),
                      summary["predicted_memory_mib"].get<double>());
  if (outcome.clipped_fraction > 0) {
    text += fmt::format(
        "clipped      {:.2f} % of the values in the files of the views (--format tiff keeps "
        "them)\n",
        100 * outcome.clipped_fraction);
  }
  return text;
}

}  // namespace thicklens::tools

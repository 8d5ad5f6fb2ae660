#include "tools/report/estimate_summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "thicklens/base/printable_text.h"
#include "tools/options/effect_options.h"
#include "tools/report/files_read_json.h"
#include "tools/system/peak_memory.h"

namespace thicklens::tools {
namespace {

using nlohmann::json;

constexpr double kEightBitLevels = 255;

template <typename Value>
json OrNull(const std::optional<Value>& value) {
  return value ? json(*value) : json();
}

json ApertureJson(const EstimateOptions& options, const EstimateDiagnostics& found) {
  return {{"shape", found.aperture_shape},
          {"from", found.aperture_from},
          {"views_of", options.aperture_of.empty() ? json() : json(options.aperture_of)}};
}

json ExifJson(const EstimateOptions& options, const EstimateDiagnostics& found) {
  if (!found.has_exif) return nullptr;
  json list = json::array();
  for (const ExifComparison& finding : found.exif) {
    list.push_back({{"quantity", finding.quantity},
                    {"photo", finding.photo},
                    {"camera", finding.camera},
                    {"verdict", ExifVerdictName(finding.verdict)},
                    {"remark", finding.remark}});
  }
  return {{"ignored", options.ignore_exif}, {"findings", list}};
}

json PatchesJson(const std::vector<UnexplainedPatch>& patches) {
  json list = json::array();
  for (const UnexplainedPatch& patch : patches) {
    list.push_back({{"x_px", patch.x},
                    {"y_px", patch.y},
                    {"width_px", patch.width_px},
                    {"height_px", patch.height_px},
                    {"residual_rms", patch.residual_rms}});
  }
  return list;
}

std::string NameOf(StrengthRule rule) {
  switch (rule) {
    case StrengthRule::kAuto:
      return "auto";
    case StrengthRule::kGcv:
      return "gcv";
    case StrengthRule::kGiven:
      break;
  }
  return "given";
}

json TrialJson(const estimator::BlurTrial& trial) {
  return {{"blur_scale", trial.blur_scale},
          {"focus_offset_px", trial.focus_offset_px},
          {"score", trial.score},
          {"unexplained", trial.unexplained},
          {"compared_share", trial.compared_share}};
}

// Returns {message, blocks, unexplained_blocks, size, halvings, seconds, evaluations: [..],
// proposal: {..} or null}.
json BlurCheckJson(const EstimateDiagnostics& found) {
  if (!found.blur_check) return nullptr;
  const estimator::BlurCheck& check = *found.blur_check;
  json out = {{"message", check.message},
              {"noise_sigma", check.noise_sigma},
              {"blocks", check.blocks},
              {"unexplained_blocks", check.unexplained_blocks},
              {"size", {check.width_px, check.height_px}},
              {"halvings", check.halvings},
              {"iterations", check.iterations},
              {"seconds", check.seconds},
              {"evaluations", json::array()},
              {"proposal", nullptr}};
  for (const estimator::BlurTrial& trial : check.trials) {
    out["evaluations"].push_back(TrialJson(trial));
  }
  if (const auto& proposed = found.blur_proposal.narrower_blur) {
    json blur = TrialJson(*check.narrower_blur);
    blur["at_end"] = check.narrower_blur_at_end;
    if (proposed->blur_ratio) blur["blur_ratio"] = *proposed->blur_ratio;
    if (proposed->disparity_scale) {
      blur["disparity_scale"] = *proposed->disparity_scale;
      blur["disparity_offset_px"] = *proposed->disparity_offset_px;
    }
    out["proposal"]["narrower_blur"] = blur;
  }
  if (const auto& proposed = found.blur_proposal.other_focus) {
    json focus = TrialJson(*check.other_focus);
    focus["at_end"] = check.other_focus_at_end;
    if (proposed->focus_depth_mm) focus["focus_depth_mm"] = *proposed->focus_depth_mm;  // inf: null
    if (proposed->disparity_offset_px) {
      focus["disparity_offset_px"] = *proposed->disparity_offset_px;
    }
    out["proposal"]["other_focus"] = focus;
  }
  return out;
}

// Returns null if it was not tested.
json FalloffJson(const EstimateDiagnostics& found) {
  if (!found.falloff) return nullptr;
  return {{"verdict", estimator::FalloffVerdictName(found.falloff->verdict)},
          {"message", found.falloff->message},
          {"share", found.falloff->share},
          {"sigma", found.falloff->sigma},
          {"darkest", found.falloff->darkest}};
}

// Returns {verdict, message, share, sigma, used_share, ..}; only used_share if it was stated.
json PhotoJson(const EstimateDiagnostics& found) {
  json out = {{"verdict", "not measured"}, {"used_share", found.used_photo_aperture}};
  if (!found.photo_aperture) return out;
  const estimator::PhotoAperture& photo = *found.photo_aperture;
  json regions = json::array();
  for (const estimator::PhotoAperture::Region& region : photo.regions) {
    regions.push_back({{"x_px", region.x},
                       {"y_px", region.y},
                       {"width_px", region.width_px},
                       {"height_px", region.height_px},
                       {"tiles", region.tiles},
                       {"predicted_sigma_px", region.predicted_sigma_px},
                       {"share", OrNull(region.share)},
                       {"sigma", OrNull(region.sigma)}});
  }
  out.update({{"verdict", estimator::PhotoVerdictName(photo.verdict)},
              {"message", photo.message},
              {"share", OrNull(photo.share)},
              {"sigma", OrNull(photo.sigma)},
              {"sigma_of_square", photo.sigma_of_square},
              {"evidence_against_captured", photo.evidence_against_captured},
              {"evidence_against_sharp", photo.evidence_against_sharp},
              {"tiles", photo.tiles},
              {"largest_sigma_px", photo.largest_sigma_px},
              {"regions", regions},
              {"seconds", photo.seconds}});
  return out;
}

// Returns {noise_sigma, trials: [{flip, residual_rms}, ..], better}, or null without a check.
json DepthFlipsJson(const EstimateDiagnostics& found) {
  if (!found.depth_flips) return nullptr;
  json trials = json::array();
  for (const estimator::DepthFlipTrial& trial : found.depth_flips->trials) {
    trials.push_back(
        {{"flip", model::DepthFlipName(trial.flip)}, {"residual_rms", trial.residual_rms}});
  }
  json better = nullptr;
  if (found.depth_flips->better) better = model::DepthFlipName(found.depth_flips->better->flip);
  return {{"noise_sigma", found.depth_flips->noise_sigma}, {"trials", trials}, {"better", better}};
}

json ContradictionJson(const EstimateDiagnostics& found) {
  if (!found.contradiction) return nullptr;
  const auto list = [](const std::vector<estimator::DepthCauseTrial>& trials) {
    json all = json::array();
    for (const estimator::DepthCauseTrial& trial : trials) {
      all.push_back({{"cause", estimator::DepthCauseName(trial.cause)},
                     {"scale", trial.scale},
                     {"offset_px", trial.offset_px},
                     {"shift_px", {trial.shift_x_px, trial.shift_y_px}},
                     {"edges_sigmas", OrNull(trial.edges)},
                     {"spectra_log_likelihood", OrNull(trial.spectra)},
                     {"spectra_sigma", OrNull(trial.spectra_sigma)},
                     {"residual_sigmas", OrNull(trial.residual)}});
    }
    return all;
  };
  const estimator::DepthContradiction& of = *found.contradiction;
  return {{"is_contradicted", of.is_contradicted},
          {"message", of.message},
          {"causes", list(of.causes)},
          {"is_sign_open", of.is_sign_open},
          {"trials", list(of.trials)},
          {"seconds", of.seconds}};
}

void AddScene(const LightFieldEstimate& estimate, json* out) {
  const EstimateDiagnostics& found = estimate.diagnostics;
  out->update({{"block_solver", nullptr},
               {"prior", estimate.summary.prior},
               {"strength_rule", NameOf(found.strength_rule.value_or(StrengthRule::kAuto))},
               {"noise_sigma", OrNull(found.noise_sigma)},
               {"compression_sigma", OrNull(found.compression_sigma)},
               {"bands", found.bands},
               {"reweightings", found.reweightings},
               {"residual_patches", PatchesJson(found.patches)},
               {"unexplained_share", OrNull(found.unexplained_share)},
               {"photo", PhotoJson(found)},
               {"blur_check", BlurCheckJson(found)},
               {"depth_flips", DepthFlipsJson(found)},
               {"contradiction", ContradictionJson(found)}});
}

void AddBlocks(const LightFieldEstimate& estimate, json* out) {
  const model::LightFieldOrigin& origin = estimate.light_field.origin;
  out->update({{"block_solver", origin.block_solver},
               {"stencil", origin.stencil},
               {"splat", origin.splat},
               {"block_px", OrNull(estimate.diagnostics.block_px)},
               {"blocks", estimate.blocks.size()},
               {"blocks_from_checkpoint", estimate.diagnostics.blocks_from_store}});
}

json InpaintingJson(const EstimateDiagnostics& found) {
  if (!found.inpainting) return nullptr;
  return {{"rays", found.inpainting->holes},
          {"filled", found.inpainting->filled},
          {"carried", found.inpainting->carried},
          {"views_visited", found.inpainting->views_visited},
          {"seconds", found.inpainting->seconds}};
}

// The share of the calibrated blur that the samples of the aperture represent.
json ApertureBlurJson(const EstimateDiagnostics& found) {
  if (!found.aperture_calibrated_sigma_mm) return nullptr;
  return {{"calibrated_sigma_mm", *found.aperture_calibrated_sigma_mm},
          {"sigma_mm", {found.aperture_sigma_mm.x(), found.aperture_sigma_mm.y()}},
          {"corner_change_percent",
           {100 * found.aperture_corner_change.x(), 100 * found.aperture_corner_change.y()}}};
}

std::string SolverText(const LightFieldEstimate& estimate) {
  const EstimateSummary& summary = estimate.summary;
  const EstimateDiagnostics& found = estimate.diagnostics;
  if (summary.solver == "blocks") {
    const model::LightFieldOrigin& origin = estimate.light_field.origin;
    const int kept = found.blocks_from_store;
    return fmt::format(
        "solver       {} blocks of {} px{}, {} ({} stencil), gamma {:g}, ridge {:.3g}\n",
        estimate.blocks.size(), found.block_px.value_or(0),
        kept > 0 ? fmt::format(" ({} from the checkpoint)", kept) : "", origin.block_solver,
        origin.stencil, found.gamma.value_or(0), found.ridge.value_or(0));
  }
  std::string text = fmt::format("solver       {}: {}\n", summary.solver, summary.message);
  if (found.noise_sigma && found.residual_rms) {
    const std::string compression = found.compression_sigma
                                        ? fmt::format(", error of JPEG compression {:.2f}",
                                                      kEightBitLevels * *found.compression_sigma)
                                        : "";
    text += fmt::format("photograph   noise {:.2f} grey levels{}, residual {:.2f} (rms)\n",
                        kEightBitLevels * *found.noise_sigma, compression,
                        kEightBitLevels * *found.residual_rms);
  }
  return text;
}

std::string AccuracyText(const EstimateSummary& summary) {
  const double residual = summary.relative_residual.value_or(0);
  if (summary.rcond_min) {
    return fmt::format("accuracy     relative residual {:.1e}, smallest rcond {:.1e}\n", residual,
                       *summary.rcond_min);
  }
  return fmt::format("accuracy     relative residual {:.1e} after {} iterations{}\n", residual,
                     summary.iterations.value_or(0), summary.converged ? "" : ", not converged");
}

std::string ApertureBlurText(const EstimateDiagnostics& found) {
  if (!found.aperture_calibrated_sigma_mm) return "";
  const auto along = [&](int axis, const char* name) {
    const double sigma_mm = found.aperture_sigma_mm[axis];
    if (!(sigma_mm > 0)) return fmt::format("none along {} (one view)", name);
    return fmt::format("{:.4g} mm along {} ({:+.2f} % at the corners of the image)", sigma_mm, name,
                       100 * found.aperture_corner_change[axis]);
  };
  return fmt::format(
      "blur         standard deviation of the light over the aperture {}, {}; calibrated {:.4g} "
      "mm\n",
      along(0, "u"), along(1, "v"), *found.aperture_calibrated_sigma_mm);
}

std::string ConfidenceText(const EstimateDiagnostics& found) {
  return fmt::format(
      "rays         {:.1f} % seen, {:.1f} % partly seen, {:.1f} % too blurred for details, {:.1f} "
      "% filled in\n",
      100 * found.rays_visible, 100 * found.rays_partly_visible, 100 * found.rays_blurred,
      100 * found.rays_filled_in);
}

std::string DepthText(const EstimateDiagnostics& found) {
  std::string text;
  if (found.depth) {
    text += fmt::format("depth        {:.6g} .. {:.6g} mm, median {:.6g} mm\n", found.depth->min_mm,
                        found.depth->max_mm, found.depth->median_mm);
  }
  const auto [least_px, most_px] = found.disparity_range_px;
  text += fmt::format("disparity    {:.3f} .. {:.3f} px per view step\n", least_px, most_px);
  if (found.depth_noise_left_px) {
    text += fmt::format("depth noise  {:.3f} px per view step, smoothed along surfaces to {:.3f}\n",
                        *found.depth_noise_px, *found.depth_noise_left_px);
  }
  if (found.depth_refinement && found.depth_refinement->applied)
    text += fmt::format("refined      {}\n", found.depth_refinement->message);
  if (found.holes_filled > 0) {
    text += fmt::format("holes        {} px, filled along the surfaces around them ({:.1f} %)\n",
                        found.holes_filled, std::min(99.9, 100 * found.holes_share));
    const std::string reasons = found.holes.InWords();
    if (!reasons.empty()) text += fmt::format("             {}\n", reasons);
  }
  return text;
}

json RefinementJson(const EstimateDiagnostics& found) {
  if (!found.depth_refinement) return nullptr;
  const estimator::DepthRefinement& refinement = *found.depth_refinement;
  return {{"message", refinement.message},
          {"applied", refinement.applied},
          {"edge_width_px", refinement.edge_width_px},
          {"block_px", refinement.block_px},
          {"quantum_px", refinement.quantum_px},
          {"outlier_share", refinement.outlier_share},
          {"displaced_px", {refinement.right_px, refinement.down_px}},
          {"dilation_px", refinement.dilation_px},
          {"scale", refinement.scale},
          {"scale_sigma", refinement.scale_sigma},
          {"offset_px", refinement.offset_px},
          {"offset_sigma_px", refinement.offset_sigma_px},
          {"changed_share", refinement.changed_share},
          {"seconds", refinement.seconds}};
}

json ValuesJson(const EstimateDiagnostics& found) {
  if (!found.depth_values) return nullptr;
  const estimator::DepthValuesFit& fit = *found.depth_values;
  const auto trial = [](const estimator::DepthValuesTrial& values) {
    return json{
        {"scale", values.scale}, {"offset_px", values.offset_px}, {"evidence", values.evidence}};
  };
  json others = json::array();
  for (const estimator::DepthValuesTrial& other : fit.others) others.push_back(trial(other));
  json best = trial(fit.best);
  best["scale_sigma"] = fit.scale_sigma;
  best["offset_sigma_px"] = fit.offset_sigma_px;
  return {{"message", fit.message},
          {"found", fit.is_found},
          {"wrong", found.are_depth_values_wrong},
          {"given", trial(fit.given)},
          {"best", best},
          {"others", others},
          {"gain", fit.gain},
          {"gain_sigma", fit.gain_sigma},
          {"tiles", fit.tiles},
          {"seconds", fit.seconds}};
}

json TextOrNull(const std::string& text) {
  return text.empty() ? json() : json(PrintableUtf8(text));
}

}  // namespace

std::string ApertureInWords(const EstimateOptions& options, const EstimateDiagnostics& found) {
  std::string text = found.aperture_shape;
  if (found.aperture_from == "camera") text += " (from the camera)";
  if (found.aperture_from == "light-field") text += " (from the light field)";
  if (found.aperture_from == "assumed") text += " (assumed)";
  return options.aperture_of.empty() ? text
                                     : fmt::format("{}, views of {}", text, options.aperture_of);
}

std::string BlurShownInWords(const EstimateDiagnostics& found) {
  if (found.photo_aperture) {
    return fmt::format("{}: {}", estimator::PhotoVerdictName(found.photo_aperture->verdict),
                       found.photo_aperture->message);
  }
  return found.used_photo_aperture == 0
             ? "sharp, as stated: the photograph is taken as the centre view"
             : "";
}

json EstimateJson(const EstimateOptions& options, const EstimateOutcome& outcome) {
  const LightFieldEstimate& estimate = outcome.estimate;
  const EstimateSummary& summary = estimate.summary;
  const EstimateDiagnostics& found = estimate.diagnostics;
  const EstimateSeconds& seconds = summary.seconds;
  const double read_seconds = outcome.read_seconds + seconds.prepare;
  // A direct solver has no iterations, and an iterative one no factorisation.
  const bool is_direct = summary.rcond_min.has_value();
  json out = {{"status", summary.partial_reason.empty() ? "ok" : "partial"},
              {"reason", summary.partial_reason},
              {"output", options.output_folder},
              {"solver", summary.solver},
              {"views", {summary.u_count, summary.v_count}},
              {"stored", estimate.scene ? "scene" : "views"},
              {"size", {summary.width_px, summary.height_px}},
              {"channels", summary.channels},
              {"transfer", found.transfer.Name()},
              {"transfer_from", found.transfer_from != "image" ? found.transfer_from
                                : options.transfer.empty()     ? "file"
                                                               : "option"},
              {"read", FileReadJson(options.image_path, outcome.photo_facts.get())},
              {"undistorted", TextOrNull(found.undistorted)},
              {"depth_fit", TextOrNull(found.depth_fit)},
              {"without_source_share", found.without_source_share},
              {"embedded_depth", TextOrNull(outcome.embedded_depth)},
              {"aperture", ApertureJson(options, found)},
              {"exif", ExifJson(options, found)},
              {"seconds",
               {{"read", read_seconds},
                {"setup", read_seconds + seconds.setup},
                {"photo_aperture", seconds.photo_aperture},
                {"blur_check", seconds.blur_check},
                {"depth_flips", seconds.depth_flips},
                {"contradiction", seconds.contradiction},
                {"solve", seconds.solve},
                {"views", seconds.views},
                {"files", outcome.files_seconds},
                {"total", outcome.total_seconds}}},
              {"peak_rss_mib", PeakMemoryMib()},
              {"effects", summary.effects},
              {"effect_impacts", EffectsJson(found.effects)},
              {"holes_filled", found.holes_filled},
              {"holes_share", found.holes_share},
              {"holes",
               {{"zero", found.holes.zero},
                {"nan", found.holes.not_a_number},
                {"infinite", found.holes.infinite},
                {"negative", found.holes.negative},
                {"largest_of_type", found.holes.largest},
                {"hole_value", found.holes.listed}}},
              {"clipped_fraction", outcome.clipped_fraction},
              {"rays",
               {{"visible_fraction", found.rays_visible},
                {"partly_visible_fraction", found.rays_partly_visible},
                {"blurred_share", found.rays_blurred},
                {"filled_in_share", found.rays_filled_in}}},
              {"disparity",
               {{"min_px", found.disparity_range_px.first},
                {"max_px", found.disparity_range_px.second},
                {"largest_step_px", found.largest_step_px},
                {"coarse_share", found.coarse_share},
                {"noise_px", OrNull(found.depth_noise_px)},
                {"noise_left_px", OrNull(found.depth_noise_left_px)}}},
              {"depth_refinement", RefinementJson(found)},
              {"depth_values", ValuesJson(found)},
              {"warnings", summary.warnings},
              {"aperture_blur", ApertureBlurJson(found)},
              {"inpainting", InpaintingJson(found)},
              // Fields that every solver has; a solver may replace them below.
              {"block_solver", nullptr},
              {"prior", "ridge"},
              {"strength", OrNull(found.strength)},
              {"noise_sigma", nullptr},
              {"device", summary.device},
              {"threads", summary.threads},
              {"predicted_memory_mib", found.predicted_memory_mib},
              {"iterations", is_direct ? json() : OrNull(summary.iterations)},
              {"converged", is_direct ? json() : json(summary.converged)},
              {"relative_residual", OrNull(summary.relative_residual)},
              {"rcond_min", OrNull(summary.rcond_min)},
              {"row_share", OrNull(found.row_share)},
              {"occluded_fraction", OrNull(found.occluded_fraction)},
              {"residual_rms", OrNull(found.residual_rms)}};
  if (found.depth) {
    out["depth"] = {{"min_mm", found.depth->min_mm},
                    {"median_mm", found.depth->median_mm},
                    {"max_mm", found.depth->max_mm}};
  }
  out["photo_clipping"] = {{"share", found.clipping.share}, {"levels", found.clipping.levels}};
  out["brightest"] = OrNull(found.brightest);
  out["falloff"] = FalloffJson(found);
  if (found.gamma) out["gamma"] = *found.gamma;
  if (found.ridge) out["ridge"] = *found.ridge;
  if (summary.solver == "scene") AddScene(estimate, &out);
  if (summary.solver == "blocks") AddBlocks(estimate, &out);
  return out;
}

std::string EstimateText(const EstimateOptions& options, const EstimateOutcome& outcome,
                         const json& json_summary) {
  const LightFieldEstimate& estimate = outcome.estimate;
  const EstimateSummary& summary = estimate.summary;
  const EstimateDiagnostics& found = estimate.diagnostics;
  const EstimateSeconds& seconds = summary.seconds;
  std::string text;
  if (outcome.photo_facts)
    text += fmt::format("photograph   {}\n", PrintableUtf8(outcome.photo_facts->OneLine()));
  if (!outcome.embedded_depth.empty())
    text += fmt::format("depth map    {}\n", PrintableUtf8(outcome.embedded_depth));
  if (!found.undistorted.empty()) {
    text += fmt::format("undistorted  {}{}\n", PrintableUtf8(found.undistorted),
                        found.without_source_share > 0
                            ? fmt::format("; {:.2g} % of the pixels have no source",
                                          100 * found.without_source_share)
                            : "");
  }
  text += DepthText(found);
  text += fmt::format("light field  {} x {} views of {} x {} px, {} channel(s){}\n",
                      summary.u_count, summary.v_count, summary.width_px, summary.height_px,
                      summary.channels, estimate.scene ? ", stored as their scene" : "");
  text += fmt::format("aperture     {}\n", PrintableUtf8(ApertureInWords(options, found)));
  if (options.common.verbose) text += ApertureBlurText(found);
  text += SolverText(estimate);
  text += fmt::format("device       {}, {} thread(s)\n", summary.device, summary.threads);
  if (!found.effects.findings.empty()) text += EffectsText(found.effects);
  text += AccuracyText(summary);
  const std::string blur_shown = BlurShownInWords(found);
  if (!blur_shown.empty()) text += fmt::format("blur shown   {}\n", blur_shown);
  if (found.blur_check) {
    text += fmt::format("blur check   {} ({} solve(s), {:.1f} s)\n", found.blur_check->message,
                        found.blur_check->trials.size(), found.blur_check->seconds);
  }
  text += ConfidenceText(found);
  if (found.inpainting) text += fmt::format("inpainting   {}\n", found.inpainting->message);
  text += fmt::format(
      "time         {:.2f} s: set-up {:.2f}, {}{}solve {:.2f}, {}{}views {:.2f}, files {:.2f}\n",
      outcome.total_seconds, json_summary["seconds"]["setup"].get<double>(),
      found.photo_aperture ? fmt::format("blur shown {:.2f}, ", seconds.photo_aperture) : "",
      found.blur_check ? fmt::format("blur check {:.2f}, ", seconds.blur_check) : "", seconds.solve,
      found.depth_flips ? fmt::format("reversed depth {:.2f}, ", seconds.depth_flips) : "",
      found.contradiction ? fmt::format("agreement {:.2f}, ", seconds.contradiction) : "",
      seconds.views, outcome.files_seconds);
  text += fmt::format("memory       {:.0f} MiB at most ({:.0f} predicted)\n",
                      json_summary["peak_rss_mib"].get<double>(), found.predicted_memory_mib);
  if (outcome.clipped_fraction > 0) {
    text += fmt::format(
        "clipped      {:.2f} % of the values in the files of the views (--format tiff keeps "
        "them)\n",
        100 * outcome.clipped_fraction);
  }
  return text;
}

}  // namespace thicklens::tools

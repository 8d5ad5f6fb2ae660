#include "tools/interface/depth_values_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <variant>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/estimator/depth_contradiction.h"
#include "thicklens/estimator/depth_values.h"
#include "tools/interface/with_file_context.h"

namespace thicklens {
namespace {

using estimator::DepthValuesFit;
using estimator::DepthValuesTrial;

// Logarithm of the likelihood ratio, and that over its standard deviation, from which the values of
// a map are wrong. Changes up to three standard deviations, or up to these, are none.
constexpr double kCertainGain = 10, kCertainSigmas = 2;
constexpr double kSigmas = 3, kMinScaleChange = 0.04, kMinOffsetChangePx = 0.05;
// Scales beyond are those of another aperture as well: PhotoAperture decides.
constexpr double kMinScale = 0.85, kMaxScale = 1.25;
// Standard deviations of the coincidence of edges of a map that lies at its place.
constexpr double kAtPlace = 3;

std::string NameOf(const DepthMap& map) { return map.source.empty() ? "depth" : map.source; }

// The photograph shows a blur only if it is not taken as sharp, and the other solvers take it as
// captured through the whole aperture.
bool IsTakenAsSharp(const EstimateOptions& options) {
  const auto* scene = std::get_if<SceneSolver>(&options.solver);
  return scene != nullptr && scene->photo == PhotoKind::kSharp;
}

// The options that make scale * d + offset of the map's present disparities.
std::string OptionsFor(const DepthMeaning& meaning, const DepthValuesTrial& values,
                       const RunScope& run) {
  return fmt::format("{} {:.4g} {} {:.4g}", run.Option("depth.meaning.disparity_scale"),
                     values.scale * meaning.disparity_scale,
                     run.Option("depth.meaning.disparity_offset_px"),
                     values.scale * meaning.disparity_offset_px + values.offset_px);
}

// Whether the photograph is certain that the values are others, by so much that it matters.
bool AreOthers(const DepthValuesFit& fit) {
  return fit.is_found && fit.gain >= kCertainGain && fit.gain >= kCertainSigmas * fit.gain_sigma &&
         (std::abs(fit.best.scale - 1) > std::max(kSigmas * fit.scale_sigma, kMinScaleChange) ||
          std::abs(fit.best.offset_px) >
              std::max(kSigmas * fit.offset_sigma_px, kMinOffsetChangePx));
}

// Whether the edges of the map lie on those of the photograph, in its order and at its place. A map
// without edges shows its place by nothing but its values.
bool IsAtPlace(const PreparedProblem& prepared, const EstimateDiagnostics& diagnostics,
               int threads) {
  estimator::DepthContradictionOptions check;
  check.falloff = false;
  check.compression_sigma = diagnostics.compression_sigma.value_or(0);
  check.check_values = false;
  check.threads = threads;
  const estimator::DepthContradiction found = estimator::CheckContradiction(*prepared.input, check);
  return !found.is_contradicted && !found.trials.empty() &&
         found.trials.front().edges.value_or(0) >= kAtPlace;
}

}  // namespace

void FindRelativeValues(const EstimateOptions& options, const PreparedProblem& prepared,
                        DepthMap* map, EstimateDiagnostics* diagnostics, RunScope* run) {
  if (!map->meaning.is_relative) return;
  const std::string name = NameOf(*map);
  const auto remedy = [&](const std::string& why) {
    return Error(fmt::format(
        "{}: its scale and its offset are not known: {}; state them ({} disparity, {} and {}: px "
        "per view step = scale * value + offset)",
        name, why, run->Option("depth.meaning.kind"), run->Option("depth.meaning.disparity_scale"),
        run->Option("depth.meaning.disparity_offset_px")));
  };
  if (IsTakenAsSharp(options)) {
    throw remedy(
        fmt::format("a sharp photograph ({}) does not show them", run->Option("solver.photo")));
  }
  DepthMap as_disparity = *map;
  as_disparity.meaning.is_relative = false;
  estimator::EstimateInput input;
  input.image = prepared.input->image;
  input.clipped = prepared.input->clipped;
  input.transfer = prepared.input->transfer;
  input.weights = prepared.input->weights;
  PreparedDepth values = PrepareDepth(as_disparity, input.image, nullptr, nullptr, nullptr);
  if (prepared.input->grid) {
    // The disparities are those of the larger step.
    const model::LightFieldGrid& grid = *prepared.input->grid;
    const Eigen::Vector2d step(std::abs(grid.u_step_mm),
                               std::abs(grid.v_step_mm * grid.s_step_mm / grid.t_step_mm));
    values.disparity.step = step / step.maxCoeff();
  }
  input.disparity = std::move(values.disparity);
  const auto [least, most] =
      std::minmax_element(input.disparity.disparity.begin(), input.disparity.disparity.end());
  if (!(*least < *most)) throw remedy("all of its values are equal");
  // The unit of the values is free: as they are, they might exceed the image as disparities.
  const float largest = std::max(std::abs(*least), std::abs(*most));
  for (float& value : input.disparity.disparity) value /= largest;
  estimator::DepthValuesOptions search;
  search.search = estimator::DepthValuesSearch::kAll;
  search.compression_sigma = diagnostics->compression_sigma.value_or(0);
  search.threads = run->threads();
  DepthValuesFit fit = estimator::FitDepthValues(input, search);
  // Options state px per view step along u, unless there is one column of views.
  const Eigen::Vector2d& unit_step = input.disparity.step;
  const double of_stated = unit_step.x() != 0 ? unit_step.x() : unit_step.y();
  const auto convert = [&](DepthValuesTrial* trial) {
    trial->scale *= of_stated / static_cast<double>(largest);
    trial->offset_px *= of_stated;
  };
  convert(&fit.best);
  for (DepthValuesTrial& other : fit.others) convert(&other);
  fit.scale_sigma *= of_stated / static_cast<double>(largest);
  fit.offset_sigma_px *= of_stated;
  diagnostics->depth_values = fit;
  if (!fit.is_found) {
    std::string why = fit.message;
    if (!fit.others.empty()) {
      why += fmt::format(" ({}", OptionsFor(as_disparity.meaning, fit.best, *run));
      for (const DepthValuesTrial& other : fit.others)
        why += ", or " + OptionsFor(as_disparity.meaning, other, *run);
      why += ")";
    }
    throw remedy(why);
  }
  map->meaning.is_relative = false;
  map->meaning.disparity_scale = fit.best.scale * as_disparity.meaning.disparity_scale;
  map->meaning.disparity_offset_px = fit.best.offset_px;
  const double unit = std::abs(as_disparity.meaning.disparity_scale);
  run->Inform(fmt::format(
      "{}: the blur of the photograph gives px per view step = ({:.4g} +- {:.2g}) * value + "
      "({:.3g} +- {:.2g}), as {} disparity {} states it",
      name, map->meaning.disparity_scale, fit.scale_sigma * unit, fit.best.offset_px,
      fit.offset_sigma_px, run->Option("depth.meaning.kind"),
      OptionsFor(as_disparity.meaning, fit.best, *run)));
}

void CorrectValues(const EstimateOptions& options, DepthMeaning* meaning, PreparedProblem* prepared,
                   EstimateDiagnostics* diagnostics, RunScope* run) {
  estimator::EstimateInput& input = *prepared->input;
  // A camera states the disparities of depths in metres, and values that were found need no search.
  const bool is_scene = std::holds_alternative<SceneSolver>(options.solver) ||
                        std::holds_alternative<SolverChooser>(options.solver);
  if (!is_scene || IsTakenAsSharp(options) || input.camera ||
      meaning->kind != DepthKind::kDisparity || diagnostics->depth_values)
    return;
  estimator::DepthValuesOptions search;
  search.compression_sigma = diagnostics->compression_sigma.value_or(0);
  search.threads = run->threads();
  DepthValuesFit fit = estimator::FitDepthValues(input, search);
  run->Detail("values of the depth: " + fit.message);
  const bool are_others = AreOthers(fit) && fit.best.scale >= kMinScale &&
                          fit.best.scale <= kMaxScale &&
                          IsAtPlace(*prepared, *diagnostics, run->threads());
  diagnostics->depth_values = fit;
  diagnostics->are_depth_values_wrong = are_others;
  if (!are_others || options.refine_depth == DepthRefining::kOff) return;
  const double step = input.disparity.step.cwiseAbs().maxCoeff();
  for (float& value : input.disparity.disparity) {
    value =
        static_cast<float>(fit.best.scale * static_cast<double>(value) + fit.best.offset_px / step);
  }
  meaning->disparity_scale *= fit.best.scale;
  meaning->disparity_offset_px = fit.best.scale * meaning->disparity_offset_px + fit.best.offset_px;
  estimator::DepthRefinement& refinement = *diagnostics->depth_refinement;
  refinement.scale = fit.best.scale;
  refinement.offset_px = fit.best.offset_px;
  refinement.scale_sigma = fit.scale_sigma;
  refinement.offset_sigma_px = fit.offset_sigma_px;
  const std::string text =
      fmt::format("scale {:.3f} +- {:.3f}, offset {:.2f} +- {:.2f} px per view step",
                  fit.best.scale, fit.scale_sigma, fit.best.offset_px, fit.offset_sigma_px);
  refinement.message = refinement.applied ? refinement.message + "; " + text : text;
  refinement.applied = true;
  refinement.seconds += fit.seconds;
  run->Warn(fmt::format(
      "the blur of the photograph agrees with other disparities than those of the depth map, which "
      "are used ({} {:.4g} {} {:.4g} state them); an aperture that is {} than the stated one has "
      "the same effect; {} off keeps the map",
      run->Option("depth.meaning.disparity_scale"), meaning->disparity_scale,
      run->Option("depth.meaning.disparity_offset_px"), meaning->disparity_offset_px,
      fit.best.scale < 1 ? "narrower" : "wider", run->Option("refine_depth")));
}

std::string ValuesReason(const std::string& name, const DepthMeaning& meaning,
                         const EstimateDiagnostics& diagnostics, const RunScope& run) {
  if (!diagnostics.are_depth_values_wrong || diagnostics.depth_refinement) return "";
  const DepthValuesFit& fit = *diagnostics.depth_values;
  return fmt::format(
      "{}: the blur of the photograph agrees with other disparities: scale {:.3f} +- {:.3f}, "
      "offset {:.2f} +- {:.2f} px per view step ({}; {} auto applies them), or the aperture is not "
      "the stated one",
      name, fit.best.scale, fit.scale_sigma, fit.best.offset_px, fit.offset_sigma_px,
      OptionsFor(meaning, fit.best, run), run.Option("refine_depth"));
}

}  // namespace thicklens

// thicklens explain: reports what a calibrated camera does at given depths.
#include "thicklens/explain.h"

#include <fmt/format.h>

#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/output_file.h"
#include "thicklens/camera.h"
#include "thicklens/depth.h"
#include "thicklens/model/depth_of_field.h"
#include "tools/commands/commands.h"
#include "tools/options/circle_option.h"
#include "tools/options/command_frame.h"
#include "tools/options/effect_options.h"
#include "tools/options/embedded_depth.h"
#include "tools/options/interface_options.h"
#include "tools/options/light_field_options.h"
#include "tools/options/option_values.h"
#include "tools/report/explain_figure.h"
#include "tools/report/explain_table.h"
#include "tools/report/focus_limits.h"

namespace thicklens::tools {
namespace {

constexpr int kMaxSteps = 10000;

struct ExplainOptions {
  CommonOptions common;
  std::string camera_path;
  std::string depth_range, depth_path;  // one of them
  DepthOptions depth;
  int steps = 9;
  EffectOptions effects;
  int bits = 8;
  double full_well_electrons = 0, read_noise_electrons = 0;
  bool as_sweep = false;
  model::BenchConditions bench;       // with as_sweep
  std::optional<double> uv_depth_mm;  // of the plane UV of a light field
  bool costs = false;
  std::string figure_path;
  CircleOption circle;
};

DepthRange ParseDepthRange(const std::string& text) {
  const std::string form = "NEAR:FAR in mm, with 0 < NEAR < FAR and FAR a number or inf,";
  const std::string inf_ending = ":inf";
  const bool to_infinity =
      text.size() > inf_ending.size() &&
      text.compare(text.size() - inf_ending.size(), std::string::npos, inf_ending) == 0;
  const auto numbers =
      SplitNumbers("--depth-range",
                   to_infinity ? text.substr(0, text.size() - inf_ending.size()) : text, ':', form);
  DepthRange range{numbers[0], std::numeric_limits<double>::infinity()};
  if (!to_infinity && numbers.size() > 1) range.far_mm = numbers[1];
  if (numbers.size() != (to_infinity ? 1 : 2) || !(range.near_mm > 0) ||
      !(range.far_mm > range.near_mm)) {
    throw UsageError(fmt::format("--depth-range: {} is expected, found '{}'", form, text));
  }
  return range;
}

OptionNames ExplainOptionNames() {
  return {{"depth_range", "--depth-range"},
          {"depth", "--depth"},
          {"depth.near_mm", "--depth-near"},
          {"depth.far_mm", "--depth-far"},
          {"depth.meaning.kind", "--depth-kind"},
          {"depth.meaning.unit", "--depth-unit"},
          {"depth.meaning.inverse_scale_dpt", "--inverse-scale"},
          {"depth.meaning.inverse_offset_dpt", "--inverse-offset"},
          {"depth.holes", "--hole-value"},
          {"depth.holes.zero_is_value", "--zero-is value"},
          {"depth.holes.largest_is_value", "--largest-is value"},
          {"depth_count", "--steps"},
          {"effects", "--effects"},
          {"effects.without", "--without"},
          {"effects.tolerance", "--effect-tolerance"},
          {"bits", "--bits"},
          {"full_well_electrons", "--full-well"},
          {"read_noise_electrons", "--read-noise"},
          {"bench.flicker", "--flicker"},
          {"bench.drift_sigma_px", "--drift"},
          {"bench.reading_sigma_mm", "--reading-error"},
          {"bench.tilt_deg", "--tilt"},
          {"uv_depth_mm", "--uv-depth"},
          {"measure_costs", "--costs"}};
}

// A photograph with a depth map inside states what the map means. Such a map is smaller than the
// sensor.
DepthMap DepthOf(const ExplainOptions& options, const model::Sensor& sensor) {
  if (options.depth.kind.empty()) {
    if (std::optional<DepthMap> inside =
            ReadEmbeddedDepth(options.depth_path, sensor.width_px, sensor.height_px,
                              DepthFlipOf(options.depth), DepthRun())) {
      RefuseOtherMeaning(options.depth, *inside);
      return std::move(*inside);
    }
  }
  return ReadDepth(options.depth_path, DepthMeaningOf(options.depth),
                   DepthReadOptionsOf(options.depth),
                   DepthRun("the same command without --depth-kind"));
}

// Its progress line ends with it.
CameraExplanation ExplanationOf(const ExplainOptions& options, const Camera& camera) {
  thicklens::ExplainOptions asked;
  if (options.depth_path.empty()) {
    asked.depth_range = ParseDepthRange(options.depth_range);
  } else {
    asked.depth = DepthOf(options, camera.sensor);
  }
  asked.depth_count = options.steps;
  asked.effects = EffectSelectionOf(options.effects);
  asked.bits = options.bits;
  asked.full_well_electrons = options.full_well_electrons;
  asked.read_noise_electrons = options.read_noise_electrons;
  if (options.as_sweep) asked.bench = options.bench;
  asked.uv_depth_mm = options.uv_depth_mm;
  asked.measure_costs = options.costs;
  const CommandRun run(options.common, ExplainOptionNames());
  return WithOptionNames(run.names(),
                         [&] { return ExplainCamera(camera, std::move(asked), run.control()); });
}

void AddCosts(const model::EffectCosts& costs, nlohmann::json* summary) {
  (*summary)["image_seconds"] = costs.seconds;
  (*summary)["seconds_are"] = "extrapolated from a part of the image";
  for (nlohmann::json& effect : (*summary)["effects"]) {
    for (const auto& [of, seconds] : costs.of_effect) {
      if (effect["name"] == model::EffectName(of)) effect["cost_seconds"] = seconds;
    }
  }
}

std::string CostsText(const model::EffectCosts& costs) {
  return fmt::format(
      "cost: additional time of the effect for a simulated image of this size, extrapolated "
      "from\na part of it, in seconds on one core of this machine, with all other effects as "
      "listed here;\nwith these the simulation takes {:.3g}; ~0 is less than can be measured\n",
      costs.seconds);
}

CommandResult Explain(const ExplainOptions& options) {
  std::optional<OutputFile> figure;
  if (!options.figure_path.empty()) figure.emplace(options.figure_path);
  const Camera camera = ReadCamera(options.camera_path);
  const CameraExplanation found = ExplanationOf(options, camera);
  CommandResult result{ExplanationJson(found.camera), ""};
  result.summary["effects"] = EffectsJson(found.effects);
  std::string limits_text;
  if (options.circle.is_given()) {
    const model::FocusLimits limits =
        model::FocusLimitsOf(camera, CircleOfConfusionMm(options.circle, camera.sensor));
    result.summary["focus_limits"] = FocusLimitsJson(limits);
    for (const std::string& line : FocusLimitsLines(limits)) limits_text += line + '\n';
  }
  if (found.costs) AddCosts(*found.costs, &result.summary);
  ThrowIfCancelled();
  if (figure) figure->Commit(BlurCurveSvg(camera, found.depth_range));
  result.is_written = figure.has_value();
  PrintResult(options.common,
              ExplanationText(found.camera) + limits_text +
                  "\nlargest impact of each effect here on edges between black and white\n" +
                  EffectsTable(found.effects, found.costs ? &found.costs->of_effect : nullptr) +
                  (found.costs ? CostsText(*found.costs) : ""));
  return result;
}

// Throws UsageError.
void CheckUsage(const ExplainOptions& options) {
  if (options.depth_range.empty() == options.depth_path.empty()) {
    throw UsageError("--depth-range or --depth is missing: a range of depths, or a depth map");
  }
  if (options.read_noise_electrons > 0 && !(options.full_well_electrons > 0)) {
    throw UsageError(
        "--read-noise: noise in electrons needs --full-well, the electrons at full scale");
  }
  const model::BenchConditions& bench = options.bench;
  if (!options.as_sweep && (bench.flicker > 0 || bench.drift_sigma_px > 0 ||
                            bench.reading_sigma_mm > 0 || bench.tilt_deg != 0)) {
    throw UsageError("--flicker, --drift, --tilt and --reading-error require --as-sweep");
  }
  if (options.costs && options.as_sweep) {
    throw UsageError("--costs: not available with --as-sweep, whose effects take hardly any time");
  }
  if (!options.depth_path.empty()) {
    if (options.depth.kind.empty()) return;  // a photograph states it
    if (ConventionOf(options.depth).kind == model::DepthKind::kDisparity) {
      throw UsageError(
          "--depth-kind disparity: disparities refer to views, but a camera alone has no views; z "
          "or range is expected");
    }
    return;
  }
  if (!options.depth.kind.empty() || !options.depth.unit.empty()) {
    throw UsageError("--depth-kind and --depth-unit require --depth");
  }
}

}  // namespace

void AddExplainCommand(CLI::App* program, CommandAction* action) {
  CLI::App* command = program->add_subcommand(
      "explain",
      "Report blur, depth of field and relevant imaging effects of a camera at given depths");
  const auto options = std::make_shared<ExplainOptions>();
  command->add_option("camera", options->camera_path, "Calibrated camera")
      ->required()
      ->type_name("CAMERA.yaml");
  command
      ->add_option("--depth-range", options->depth_range,
                   "Depths from the aperture in mm; FAR may be inf")
      ->type_name("NEAR:FAR");
  command
      ->add_option("--depth", options->depth_path,
                   "Depth map of the scene, or a photograph with one inside, instead of "
                   "--depth-range")
      ->type_name("MAP");
  AddDepthOptions(command, "Required with --depth", &options->depth);
  command
      ->add_option("--steps", options->steps,
                   "Number of depths in the table, equally spaced in 1/depth")
      ->check(CLI::Range(2, kMaxSteps))
      ->capture_default_str()
      ->type_name("N");
  AddCircleOptions(command, &options->circle);
  AddEffectOptions(command, &options->effects);
  AddFormerEffectTolerance(command, &options->effects, &options->common);
  command->add_option("--bits", options->bits, "Bits per value of the encoded image")
      ->check(CLI::Range(1, 32))
      ->capture_default_str()
      ->type_name("N");
  command
      ->add_option("--full-well", options->full_well_electrons,
                   "Electrons at full scale, for shot noise; 0: unknown")
      ->check(NonNegative())
      ->type_name("ELECTRONS");
  command
      ->add_option("--read-noise", options->read_noise_electrons,
                   "Read noise of the sensor, sd in electrons; needs --full-well")
      ->check(NonNegative())
      ->type_name("ELECTRONS");
  command->add_flag("--as-sweep", options->as_sweep,
                    "The depths are those of a target on a bench, lit from the camera");
  command->add_option("--flicker", options->bench.flicker, "Flicker of the lamp, relative sd")
      ->check(NonNegative())
      ->type_name("SHARE");
  command
      ->add_option("--drift", options->bench.drift_sigma_px,
                   "Drift of the target between frames, sd in focus")
      ->check(NonNegative())
      ->type_name("PX");
  command->add_option("--tilt", options->bench.tilt_deg, "Tilt of the target")
      ->check(Between(-89, 89, "degrees"))
      ->type_name("DEG");
  command
      ->add_option("--reading-error", options->bench.reading_sigma_mm,
                   "Error of a reading of the bench, sd")
      ->check(NonNegative())
      ->type_name("MM");
  command
      ->add_option("--uv-depth", options->uv_depth_mm,
                   "Depth of the UV plane of a light field whose ST plane is the plane of focus")
      ->check(Finite())
      ->type_name("MM");
  command->add_flag("--costs", options->costs,
                    "Also measure the run time of each effect in a simulated image of this "
                    "camera at these depths; takes some seconds");
  command
      ->add_option("--figure", options->figure_path,
                   "Draw blur against depth, with the band of its standard error")
      ->type_name("FILE.svg");
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] {
      CheckUsage(*options);
      if (options->depth_path.empty()) ParseDepthRange(options->depth_range);
      RequireDistinctFiles({options->common.json_path, options->figure_path},
                           {options->camera_path, options->depth_path});
      RunCommand(options->common, [&] { return Explain(*options); });
    };
  });
}

}  // namespace thicklens::tools

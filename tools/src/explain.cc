// thicklens explain: what a calibrated camera does at given depths.
#include <fmt/format.h>

#include <limits>
#include <memory>
#include <string>

#include "commands.h"
#include "explain_table.h"
#include "option_values.h"
#include "thicklens/model/camera_file.h"

namespace thicklens::tools {
namespace {

constexpr int kMaxSteps = 10000;

struct ExplainOptions {
  CommonOptions common;
  std::string camera_path;
  std::string depth_range;
  int steps = 9;
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

CommandResult Explain(const ExplainOptions& options, const DepthRange& range) {
  const model::Camera camera = model::ReadCamera(options.camera_path);
  TellAssumedFields(camera);
  const Explanation explanation = ExplainCamera(camera, range, options.steps);
  PrintResult(options.common, ExplanationText(explanation));
  return {ExplanationJson(explanation), ""};
}

}  // namespace

void AddExplainCommand(CLI::App* program, CommandAction* action) {
  CLI::App* command = program->add_subcommand(
      "explain", "What a calibrated camera does: blur, depth of field, thick against thin");
  const auto options = std::make_shared<ExplainOptions>();
  command->add_option("camera", options->camera_path, "A calibrated camera")
      ->required()
      ->type_name("CAMERA.yaml");
  command
      ->add_option("--depth-range", options->depth_range,
                   "Depths from the aperture, in mm; FAR may be inf")
      ->required()
      ->type_name("NEAR:FAR");
  command->add_option("--steps", options->steps, "Depths in the table, equally spaced in 1/depth")
      ->check(CLI::Range(2, kMaxSteps))
      ->capture_default_str()
      ->type_name("N");
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] {
      const DepthRange range = ParseDepthRange(options->depth_range);
      RequireDistinctFiles({options->common.json_path}, {options->camera_path});
      RunCommand(options->common, [&] { return Explain(*options, range); });
    };
  });
}

}  // namespace thicklens::tools

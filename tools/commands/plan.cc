// thicklens plan: proposes a focus sweep from the camera, the target, the noise and the precision
// that is wanted.
#include "thicklens/plan.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/camera.h"
#include "thicklens/model/light_field.h"
#include "tools/commands/commands.h"
#include "tools/options/command_frame.h"
#include "tools/options/interface_options.h"
#include "tools/options/option_values.h"

namespace thicklens::tools {
namespace {

constexpr double kPerPercent = 100;
constexpr double kMaxDepthMm = 1e6;
constexpr double kMaxAmount = 1e9;

struct PlanOptions {
  CommonOptions common;
  std::string camera_path;
  std::optional<double> focus_mm, kappa;
  std::string floor, texture = "dead-leaves", range, wanted, region;
  bool even_light = false;
  PlanConditions conditions;
  PlanWishes wishes;
  std::string output, readings_output;
};

OptionNames PlanOptionNames() {
  return {{"focus_depth_mm", "--focus-mm (with --wanted zf=)"},
          {"blur_ratio", "--kappa (with --wanted kappa=)"},
          {"image_distance_mm", "--wanted d1="},
          {"blur_floor_px", "--floor"},
          {"blur_floor_sigma_px", "--floor"},
          {"contrast", "--contrast"},
          {"light_level", "--light"},
          {"full_well_electrons", "--full-well"},
          {"read_noise_electrons", "--read-noise"},
          {"noise_sigma", "--noise"},
          {"bits", "--bits"},
          {"reading_sigma_mm", "--reading-sigma-mm"},
          {"offset_sigma_mm", "--offset-sigma-mm"},
          {"frames", "--frames"},
          {"most_frames", "--most-frames"},
          {"nearest_mm", "--range"},
          {"farthest_mm", "--range"},
          {"feature_size_mm", "--feature-mm"}};
}

std::string Stripped(std::string text) {
  const auto first = text.find_first_not_of(' ');
  if (first == std::string::npos) return "";
  return text.substr(first, text.find_last_not_of(' ') - first + 1);
}

[[noreturn]] void WrongWish(const std::string& found) {
  throw UsageError(
      fmt::format("--wanted: standard deviations such as zf=0.5mm,d1=0.01mm,kappa=0.002 (or "
                  "zf=0.1%,kappa=0.5%) "
                  "are expected, found '{}'",
                  found));
}

// A number with its unit: "0.5mm", "0.5 mm", "0.1%" of `whole`, or a number alone.
double WishValue(const std::string& text, const std::string& all, double whole, bool is_length) {
  std::size_t used = 0;
  double value = 0;
  try {
    value = std::stod(text, &used);
  } catch (const std::exception&) {
    WrongWish(all);
  }
  const std::string unit = Stripped(text.substr(used));
  if (unit == "%") {
    value *= whole / kPerPercent;
  } else if (is_length && unit == "um") {
    value *= 1e-3;
  } else if (!(unit.empty() || (is_length && unit == "mm"))) {
    WrongWish(all);
  }
  if (!(value > 0) || !std::isfinite(value)) WrongWish(all);
  return value;
}

void ParseWanted(PlanOptions* options) {
  const std::string& all = options->wanted;
  if (all.empty()) return;
  const PlanConditions& conditions = options->conditions;
  std::size_t begin = 0;
  while (begin <= all.size()) {
    const std::size_t end = std::min(all.find(',', begin), all.size());
    const std::string item = all.substr(begin, end - begin);
    begin = end + 1;
    const std::size_t equals = item.find('=');
    if (equals == std::string::npos) WrongWish(all);
    const std::string name = Stripped(item.substr(0, equals)), text = item.substr(equals + 1);
    std::optional<double>* wish = nullptr;
    double whole = 0;
    if (name == "zf") {
      wish = &options->wishes.focus_depth_mm;
      whole = conditions.focus_depth_mm;
    } else if (name == "d1") {
      wish = &options->wishes.image_distance_mm;
      whole = model::ImageDistanceMm(conditions.camera.lens, conditions.focus_depth_mm);
    } else if (name == "kappa") {
      wish = &options->wishes.blur_ratio;
      whole = conditions.blur_ratio;
    } else {
      WrongWish(all);
    }
    *wish = WishValue(text, all, whole, name != "kappa");
  }
}

// The middle of the sensor, as `size_px` of a simulation takes it.
Camera MiddleOf(const Camera& camera, int width_px, int height_px) {
  if (width_px < 1 || height_px < 1 || width_px > camera.sensor.width_px ||
      height_px > camera.sensor.height_px) {
    throw UsageError(fmt::format("--region: WIDTHxHEIGHT up to {}x{} is expected, found {}x{}",
                                 camera.sensor.width_px, camera.sensor.height_px, width_px,
                                 height_px));
  }
  return model::CropCamera(
      camera, {(camera.sensor.width_px - width_px) / 2, (camera.sensor.height_px - height_px) / 2,
               width_px, height_px});
}

void ReadConditions(PlanOptions* options) {
  PlanConditions& conditions = options->conditions;
  conditions.camera = ReadCamera(options->camera_path);
  if (!options->region.empty()) {
    const auto px = SplitPixels("--region", options->region, 'x', "WIDTHxHEIGHT");
    if (px.size() != 2)
      throw UsageError(
          fmt::format("--region: WIDTHxHEIGHT is expected, found '{}'", options->region));
    conditions.camera = MiddleOf(conditions.camera, px[0], px[1]);
  }
  conditions.lamp_falloff = !options->even_light;
  const auto& calibration = conditions.camera.calibration;
  if (options->focus_mm) {
    conditions.focus_depth_mm = *options->focus_mm;
  } else if (calibration && calibration->image_distance_mm) {
    conditions.focus_depth_mm = conditions.camera.focus_depth_mm();
  } else {
    throw UsageError(
        fmt::format("--focus-mm: the distance at which the lens is focused is needed, because {} "
                    "states no image distance",
                    PrintableUtf8(options->camera_path)));
  }
  if (!(conditions.focus_depth_mm > conditions.camera.lens.front_focal_length_mm)) {
    throw UsageError(fmt::format(
        "--focus-mm: a distance from the aperture plane beyond the focal length of {:.5g} mm is "
        "expected, found {:.5g}",
        conditions.camera.lens.front_focal_length_mm, conditions.focus_depth_mm));
  }
  if (options->kappa) {
    conditions.blur_ratio = *options->kappa;
  } else if (calibration && calibration->blur_ratio) {
    conditions.blur_ratio = calibration->blur_ratio->value;
  }
  if (!options->floor.empty()) {
    const auto px = SplitNumbers("--floor", options->floor, ',', "PX or PX,SIGMA");
    if (px.empty() || px.size() > 2)
      throw UsageError(
          fmt::format("--floor: PX or PX,SIGMA is expected, found '{}'", options->floor));
    conditions.blur_floor_px = px[0];
    if (px.size() > 1) conditions.blur_floor_sigma_px = px[1];
  } else if (calibration && calibration->blur_floor_px) {
    conditions.blur_floor_px = calibration->blur_floor_px->value;
  }
  for (const auto kind : {model::TargetKind::kDeadLeaves, model::TargetKind::kWhiteNoise,
                          model::TargetKind::kPinkNoise}) {
    if (options->texture == model::TargetKindName(kind)) conditions.texture = kind;
  }
  if (!options->range.empty()) {
    const auto ends = SplitNumbers("--range", options->range, ',', "NEAREST,FARTHEST in mm");
    if (ends.size() != 2)
      throw UsageError(
          fmt::format("--range: NEAREST,FARTHEST in mm is expected, found '{}'", options->range));
    options->wishes.nearest_mm = ends[0];
    options->wishes.farthest_mm = ends[1];
  }
  ParseWanted(options);
}

nlohmann::json ErrorsJson(const calib::PlannedErrors& errors) {
  return {{"focus_depth_mm", errors.focus_depth_mm},
          {"image_distance_mm", errors.image_distance_mm},
          {"blur_ratio", errors.blur_ratio}};
}

nlohmann::json WishesJson(const PlanWishes& wishes) {
  nlohmann::json json = nlohmann::json::object();
  if (wishes.focus_depth_mm) json["focus_depth_mm"] = *wishes.focus_depth_mm;
  if (wishes.image_distance_mm) json["image_distance_mm"] = *wishes.image_distance_mm;
  if (wishes.blur_ratio) json["blur_ratio"] = *wishes.blur_ratio;
  return json;
}

nlohmann::json PlanJson(const PlanOptions& options, const SweepPlan& plan) {
  const ExpectedSweep& expected = plan.expected;
  const PlanConditions& conditions = options.conditions;
  nlohmann::json parts = nlohmann::json::array(), frames = nlohmann::json::array();
  for (const calib::PlannedErrorPart& part : expected.parts)
    parts.push_back({{"source", part.name}, {"sigma", ErrorsJson(part.sigma)}});
  for (const calib::PlannedFrame& frame : expected.frames) {
    frames.push_back({{"depth_mm", frame.depth_mm},
                      {"blur_sigma_px", frame.blur_sigma_px},
                      {"blur_sigma_error_px", frame.blur_sigma_error_px},
                      {"image_scale", frame.image_scale},
                      {"modes", frame.modes}});
  }
  return {{"status", plan.reached ? "ok" : "refused"},
          {"reason", plan.reason},
          {"nearest_mm", expected.design.nearest_mm},
          {"farthest_mm", expected.design.farthest_mm()},
          {"step_mm", expected.design.step_mm},
          {"frames", expected.design.frames},
          {"frames_in_fit", expected.frames_in_fit},
          {"texture", model::TargetKindName(conditions.texture)},
          {"feature_size_mm", expected.design.feature_size_mm},
          {"target_width_mm", plan.target_width_mm},
          {"target_height_mm", plan.target_height_mm},
          {"focus_depth_mm", conditions.focus_depth_mm},
          {"blur_ratio", conditions.blur_ratio},
          {"blur_floor_px", conditions.blur_floor_px},
          {"wanted", WishesJson(options.wishes)},
          {"sigma", ErrorsJson(expected.sigma)},
          {"scatter", ErrorsJson(expected.scatter)},
          {"floor_interval", ErrorsJson(expected.floor_interval)},
          {"parts", parts},
          {"bench_offset_sigma_mm", expected.offset_sigma_mm},
          {"bench_offset_from_scale", expected.offset_from_scale},
          {"advice", plan.advice},
          {"warnings", plan.warnings},
          {"expected_frames", frames}};
}

std::string WantedText(const std::optional<double>& wanted, const char* unit) {
  return wanted ? fmt::format(" (wanted {:.3g}{})", *wanted, unit) : "";
}

std::string TextOfPlan(const PlanOptions& options, const SweepPlan& plan) {
  const ExpectedSweep& expected = plan.expected;
  const SweepDesign& design = expected.design;
  const PlanConditions& conditions = options.conditions;
  const PlanWishes& wishes = options.wishes;
  std::string text = fmt::format(
      "sweep        {} frames from {:.6g} to {:.6g} mm from the aperture, steps of {:.4g} mm; "
      "focus at {:.6g} mm\n"
      "blur         {:.2f} and {:.2f} px (sigma) at the ends, {:.2f} px in focus\n"
      "target       {}, {} {:.3g} mm, contrast {:.2g}, at least {:.0f} x {:.0f} mm\n",
      design.frames, design.nearest_mm, design.farthest_mm(), design.step_mm,
      conditions.focus_depth_mm, expected.frames.front().blur_sigma_px,
      expected.frames.back().blur_sigma_px, conditions.blur_floor_px,
      model::TargetKindName(conditions.texture),
      conditions.texture == model::TargetKind::kDeadLeaves ? "radius of the smallest discs"
                                                           : "shortest period",
      design.feature_size_mm, conditions.contrast, std::ceil(plan.target_width_mm),
      std::ceil(plan.target_height_mm));
  if (conditions.noise_sigma) {
    text +=
        fmt::format("noise        {:.3g} of full scale per pixel, {} bits, light level {:.2g}\n",
                    *conditions.noise_sigma, conditions.bits, conditions.light_level);
  } else {
    text += fmt::format(
        "noise        {:g} electrons at full scale, read noise {:g}, {} bits, light level {:.2g}\n",
        conditions.full_well_electrons, conditions.read_noise_electrons, conditions.bits,
        conditions.light_level);
  }
  text += fmt::format("bench        readings +-{:.3g} mm, zero +-{:.3g} mm ({})\n",
                      conditions.reading_sigma_mm, expected.offset_sigma_mm,
                      expected.offset_from_scale ? "from the image scale" : "stated");
  text += fmt::format(
      "expected     zf +-{:.3g} mm{}, d1 +-{:.3g} mm{}, kappa +-{:.3g}{}: standard deviations\n",
      expected.sigma.focus_depth_mm, WantedText(wishes.focus_depth_mm, " mm"),
      expected.sigma.image_distance_mm, WantedText(wishes.image_distance_mm, " mm"),
      expected.sigma.blur_ratio, WantedText(wishes.blur_ratio, ""));
  for (const calib::PlannedErrorPart& part : expected.parts) {
    text +=
        fmt::format("  {:<14} zf +-{:.2g} mm, d1 +-{:.2g} mm, kappa +-{:.2g}\n", part.name,
                    part.sigma.focus_depth_mm, part.sigma.image_distance_mm, part.sigma.blur_ratio);
  }
  if (expected.floor_interval.focus_depth_mm > 0) {
    text += fmt::format(
        "  beside these   zf +-{:.2g} mm, d1 +-{:.2g} mm, kappa +-{:.2g} because the blur floor is "
        "not known\n",
        expected.floor_interval.focus_depth_mm, expected.floor_interval.image_distance_mm,
        expected.floor_interval.blur_ratio);
  }
  text += plan.advice + "\n";
  for (const std::string& warning : plan.warnings) text += "warning      " + warning + "\n";
  return text;
}

std::string CommandsText(const PlanOptions& options, const ExpectedSweep& expected) {
  if (options.output.empty()) return "";
  return fmt::format(
      "to try it    thicklens simulate sweep {} -o DIR{}\n"
      "             thicklens calibrate DIR/sweep.yaml -o calibrated.yaml\n",
      PrintableUtf8(options.output), expected.offset_from_scale ? " --unknown-offset" : "");
}

// The camera's file as the written file names it.
std::string CameraPathFrom(const std::string& output, const std::string& camera_path) {
  namespace fs = std::filesystem;
  std::error_code failed;
  const fs::path folder = fs::absolute(fs::path(output), failed).parent_path();
  const fs::path camera = fs::absolute(fs::path(camera_path), failed);
  const fs::path relative = fs::proximate(camera, folder, failed);
  return failed ? camera.string() : relative.string();
}

CommandResult Plan(PlanOptions options) {
  ReadConditions(&options);
  std::optional<OutputFile> output, readings;
  if (!options.output.empty()) output.emplace(options.output);
  if (!options.readings_output.empty()) readings.emplace(options.readings_output);
  ReportAssumedFields(options.conditions.camera);
  const OptionNames names = PlanOptionNames();
  const CommandRun run(options.common, names);
  const SweepPlan plan = WithOptionNames(
      names, [&] { return ProposeSweep(options.conditions, options.wishes, run.control()); });
  CommandResult result;
  result.summary = PlanJson(options, plan);
  if (!plan.reached) {
    PrintResult(options.common, TextOfPlan(options, plan));
    result.refusal = plan.reason;
    return result;
  }
  ThrowIfCancelled();
  if (output) {
    output->Commit(PlannedSimulationYaml(options.conditions, plan.expected.design,
                                         CameraPathFrom(options.output, options.camera_path)));
  }
  if (readings) readings->Commit(PlannedReadingsCsv(plan.expected.design));
  result.is_written = output || readings;
  PrintResult(options.common, TextOfPlan(options, plan) + CommandsText(options, plan.expected) +
                                  WrittenText({options.output, options.readings_output}));
  return result;
}

void AddBenchOptions(CLI::App* command, PlanOptions* options) {
  PlanConditions* conditions = &options->conditions;
  command
      ->add_option("--reading-sigma-mm", conditions->reading_sigma_mm,
                   "Standard deviation of the error of a reading")
      ->check(Between(-1e-300, kMaxDepthMm, "millimetres"))
      ->capture_default_str()
      ->type_name("MM");
  command
      ->add_option("--offset-sigma-mm", conditions->offset_sigma_mm,
                   "Standard deviation of the bench offset (depth of reading 0) that will be "
                   "stated; 0: exact; default: calibrate finds the offset from the image scale")
      ->check(NonNegative())
      ->type_name("MM");
  command
      ->add_option("--frames", options->wishes.frames,
                   "Number of frames; default: the fewest that reach what is wanted, or 31")
      ->type_name("N");
  command
      ->add_option("--most-frames", options->wishes.most_frames,
                   "The largest number of frames that is proposed")
      ->capture_default_str()
      ->type_name("N");
  command
      ->add_option("--range", options->range,
                   "Depths from the aperture plane at which the sweep begins and ends; default: "
                   "those with the smallest errors")
      ->type_name("NEAREST,FARTHEST");
}

void AddLightOptions(CLI::App* command, PlanOptions* options) {
  PlanConditions* conditions = &options->conditions;
  command
      ->add_option("--light", conditions->light_level,
                   "Mean linear light of the target in the plane of focus, of full scale")
      ->check(Between(0, 1, "parts of full scale"))
      ->capture_default_str()
      ->type_name("PART");
  command->add_flag(
      "--even-light", options->even_light,
      "The light does not depend on the target's distance; default: it falls as from a lamp at the "
      "camera");
  CLI::Option* full_well =
      command
          ->add_option("--full-well", conditions->full_well_electrons,
                       "Electrons at full scale, which give the shot noise; 0: none")
          ->check(Between(-1e-300, kMaxAmount, "electrons"))
          ->capture_default_str()
          ->type_name("N");
  CLI::Option* read_noise = command
                                ->add_option("--read-noise", conditions->read_noise_electrons,
                                             "Standard deviation of the read noise, electrons")
                                ->check(Between(-1e-300, kMaxAmount, "electrons"))
                                ->capture_default_str()
                                ->type_name("N");
  command
      ->add_option("--noise", conditions->noise_sigma,
                   "Standard deviation of a pixel in linear light, of full scale, in place of "
                   "--full-well and --read-noise")
      ->check(Between(0, 1, "parts of full scale"))
      ->excludes(full_well)
      ->excludes(read_noise)
      ->type_name("PART");
  command->add_option("--bits", conditions->bits, "Bits of a value in the files")
      ->check(CLI::IsMember({8, 16}))
      ->capture_default_str()
      ->type_name("N");
}

void AddTargetOptions(CLI::App* command, PlanOptions* options) {
  command
      ->add_option("--texture", options->texture,
                   "Texture of the target: dead-leaves (discs of many sizes, as thicklens target "
                   "draws them), white-noise or pink-noise")
      ->check(CLI::IsMember({"dead-leaves", "white-noise", "pink-noise"}))
      ->capture_default_str()
      ->type_name("NAME");
  command
      ->add_option("--contrast", options->conditions.contrast,
                   "Contrast of the target, (bright - dark)/(bright + dark)")
      ->check(Between(0, 1, "contrast"))
      ->capture_default_str()
      ->type_name("PART");
  command
      ->add_option("--feature-mm", options->wishes.feature_size_mm,
                   "Radius of the smallest discs, or the shortest period of noise; default: the "
                   "one with the smallest errors")
      ->check(Between(0, kMaxDepthMm, "millimetres"))
      ->type_name("MM");
}

}  // namespace

void AddPlanCommand(CLI::App* program, CommandAction* action) {
  CLI::App* command = program->add_subcommand(
      "plan", "Propose a focus sweep, with the errors that its calibration will have");
  const auto options = std::make_shared<PlanOptions>();
  command
      ->add_option("camera", options->camera_path,
                   "Camera file; values of a data sheet are enough (camera init)")
      ->required()
      ->type_name("CAMERA.yaml");
  command
      ->add_option("--focus-mm", options->focus_mm,
                   "Distance from the aperture plane at which the lens is focused; default: the "
                   "one of the camera's calibration")
      ->check(Between(0, kMaxDepthMm, "millimetres"))
      ->type_name("MM");
  command
      ->add_option("--kappa", options->kappa,
                   "Expected blur ratio; default: that of the camera's calibration, or 0.45")
      ->check(Between(0, 1, "blur ratio"))
      ->type_name("K");
  command
      ->add_option("--floor", options->floor,
                   "Expected blur floor and the standard deviation with which it is known, px; "
                   "default: 0.5, not known")
      ->type_name("PX[,SIGMA]");
  command
      ->add_option("--wanted", options->wanted,
                   "Standard deviations to reach, e.g. zf=0.5mm,d1=0.01mm,kappa=1% (% of the "
                   "expected value); default: the smallest that 31 frames can have")
      ->type_name("NAME=VALUE,...");
  command
      ->add_option("--region", options->region,
                   "Middle of the sensor that is measured; default: all of it")
      ->type_name("WIDTHxHEIGHT");
  AddTargetOptions(command, options.get());
  AddLightOptions(command, options.get());
  AddBenchOptions(command, options.get());
  command
      ->add_option("-o,--output", options->output,
                   "Write the sweep as a file for thicklens simulate sweep")
      ->type_name("SWEEP.yaml");
  command
      ->add_option("--readings-out", options->readings_output,
                   "Write a table of the frames and their depths, for calibrate --readings")
      ->type_name("FILE.csv");
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] {
      RequireDistinctFiles({options->output, options->readings_output, options->common.json_path},
                           {options->camera_path});
      RunCommand(options->common, [&] { return Plan(*options); });
    };
  });
}

}  // namespace thicklens::tools

// thicklens camera verify: tests with a new sweep whether a stored calibration still holds.
#include "tools/commands/camera_verify.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <memory>
#include <vector>

#include "thicklens/base/printable_text.h"
#include "thicklens/camera.h"
#include "thicklens/sweep.h"
#include "thicklens/verify.h"
#include "tools/options/interface_options.h"
#include "tools/options/option_values.h"
#include "tools/options/sweep_input.h"
#include "tools/options/sweep_options.h"
#include "tools/report/input_summary.h"

namespace thicklens::tools {
namespace {

using nlohmann::json;

struct CameraVerifyOptions {
  CommonOptions common;
  std::string camera_path;
  SweepArguments sweep;
  VerifyOptions verification;
};

json FiniteOrNull(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }

json ParameterJson(const calib::ComparedParameter& parameter) {
  const auto estimate = [](const model::Estimate& e) {
    return json{{"value", FiniteOrNull(e.value)}, {"sigma", FiniteOrNull(e.sigma)}};
  };
  return {{"name", parameter.name},
          {"stored", estimate(parameter.stored)},
          {"found", estimate(parameter.found)},
          {"difference", FiniteOrNull(parameter.difference)},
          {"sigma", FiniteOrNull(parameter.sigma)},
          {"systematic_sigma", FiniteOrNull(parameter.systematic_sigma)},
          {"difference_sigmas",
           parameter.sigma > 0 ? FiniteOrNull(parameter.deviation()) : json(nullptr)},
          {"counted", parameter.counted},
          {"why_not_counted", parameter.counted ? json(nullptr) : json(parameter.why_not_counted)},
          {"smallest_detectable_change",
           parameter.counted ? FiniteOrNull(parameter.smallest_detectable) : json(nullptr)}};
}

std::string ParameterLine(const calib::ComparedParameter& parameter) {
  constexpr char kForm[] = "{:<20}{:>24}{:>24}{:>12}{:>12}{:>9}{:>13}\n";
  const auto estimate = [](const model::Estimate& e) {
    return fmt::format("{:.7g} +- {:.2g}", e.value, e.sigma);
  };
  return fmt::format(
      kForm, parameter.name, estimate(parameter.stored), estimate(parameter.found),
      fmt::format("{:+.3g}", parameter.difference), fmt::format("{:.3g}", parameter.sigma),
      parameter.sigma > 0 ? fmt::format("{:+.1f}", parameter.deviation()) : std::string("-"),
      parameter.counted ? fmt::format("{:.3g}", parameter.smallest_detectable)
                        : std::string("not counted"));
}

// Its progress line ends with it.
CameraVerification Verify(const CameraVerifyOptions& options, std::string* readings_line) {
  const CommandRun run(options.common, SweepOptionNames());
  const model::Camera stored = ReadCamera(options.camera_path);
  SweepArguments arguments = options.sweep;
  // Frames of a camera whose calibration holds for undistorted images are undistorted alike.
  if (arguments.distortion.empty() && stored.distortion) arguments.distortion = options.camera_path;
  const Sweep sweep = ReadSweepInput(arguments, run.control());
  *readings_line = ReadingsLine(sweep);
  return VerifyCamera(stored, sweep, options.verification, run.control());
}

CommandResult RunVerification(const CameraVerifyOptions& options) {
  std::string readings_line;
  const CameraVerification verification = Verify(options, &readings_line);
  const CalibrationSummary& found = verification.calibration.summary;
  const calib::BlurFit& blur = verification.calibration.diagnostics.blur;
  for (const std::string& warning : found.warnings) spdlog::debug("{}", PrintableUtf8(warning));

  PrintResult(options.common, readings_line + VerificationText(verification));
  CommandResult result;
  result.summary = VerificationJson(verification);
  result.summary.update(
      {{"camera", PrintableUtf8(options.camera_path)},
       {"sweep", PrintableUtf8(options.sweep.input)},
       {"significance", options.verification.significance},
       {"needed_blur_px", options.verification.needed_blur_px},
       {"frames_used", found.frames_used},
       {"calibration",
        {{"status", calib::OutcomeName(found.outcome)},
         {"reason", found.outcome == calib::Outcome::kOk ? "" : PrintableUtf8(found.reason)},
         {"chi2_per_dof", blur.done ? FiniteOrNull(blur.chi2_per_dof) : json(nullptr)}}}});
  if (verification.verdict != calib::Verdict::kHolds) {
    const bool is_other = verification.verdict == calib::Verdict::kDoesNotHold;
    result.refusal = PrintableUtf8(fmt::format(
        "{}: {} by {}: {}", options.camera_path,
        is_other ? "the calibration does not hold" : "whether the calibration holds is undecided",
        options.sweep.input, verification.reason));
    result.is_verdict = true;
  }
  return result;
}

}  // namespace

std::string VerificationText(const calib::Verification& verification) {
  std::string text;
  if (!verification.parameters.empty()) {
    text += fmt::format("{:<20}{:>24}{:>24}{:>12}{:>12}{:>9}{:>13}\n", "", "stored", "new sweep",
                        "difference", "its sigma", "sigmas", "detectable");
  }
  for (const calib::ComparedParameter& parameter : verification.parameters) {
    text += ParameterLine(parameter);
  }
  for (const calib::ComparedParameter& parameter : verification.parameters) {
    if (parameter.counted) continue;
    text += fmt::format("{} is not counted: {}\n", parameter.name, parameter.why_not_counted);
  }
  if (verification.degrees_of_freedom > 0) {
    text += fmt::format(
        "together: chi-square {:.2f} of {} parameter(s); a larger value occurs by chance with "
        "probability "
        "{:.2g}\n",
        verification.chi_square, verification.degrees_of_freedom, verification.p_value);
  }
  for (const std::string& warning : verification.warnings) {
    text += "warning: " + PrintableUtf8(warning) + "\n";
  }
  if (verification.detectable_blur_px > 0) {
    text +=
        fmt::format("the smallest detectable change of d1 changes the blur by {:.2g} px of sigma\n",
                    verification.detectable_blur_px);
  }
  text += verification.verdict == calib::Verdict::kHolds ? "the calibration holds"
          : verification.verdict == calib::Verdict::kDoesNotHold
              ? "the calibration does not hold"
              : "whether the calibration holds is undecided";
  return text + (verification.reason.empty() ? "" : ": " + PrintableUtf8(verification.reason)) +
         "\n";
}

json VerificationJson(const calib::Verification& verification) {
  json parameters = json::array();
  for (const calib::ComparedParameter& parameter : verification.parameters) {
    parameters.push_back(ParameterJson(parameter));
  }
  json warnings = json::array();
  for (const std::string& warning : verification.warnings) {
    warnings.push_back(PrintableUtf8(warning));
  }
  const bool is_counted = verification.degrees_of_freedom > 0;
  return {{"status", calib::VerdictName(verification.verdict)},
          {"reason", PrintableUtf8(verification.reason)},
          {"parameters", parameters},
          {"degrees_of_freedom", verification.degrees_of_freedom},
          {"chi_square", is_counted ? FiniteOrNull(verification.chi_square) : json(nullptr)},
          {"p_value", is_counted ? FiniteOrNull(verification.p_value) : json(nullptr)},
          {"smallest_detectable_blur_px", verification.detectable_blur_px > 0
                                              ? FiniteOrNull(verification.detectable_blur_px)
                                              : json(nullptr)},
          {"warnings", warnings}};
}

void AddCameraVerifyCommand(CLI::App* camera, CommandAction* action) {
  CLI::App* command = camera->add_subcommand(
      "verify", "Test with a new, possibly short sweep whether a stored calibration still holds");
  const auto options = std::make_shared<CameraVerifyOptions>();
  command
      ->add_option("camera", options->camera_path,
                   "Calibrated camera; its lens and sensor are used for the sweep")
      ->required()
      ->type_name("CAMERA.yaml");
  command
      ->add_option("sweep", options->sweep.input,
                   "Description of the new sweep, or a folder of frames or a video with --readings")
      ->required()
      ->type_name("SWEEP.yaml|DIR|VIDEO.mp4");
  AddReadingOptions(command, &options->sweep);
  AddVideoOptions(command, &options->sweep);
  AddSweepStatements(command, &options->sweep);
  command->add_flag("--same-bench", options->verification.same_bench,
                    "The camera is mounted on the bench as before: compare the bench offset too");
  command
      ->add_option("--significance", options->verification.significance,
                   "Probability that chance rejects a calibration that holds")
      ->check(Inside(0, 1, "a probability"))
      ->capture_default_str()
      ->type_name("P");
  command
      ->add_option("--needed-blur-px", options->verification.needed_blur_px,
                   "Change of the blur, px of sigma, that the sweep must be able to detect; "
                   "otherwise the result is undecided")
      ->check(Between(0, 1000, "pixels"))
      ->capture_default_str()
      ->type_name("PX");
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] {
      options->sweep.camera_path = options->camera_path;
      std::vector<std::string> inputs = options->sweep.Files();
      inputs.push_back(options->camera_path);
      RequireDistinctFiles({options->common.json_path}, inputs);
      RunCommand(options->common, [&] { return RunVerification(*options); });
    };
  });
}

}  // namespace thicklens::tools

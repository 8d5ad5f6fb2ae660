// The program: finds the requested command, runs it, and reports a failure in one line.
#include <fmt/format.h>
#include <glog/logging.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <memory>
#include <new>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <string>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/estimator/blas.h"
#include "tools/commands/commands.h"
#include "tools/options/command_frame.h"
#include "tools/options/help_format.h"
#include "tools/options/option_values.h"
#include "tools/options/wrong_usage.h"
#include "tools/system/build_info.h"
#include "tools/system/interrupt.h"
#include "tools/system/message_line.h"
#include "tools/system/process_start.h"
#include "tools/system/program_memory.h"
#include "tools/system/sanitized.h"
#include "tools/system/trusted_environment.h"

namespace {

using namespace thicklens;

constexpr char kExamples[] =
    R"(Examples:
  Calibrate a camera with a focus sweep, the photographs and readings.csv in the folder sweep:
    thicklens camera init --focal-mm 50 --f-number 2.8 --pitch-um 4.5 --size 640x480 -o camera.yaml
    thicklens calibrate sweep --readings sweep/readings.csv --camera camera.yaml -o calibrated.yaml --report report

  A light field from a photograph with a map of z in mm, and a view of it:
    thicklens estimate photo.png depth.png --camera calibrated.yaml --depth-kind z --depth-unit mm -o lf
    thicklens render lf --view 0,3 -o left.png

  A light field from a photograph with a map of disparities, without a camera:
    thicklens estimate photo.png disparity.pfm --depth-kind disparity -o lf

thicklens COMMAND --help lists the options of a command. Exit codes: 0 done (this help too),
1 refused or failed, with a reason, 2 wrong usage.)";

constexpr char kVersionFlag[] = "--version";

enum ExitCode { kDone = 0, kFailed = 1, kUsage = 2 };

void SetUpMessages() {
  // Libraries print nothing: the code that calls them reports errors, with the file's name.
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  FLAGS_minloglevel = google::GLOG_FATAL;  // Ceres logs through glog
  FLAGS_logtostderr = true;                // and not to files in /tmp or the current folder
  google::InitGoogleLogging("thicklens");
  spdlog::set_default_logger(spdlog::stderr_logger_mt("thicklens"));
  spdlog::set_formatter(tools::MakeMessageFormatter());
}

int Fail(std::string message, ExitCode code) {
  tools::BeginEnd(code);
  while (!message.empty() && message.back() == '\n') message.pop_back();
  spdlog::error("{}", message);
  return code;
}

// A shell variable that was never set gives an empty text, which is never a valid value.
void RequireNoEmptyValue(const CLI::App& command) {
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_expected_min() == 0) continue;  // it needs no value
    for (const std::string& value : option->results()) {
      if (value.empty()) {
        throw tools::UsageError(fmt::format("{}: a value is expected, found ''",
                                            option->get_name(option->get_positional())));
      }
    }
  }
  for (const CLI::App* inner : command.get_subcommands()) RequireNoEmptyValue(*inner);
}

int FinishOutput(ExitCode code) {
  // It is a failure if results do not reach their file, but not if the reader of a pipe went away.
  errno = 0;
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
    if (errno != EPIPE) {
      throw Error(fmt::format("standard output cannot be written: {}", std::strerror(errno)));
    }
  }
  tools::BeginEnd(code);
  return code;
}

int ParseAndRun(CLI::App* program, const tools::CommandAction* action, int argc, char** argv) {
  try {
    program->parse(argc, argv);
  } catch (const CLI::Success& asked_for) {  // --help, --version
    return program->exit(asked_for);
  } catch (const CLI::ParseError& error) {
    if (!tools::EndsBeforeACommand(*program, error)) {
      return Fail(fmt::format("{} (see --help)", tools::WrongUsageText(*program, error)), kUsage);
    }
    fmt::print("{}", program->help());
    return FinishOutput(kDone);
  }
  RequireNoEmptyValue(*program);
  try {
    (*action)();
  } catch (const tools::PrintedRefusal&) {
    return FinishOutput(kFailed);
  }
  return FinishOutput(kDone);
}

struct Command {
  const char* name;
  void (*add)(CLI::App* program, tools::CommandAction* action);
};
// In the order of work, as --help lists them.
constexpr std::array<Command, 16> kCommands = {{{"target", tools::AddTargetCommand},
                                                {"camera", tools::AddCameraCommand},
                                                {"plan", tools::AddPlanCommand},
                                                {"frames", tools::AddFramesCommand},
                                                {"mtf", tools::AddMtfCommand},
                                                {"undistort", tools::AddUndistortCommand},
                                                {"calibrate", tools::AddCalibrateCommand},
                                                {"explain", tools::AddExplainCommand},
                                                {"depth", tools::AddDepthCommand},
                                                {"estimate", tools::AddEstimateCommand},
                                                {"render", tools::AddRenderCommand},
                                                {"compare", tools::AddCompareCommand},
                                                {"report", tools::AddReportCommand},
                                                {"simulate", tools::AddSimulateCommand},
                                                {"bench", tools::AddBenchCommand},
                                                {"doctor", tools::AddDoctorCommand}}};

// Adds the command that the first argument names, or, if it names none, all of them. The options of
// all commands take a tenth of the time that the program needs to start.
void AddCommands(int argc, char** argv, CLI::App* program, tools::CommandAction* action) {
  const std::string first = argc > 1 ? argv[1] : "";
  if (argc == 2 && first == kVersionFlag) return;
  const bool is_command = std::any_of(kCommands.begin(), kCommands.end(),
                                      [&](const Command& one) { return first == one.name; });
  for (const Command& command : kCommands) {
    if (!is_command || first == command.name) command.add(program, action);
  }
}

int Main(int argc, char** argv) {
  tools::KeepFreedMemory();
  SetUpMessages();
  tools::CatchSignals();
  for (const auto& [name, value] : tools::ForgottenCaches())
    spdlog::warn("{}", tools::RelativePathIsIgnored(name, value));
  for (const std::string& line : tools::DistrustRelativePaths()) spdlog::warn("{}", line);
  tools::RequireStack();
  tools::WatchSignals();
  const CancelScope scope(tools::ProgramToken());
  CLI::App program(
      "Thick-lens camera calibration from focus sweeps, and light fields from one image",
      "thicklens");
  program.set_version_flag(kVersionFlag, tools::BuildInfo(),
                           "Print the version and the libraries it was built with");
  program.require_subcommand(1);
  program.formatter(std::make_shared<tools::HelpFormat>());
  tools::CommandAction action;
  AddCommands(argc, argv, &program, &action);
  program.footer(kExamples);  // after the commands, which would inherit it
  return ParseAndRun(&program, &action, argc, argv);
}

// However the program ends, by main's return or by a library that calls exit(), the exit handlers
// of libraries do not run: if memory is short, the threads that OpenBLAS starts with the program
// try to allocate again and again, and its exit handler would wait for their end forever.
// Sanitizers report at the end what they found.
void EndWithoutLibraries() {
#if defined(__GLIBC__) && !defined(THICKLENS_IS_SANITIZED)
  ::on_exit(
      [](int status, void*) {
        std::fflush(nullptr);
        std::_Exit(status);
      },
      nullptr);
#endif
}

int Run(int argc, char** argv) {
  try {
    return Main(argc, argv);
  } catch (const tools::UsageError& error) {
    return Fail(error.what(), kUsage);
  } catch (const Interrupted&) {  // with outputs in place, RunCommand has made another error of it
    return Fail(tools::InterruptedText({}), kFailed);
  } catch (const std::bad_alloc&) {
    return Fail("out of memory", kFailed);
  } catch (const cv::Exception& error) {
    // OpenCV reports a lack of memory this way.
    return Fail(error.code == cv::Error::StsNoMem ? "out of memory" : error.what(), kFailed);
  } catch (const std::exception& error) {
    return Fail(error.what(), kFailed);
  }
}

}  // namespace

int main(int argc, char** argv) {
  EndWithoutLibraries();
  thicklens::estimator::KeepBlasToOneThread();
  return Run(argc, argv);
}

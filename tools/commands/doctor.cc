// thicklens doctor: lists the devices and libraries of this machine, and checks their results.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/estimator/blas.h"
#include "thicklens/estimator/block_solver.h"
#include "thicklens/io/image_io.h"
#include "thicklens/kernels/device.h"
#include "tools/commands/commands.h"
#include "tools/options/command_frame.h"
#include "tools/options/light_field_options.h"
#include "tools/stress/stress_suite.h"
#include "tools/system/build_info.h"

namespace thicklens::tools {
namespace {

constexpr double kBytesPerMib = 1024.0 * 1024.0;

struct DoctorOptions {
  CommonOptions common;
  std::string device = "auto";
  bool hard_cases = false;
  StressSuiteOptions hard;
};

// The results of the examination.
struct Findings {
  int cores = 0;
  int threads = 0;
  std::string blas;
  std::vector<std::string> block_solvers;
  std::string image_files;
  std::optional<kernels::DeviceSurvey> survey;   // none if OpenCL must not be used
  std::string used, used_description, used_why;  // empty: nothing can be used
  std::string notice;                            // reports the fallback from OpenCL
  std::optional<kernels::BackendSelfTest> self_test;
  std::string refusal;
};

std::vector<std::string> BuiltInSolvers() {
  std::vector<std::string> names;
  for (const auto solver : estimator::BuiltInBlockSolvers()) {
    names.push_back(estimator::BlockSolverName(solver));
  }
  return names;
}

std::string WhyUsed(const DoctorOptions& options, const kernels::Backend& backend,
                    const std::string& notice) {
  if (!notice.empty()) return "no OpenCL device can be used";
  if (!backend.is_opencl()) return "requested by --device " + options.device;
  const std::string tried = "a small kernel was compiled and ran there";
  return options.device == "auto" ? "the best working OpenCL device: " + tried
                                  : "requested by --device " + options.device + ": " + tried;
}

std::string Disagreement(const std::string& device, const kernels::BackendSelfTest& check) {
  return fmt::format(
      "device {} and the C++ code differ by {:.2g} in float (limit {:g}) and {:.2g} in double "
      "(limit {:g}), relative; the largest difference is in {}: update its driver, or use another "
      "--device",
      device, check.float_error, check.float_limit, check.double_error, check.double_limit,
      check.worst);
}

// Problems of the device become part of the findings, which report them.
void ExamineDevice(const DoctorOptions& options, Findings* findings) {
  const kernels::DeviceRequest request = kernels::ParseDeviceRequest(options.device);
  try {
    if (request.kind != kernels::DeviceRequest::Kind::kCpu) {
      findings->survey = kernels::SurveyDevices(false, ThrowIfCancelled);
    }
    std::string notice;
    const auto backend = kernels::OpenBackend(request, &notice, ThrowIfCancelled);
    if (!notice.empty()) spdlog::warn("{}", PrintableUtf8(notice));
    findings->notice = notice;
    findings->used = backend->name();
    findings->used_description = backend->description();
    findings->used_why = WhyUsed(options, *backend, notice);
    findings->self_test = kernels::RunBackendSelfTest(backend.get());
    if (!findings->self_test->agrees) {
      findings->refusal = Disagreement(backend->name(), *findings->self_test);
    }
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& error) {
    findings->refusal = error.what();
  }
}

void ExamineImageFiles(Findings* findings) {
  try {
    io::RequireImageCodecs();
    findings->image_files = io::ReadableImageKinds();
  } catch (const Error& error) {
    findings->image_files = "PNG, TIFF, PNM and PFM only";
    if (findings->refusal.empty()) findings->refusal = error.what();
  }
}

double Mib(std::uint64_t bytes) { return static_cast<double>(bytes) / kBytesPerMib; }

std::string NameOf(const kernels::DeviceDescription& device) {
  return fmt::format("opencl:{}:{}", device.platform, device.device);
}

std::string Joined(const std::vector<std::string>& texts) {
  return fmt::format("{}", fmt::join(texts, ", "));
}

std::string SurveyText(const Findings& findings) {
  if (!findings.survey) return "opencl         not examined\n";
  std::string text;
  for (const kernels::DeviceDescription& device : findings.survey->devices) {
    text += fmt::format(
        "{:<15}{}\n"
        "               {}, {}, driver {}\n"
        "               {}, {} units, {}, memory {:.0f} MiB (largest buffer {:.0f} MiB), local "
        "memory {:.0f} KiB, work groups of up to {}\n",
        NameOf(device), PrintableUtf8(device.name), PrintableUtf8(device.platform_name),
        PrintableUtf8(device.version), PrintableUtf8(device.driver_version), device.type,
        device.compute_units, device.has_double ? "float and double" : "float only, no double",
        Mib(device.global_memory_bytes), Mib(device.max_allocation_bytes),
        static_cast<double>(device.local_memory_bytes) / 1024, device.max_work_group);
    if (!device.problem.empty()) {
      text += fmt::format("               cannot be used: {}\n", PrintableUtf8(device.problem));
    }
  }
  if (text.empty()) text = "opencl         no device\n";
  for (const std::string& problem : findings.survey->problems) {
    text += fmt::format("problem        {}\n", PrintableUtf8(problem));
  }
  return text;
}

std::string SelfTestText(const kernels::BackendSelfTest& check) {
  const std::string in_double =
      std::isnan(check.double_error)
          ? "no double"
          : fmt::format("double {:.2g} (limit {:g})", check.double_error, check.double_limit);
  return fmt::format(
      "self-test      {}: largest relative differences from the C++ code: float {:.2g} (limit "
      "{:g}), {}{}\n",
      check.agrees ? "yes" : "NO", check.float_error, check.float_limit, in_double,
      check.worst.empty() ? "" : "; the largest in " + check.worst);
}

std::string FindingsText(const Findings& findings) {
  std::string text = BuildInfo() + "\n";
  text +=
      fmt::format("processor      {} core(s), {} thread(s)\n", findings.cores, findings.threads);
  text += fmt::format("blas           {}\n", PrintableUtf8(findings.blas));
  text += fmt::format("block solvers  {} (default {})\n", Joined(findings.block_solvers),
                      estimator::BlockSolverName(estimator::DefaultBlockSolver()));
  text += fmt::format("images         {}\n", findings.image_files);
  text += SurveyText(findings);
  if (!findings.used.empty()) {
    text += fmt::format(
        "used           {}: {}\n               {}\n"
        "               by --solver blocks and render; the default solver of estimate uses it only "
        "with "
        "--device opencl\n",
        findings.used, PrintableUtf8(findings.used_description), PrintableUtf8(findings.used_why));
  }
  if (findings.self_test) text += SelfTestText(*findings.self_test);
  return text;
}

nlohmann::json DeviceJson(const kernels::DeviceDescription& device) {
  return {{"name", NameOf(device)},
          {"device", PrintableUtf8(device.name)},
          {"device_version", PrintableUtf8(device.version)},
          {"driver_version", PrintableUtf8(device.driver_version)},
          {"platform", PrintableUtf8(device.platform_name)},
          {"platform_version", PrintableUtf8(device.platform_version)},
          {"type", device.type},
          {"compute_units", device.compute_units},
          {"double", device.has_double},
          {"global_memory_bytes", device.global_memory_bytes},
          {"largest_buffer_bytes", device.max_allocation_bytes},
          {"local_memory_bytes", device.local_memory_bytes},
          {"work_group_items", device.max_work_group},
          {"problem", PrintableUtf8(device.problem)}};
}

nlohmann::json SurveyJson(const Findings& findings) {
  if (!findings.survey) return nullptr;
  nlohmann::json devices = nlohmann::json::array();
  for (const auto& device : findings.survey->devices) devices.push_back(DeviceJson(device));
  nlohmann::json problems = nlohmann::json::array();
  for (const auto& problem : findings.survey->problems) problems.push_back(PrintableUtf8(problem));
  return {{"devices", devices}, {"problems", problems}};
}

// NaN and infinity become null.
nlohmann::json NumberJson(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json();
}

nlohmann::json FindingsJson(const Findings& findings) {
  nlohmann::json json = {
      {"status", findings.refusal.empty() ? "ok" : "refused"},
      {"reason", PrintableUtf8(findings.refusal)},
      {"version", Version()},
      {"build", BuildInfo()},
      {"cores", findings.cores},
      {"threads", findings.threads},
      {"blas", PrintableUtf8(findings.blas)},
      {"block_solvers", findings.block_solvers},
      {"default_block_solver", estimator::BlockSolverName(estimator::DefaultBlockSolver())},
      {"image_files", findings.image_files},
      {"opencl", SurveyJson(findings)},
      {"notice", PrintableUtf8(findings.notice)},
      {"used", nullptr},
      {"self_test", nullptr}};
  if (!findings.used.empty()) {
    json["used"] = {{"name", findings.used},
                    {"description", PrintableUtf8(findings.used_description)},
                    {"why", PrintableUtf8(findings.used_why)}};
  }
  if (findings.self_test) {
    const kernels::BackendSelfTest& check = *findings.self_test;
    json["self_test"] = {{"agrees", check.agrees},
                         {"float_relative_error", NumberJson(check.float_error)},
                         {"float_relative_limit", check.float_limit},
                         {"double_relative_error", NumberJson(check.double_error)},
                         {"double_relative_limit", check.double_limit},
                         {"worst", check.worst}};
  }
  return json;
}

CommandResult Doctor(const DoctorOptions& options) {
  Findings findings;
  findings.cores = static_cast<int>(std::thread::hardware_concurrency());
  findings.threads = ResolveThreads(options.common.threads);
  findings.blas = estimator::BlasDescription();
  findings.block_solvers = BuiltInSolvers();
  ExamineDevice(options, &findings);
  ExamineImageFiles(&findings);
  PrintResult(options.common, FindingsText(findings));
  return {FindingsJson(findings), findings.refusal};
}

}  // namespace

void AddDoctorCommand(CLI::App* program, CommandAction* action) {
  CLI::App* command = program->add_subcommand(
      "doctor", "List CPU, BLAS and OpenCL devices of this machine, and check their results");
  const auto options = std::make_shared<DoctorOptions>();
  AddDeviceOption(command, &options->device);
  CLI::Option* hard = command->add_flag(
      "--hard-cases", options->hard_cases,
      "Run the stress tests: each difficult input must be solved to a stated accuracy or rejected "
      "with a reason, by every available solver, precision and device (therefore without "
      "--device); takes "
      "minutes");
  command->get_option("--device")->excludes(hard);
  command
      ->add_option(
          "--only", options->hard.only,
          "For --hard-cases: run only one case, or a group (optics, scene, estimator, calibration)")
      ->needs(hard)
      ->type_name("NAME");
  command
      ->add_option("--keep", options->hard.keep_folder,
                   "For --hard-cases: a new folder that keeps the input and output files")
      ->needs(hard)
      ->type_name("DIR");
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] {
      RunCommand(options->common, [&] {
        return options->hard_cases ? RunStressCases(options->hard, options->common)
                                   : Doctor(*options);
      });
    };
  });
}

}  // namespace thicklens::tools

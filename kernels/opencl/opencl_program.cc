#include "kernels/opencl/opencl_program.h"

#include <fmt/format.h>

#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include "kernels/opencl/isolated_subprocess.h"
#include "kernels/opencl/opencl_use.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"

namespace thicklens::kernels {
namespace {

const char* ErrorName(int error) {
  switch (error) {
    case CL_DEVICE_NOT_FOUND:
      return "no device found";
    case CL_DEVICE_NOT_AVAILABLE:
      return "device not available";
    case CL_COMPILER_NOT_AVAILABLE:
      return "no compiler";
    case CL_MEM_OBJECT_ALLOCATION_FAILURE:
      return "no memory on the device";
    case CL_OUT_OF_RESOURCES:
      return "out of resources";
    case CL_OUT_OF_HOST_MEMORY:
      return "out of memory";
    case CL_BUILD_PROGRAM_FAILURE:
      return "the program does not build";
    case CL_INVALID_WORK_GROUP_SIZE:
      return "wrong work group size";
    case CL_INVALID_BUFFER_SIZE:
      return "wrong buffer size";
    case -1001:  // code of the ICD loader: CL_PLATFORM_NOT_FOUND_KHR
      return "no platform found";
    default:
      return nullptr;
  }
}

// Returns a device by its indices, which are those of the survey.
cl::Device DeviceAt(int platform_index, int device_index, std::string* platform_text) {
  std::vector<cl::Platform> platforms;
  cl::Platform::get(&platforms);
  if (platform_index < 0 || platform_index >= static_cast<int>(platforms.size())) {
    throw cl::Error(CL_INVALID_PLATFORM, "platforms have changed");
  }
  const cl::Platform& platform = platforms[static_cast<std::size_t>(platform_index)];
  std::vector<cl::Device> devices;
  platform.getDevices(CL_DEVICE_TYPE_ALL, &devices);
  if (device_index < 0 || device_index >= static_cast<int>(devices.size())) {
    throw cl::Error(CL_INVALID_DEVICE, "devices have changed");
  }
  *platform_text = OneLine(platform.getInfo<CL_PLATFORM_NAME>()) + ", " +
                   OneLine(platform.getInfo<CL_PLATFORM_VERSION>());
  return devices[static_cast<std::size_t>(device_index)];
}

constexpr char kLineDirective[] = "#line 1 ";

// The compiler uses this directive for files and lines in its messages.
std::string LineDirective(const std::string& path) {
  std::string quoted;
  for (const char c : path) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return fmt::format("{}\"{}\"\n", kLineDirective, quoted);
}

// Returns the place, such as "second.cl:2", of each line of a source in which files follow their
// directives; "" before the first one.
std::vector<std::string> PlacesOfLines(const std::string& source) {
  std::vector<std::string> places;
  std::string file;
  int line_in_file = 0;
  std::istringstream lines(source);
  for (std::string line; std::getline(lines, line); ++line_in_file) {
    if (line.rfind(kLineDirective, 0) == 0) {
      const std::size_t start = sizeof kLineDirective;  // after the quotation mark
      file = line.substr(start, line.size() - start - 1);
      line_in_file = 0;
    }
    places.push_back(file.empty() ? "" : fmt::format("{}:{}", file, line_in_file));
  }
  return places;
}

}  // namespace

std::string OpenClErrorText(int error) {
  const char* name = ErrorName(error);
  return name == nullptr ? fmt::format("error {}", error)
                         : fmt::format("error {}, {}", error, name);
}

std::string WithFilesNamed(const std::string& log, const std::string& source) {
  static const std::regex kPlace("<kernel>:([0-9]{1,7}):");
  const std::vector<std::string> places = PlacesOfLines(source);
  std::string named;
  auto rest = log.cbegin();
  for (std::sregex_iterator found(log.begin(), log.end(), kPlace), end; found != end; ++found) {
    const std::size_t line = std::stoul((*found)[1]);
    named.append(rest, (*found)[0].first);
    rest = (*found)[0].second;
    const bool is_known = line >= 1 && line <= places.size() && !places[line - 1].empty();
    named += is_known ? places[line - 1] + ":" : found->str();
  }
  return named.append(rest, log.cend());
}

bool HasDouble(const cl::Device& device) {
  const std::string extensions = " " + device.getInfo<CL_DEVICE_EXTENSIONS>() + " ";
  if (extensions.find(" cl_khr_fp64 ") != std::string::npos) return true;
  cl_device_fp_config config = 0;
  return ::clGetDeviceInfo(device(), CL_DEVICE_DOUBLE_FP_CONFIG, sizeof config, &config, nullptr) ==
             CL_SUCCESS &&
         config != 0;
}

std::shared_ptr<const OpenClDevice> OpenOpenClDevice(int platform, int device) {
  const std::string name = fmt::format("opencl:{}:{}", platform, device);
  SetOpenClInUse();
  try {
    auto opened = std::make_shared<OpenClDevice>();
    std::string platform_text;
    opened->device = DeviceAt(platform, device, &platform_text);
    opened->name = name;
    opened->description =
        fmt::format("{} ({}, driver {})", OneLine(opened->device.getInfo<CL_DEVICE_NAME>()),
                    platform_text, OneLine(opened->device.getInfo<CL_DRIVER_VERSION>()));
    opened->has_double = HasDouble(opened->device);
    opened->is_cpu = (opened->device.getInfo<CL_DEVICE_TYPE>() & CL_DEVICE_TYPE_CPU) != 0;
    opened->context = cl::Context(opened->device);
    return opened;
  } catch (const cl::Error& failure) {
    throw Error(
        fmt::format("device {}: {}: {}", name, failure.what(), OpenClErrorText(failure.err())));
  }
}

// A CPU reads a whole cache line at once, and the entries of a row one after the other.
ItemForm FormOf(const OpenClDevice& device, std::size_t bytes_of_real) {
  constexpr std::size_t kLineBytes = 64;
  const int lanes = static_cast<int>(kLineBytes / bytes_of_real);
  return device.is_cpu ? ItemForm{lanes, lanes, 1} : ItemForm{};
}

cl::Program BuildProgram(const OpenClDevice& device, const std::vector<EmbeddedFile>& files,
                         const std::string& real) {
  const bool is_double = real == "double";
  if (is_double && !device.has_double) {
    throw Error(fmt::format("device {}: it does not support double precision", device.name));
  }
  std::string source;
  if (device.has_double) source += "#pragma OPENCL EXTENSION cl_khr_fp64 : enable\n";
  for (const EmbeddedFile& file : files) source += LineDirective(file.path) + file.text + "\n";
  const ItemForm form = FormOf(device, is_double ? sizeof(double) : sizeof(float));
  const std::string options =
      fmt::format("-cl-std=CL1.2 -DREAL={}{} -DSUM={} -DLANES={} -DTILE={} -DSLICE={}", real,
                  is_double ? " -DREAL_IS_DOUBLE" : "", device.has_double ? "double" : "float",
                  form.lanes, form.tile, form.slice);
  try {
    cl::Program program(device.context, source);
    program.build({device.device}, options.c_str());
    return program;
  } catch (const cl::BuildError& failure) {
    // The compiler of PoCL removes its temporary files when a signal arrives, and then fails.
    ThrowIfCancelled();
    std::string log;
    for (const auto& part : failure.getBuildLog()) log += part.second + "\n";
    throw Error(fmt::format("device {}: the kernels do not build for {} ({}): {}", device.name,
                            real, OpenClErrorText(failure.err()),
                            OneLine(WithFilesNamed(log, source))));
  } catch (const cl::Error& failure) {
    ThrowIfCancelled();
    throw Error(fmt::format("device {}: the kernels do not build for {}: {}: {}", device.name, real,
                            failure.what(), OpenClErrorText(failure.err())));
  }
}

cl::Program BuildKernels(const OpenClDevice& device, const std::string& real) {
  return BuildProgram(device, EmbeddedKernelFiles(), real);
}

}  // namespace thicklens::kernels

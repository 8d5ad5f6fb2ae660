#include "kernels/opencl/device_survey.h"

#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <optional>
#include <sstream>
#include <utility>

#include "kernels/opencl/opencl_program.h"
#include "kernels/opencl/opencl_use.h"

namespace thicklens::kernels {
namespace {

constexpr int kMinMajor = 1;
constexpr int kMinMinor = 2;
constexpr std::uint64_t kMinAllocationBytes = std::uint64_t{16} << 20;
constexpr std::uint64_t kMinWorkGroup = 64;

// Returns the fields of a line; the last one may be empty.
std::vector<std::string> SplitAtTabs(const std::string& line) {
  std::vector<std::string> fields(1);
  for (const char c : line) {
    if (c == '\t') {
      fields.emplace_back();
    } else {
      fields.back() += c;
    }
  }
  return fields;
}

// Reads the lines of a child's report one after the other.
class SurveyReader {
 public:
  explicit SurveyReader(DeviceSurvey* survey) : survey_(survey) {}

  void Read(const std::string& reported) {
    std::istringstream lines(reported);
    for (std::string line; std::getline(lines, line);) {
      // A line that the child did not finish is left out.
      if (!lines.eof()) ReadLine(SplitAtTabs(line));
    }
  }

  // The last platform that was begun, or -1.
  int platform() const { return platform_; }
  const std::string& platform_name() const { return platform_name_; }

 private:
  void ReadLine(const std::vector<std::string>& fields) {
    if (fields[0] == "platform" && fields.size() == 3) {
      platform_ = std::stoi(fields[1]);
      platform_name_ = fields[2];
    } else if (fields[0] == "problem" && fields.size() == 2) {
      survey_->problems.push_back(fields[1]);
    } else if (fields[0] == "device" && fields.size() == 16) {
      survey_->devices.push_back(Device(fields));
    }
  }

  static DeviceDescription Device(const std::vector<std::string>& fields) {
    DeviceDescription device;
    device.platform = std::stoi(fields[1]);
    device.device = std::stoi(fields[2]);
    device.platform_name = fields[3];
    device.platform_version = fields[4];
    device.name = fields[5];
    device.version = fields[6];
    device.driver_version = fields[7];
    device.type = fields[8];
    device.compute_units = std::stoi(fields[9]);
    device.has_double = fields[10] == "1";
    device.global_memory_bytes = std::stoull(fields[11]);
    device.max_allocation_bytes = std::stoull(fields[12]);
    device.local_memory_bytes = std::stoull(fields[13]);
    device.max_work_group = std::stoull(fields[14]);
    device.problem = fields[15];
    return device;
  }

  DeviceSurvey* survey_;
  int platform_ = -1;
  std::string platform_name_;
};

std::string TypeName(cl_device_type type) {
  if ((type & CL_DEVICE_TYPE_GPU) != 0) return "gpu";
  if ((type & CL_DEVICE_TYPE_ACCELERATOR) != 0) return "accelerator";
  if ((type & CL_DEVICE_TYPE_CPU) != 0) return "cpu";
  return "other";
}

// Returns true if the version of "OpenCL 1.2 ..." is at least 1.2. A version that cannot be read is
// accepted.
bool IsNewEnough(const std::string& version) {
  int major = 0;
  int minor = 0;
  if (std::sscanf(version.c_str(), "OpenCL %d.%d", &major, &minor) != 2) return true;
  return major > kMinMajor || (major == kMinMajor && minor >= kMinMinor);
}

std::string ProblemOf(const cl::Device& device, const DeviceDescription& known) {
  if (device.getInfo<CL_DEVICE_AVAILABLE>() == CL_FALSE)
    return "its driver reports that it is not available";
  if (device.getInfo<CL_DEVICE_COMPILER_AVAILABLE>() == CL_FALSE) {
    return "its driver has no compiler";
  }
  if (!IsNewEnough(known.version)) {
    return fmt::format("it supports {}; {}.{} or later is needed", known.version, kMinMajor,
                       kMinMinor);
  }
  if (known.max_allocation_bytes < kMinAllocationBytes) {
    return fmt::format("its largest buffer has {} bytes; at least {} are needed",
                       known.max_allocation_bytes, kMinAllocationBytes);
  }
  if (known.max_work_group < kMinWorkGroup) {
    return fmt::format("its largest work group has {} items; at least {} are needed",
                       known.max_work_group, kMinWorkGroup);
  }
  return "";
}

DeviceDescription Describe(const cl::Platform& platform, const cl::Device& device) {
  DeviceDescription known;
  known.platform_name = OneLine(platform.getInfo<CL_PLATFORM_NAME>());
  known.platform_version = OneLine(platform.getInfo<CL_PLATFORM_VERSION>());
  known.name = OneLine(device.getInfo<CL_DEVICE_NAME>());
  known.version = OneLine(device.getInfo<CL_DEVICE_VERSION>());
  known.driver_version = OneLine(device.getInfo<CL_DRIVER_VERSION>());
  known.type = TypeName(device.getInfo<CL_DEVICE_TYPE>());
  known.compute_units = static_cast<int>(device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>());
  known.has_double = HasDouble(device);
  known.global_memory_bytes = device.getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>();
  known.max_allocation_bytes = device.getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>();
  known.local_memory_bytes = device.getInfo<CL_DEVICE_LOCAL_MEM_SIZE>();
  known.max_work_group = device.getInfo<CL_DEVICE_MAX_WORK_GROUP_SIZE>();
  known.problem = ProblemOf(device, known);
  return known;
}

std::string Environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : OneLine(value);
}

// The place where the ICD loader searches for drivers.
std::string VendorsText() {
  const std::string vendors = Environment("OCL_ICD_VENDORS");
  return vendors.empty() ? "/etc/OpenCL/vendors" : "OCL_ICD_VENDORS=" + vendors;
}

std::string NoPlatformAdvice(int error) {
  return fmt::format(
      "no OpenCL driver could be loaded ({}): install one (pocl-opencl-icd works on every "
      "processor), or correct the .icd files in {}",
      OpenClErrorText(error), VendorsText());
}

std::string NoDeviceAdvice(int error, const std::string& platform_name) {
  std::string advice = "check that its hardware is present and that this user may open it";
  if (platform_name == "Portable Computing Language") {
    const std::string cache = Environment("POCL_CACHE_DIR");
    advice = fmt::format("check that PoCL's cache folder is writable: {}",
                         cache.empty() ? "~/.cache/pocl, unless POCL_CACHE_DIR names another folder"
                                       : "POCL_CACHE_DIR=" + cache);
  }
  return fmt::format("no device ({}): {}", OpenClErrorText(error), advice);
}

std::string PlatformLabel(int platform, const std::string& name) {
  return fmt::format("OpenCL platform {} ({}): ", platform, name.empty() ? "without a name" : name);
}

// Counts start at 0 because drivers do not write them if they report an error.
std::vector<cl_device_id> DevicesOf(cl_platform_id platform, cl_int* error) {
  cl_uint count = 0;
  *error = ::clGetDeviceIDs(platform, CL_DEVICE_TYPE_ALL, 0, nullptr, &count);
  std::vector<cl_device_id> devices(count);
  if (*error == CL_SUCCESS && count == 0) *error = CL_DEVICE_NOT_FOUND;
  if (*error != CL_SUCCESS) return {};
  *error = ::clGetDeviceIDs(platform, CL_DEVICE_TYPE_ALL, count, devices.data(), nullptr);
  return devices;
}

void ListPlatform(int index, cl_platform_id id, const SubprocessReport& report) {
  const cl::Platform platform(id);
  const std::string name = OneLine(platform.getInfo<CL_PLATFORM_NAME>());
  report(PlatformLine(index, name));
  cl_int error = CL_SUCCESS;
  const std::vector<cl_device_id> devices = DevicesOf(id, &error);
  if (error != CL_SUCCESS) {
    report(ProblemLine(PlatformLabel(index, name) + NoDeviceAdvice(error, name)));
    return;
  }
  for (std::size_t i = 0; i < devices.size(); ++i) {
    DeviceDescription known = Describe(platform, cl::Device(devices[i]));
    known.platform = index;
    known.device = static_cast<int>(i);
    report(DeviceLine(known));
  }
}

DeviceSurvey SurveyHere() {
  DeviceSurvey survey;
  SurveyReader reader(&survey);
  ListOpenClDevices(0, [&reader](const std::string& reported) { reader.Read(reported); });
  return survey;
}

}  // namespace

std::string PlatformLine(int platform, const std::string& name) {
  return fmt::format("platform\t{}\t{}\n", platform, OneLine(name));
}

std::string DeviceLine(const DeviceDescription& d) {
  return fmt::format("device\t{}\t{}\t{}\t{}\t{}\t{}\t{}\t{}\t{}\t{}\t{}\t{}\t{}\t{}\t{}\n",
                     d.platform, d.device, OneLine(d.platform_name), OneLine(d.platform_version),
                     OneLine(d.name), OneLine(d.version), OneLine(d.driver_version), d.type,
                     d.compute_units, d.has_double ? 1 : 0, d.global_memory_bytes,
                     d.max_allocation_bytes, d.local_memory_bytes, d.max_work_group,
                     OneLine(d.problem));
}

std::string ProblemLine(const std::string& problem) {
  return fmt::format("problem\t{}\n", OneLine(problem));
}

void ListOpenClDevices(int first_platform, const SubprocessReport& report) {
  cl_uint count = 0;
  cl_int error = ::clGetPlatformIDs(0, nullptr, &count);
  if (error != CL_SUCCESS || count == 0) {
    report(ProblemLine(NoPlatformAdvice(error)));
    return;
  }
  std::vector<cl_platform_id> platforms(count);
  error = ::clGetPlatformIDs(count, platforms.data(), nullptr);
  if (error != CL_SUCCESS) {
    report(ProblemLine(NoPlatformAdvice(error)));
    return;
  }
  for (int i = first_platform; i < static_cast<int>(count); ++i) {
    try {
      ListPlatform(i, platforms[static_cast<std::size_t>(i)], report);
    } catch (const cl::Error& failure) {
      report(ProblemLine(PlatformLabel(i, "") + failure.what() + ": " +
                         OpenClErrorText(failure.err())));
    }
  }
}

DeviceSurvey SurveyWith(const ListDevices& list, double limit_s, const StopCheck& stop) {
  DeviceSurvey survey;
  int first_platform = 0;
  while (true) {
    const SubprocessOutcome outcome = RunInSubprocess(
        [&](const SubprocessReport& report) { list(first_platform, report); }, limit_s, stop);
    SurveyReader reader(&survey);
    reader.Read(outcome.reported);
    if (outcome.failure.empty()) return survey;
    if (reader.platform() < first_platform) {
      survey.problems.push_back(
          fmt::format("OpenCL: loading the drivers {}; if one of them is installed twice or "
                      "broken, remove its .icd file from {}",
                      outcome.failure, VendorsText()));
      return survey;
    }
    survey.problems.push_back(PlatformLabel(reader.platform(), reader.platform_name()) +
                              "its driver " + outcome.failure + "; update or remove it");
    first_platform = reader.platform() + 1;
  }
}

const DeviceSurvey& SurveyDevices(bool again, const StopCheck& stop) {
  static std::mutex mutex;
  static std::optional<DeviceSurvey> kept;
  const std::lock_guard<std::mutex> lock(mutex);
  if (!IsOpenClInUse()) {
    if (!kept || again) kept = SurveyWith(ListOpenClDevices, kChildLimitS, stop);
  } else if (!kept) {
    kept = SurveyHere();
  }
  return *kept;
}

}  // namespace thicklens::kernels

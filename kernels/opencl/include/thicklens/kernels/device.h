#ifndef THICKLENS_KERNELS_DEVICE_H_
#define THICKLENS_KERNELS_DEVICE_H_

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "thicklens/kernels/kernels.h"
#include "thicklens/kernels/radiance_steps.h"
#include "thicklens/kernels/view_warp.h"

namespace thicklens::kernels {

// Where the user wants the kernels to run.
struct DeviceRequest {
  enum class Kind {
    kAuto,    // the best OpenCL device that works, else the C++ twin
    kCpu,     // the C++ twin; OpenCL is not touched
    kOpenCl,  // OpenCL or an error
  };
  Kind kind = Kind::kAuto;
  int platform = -1;  // -1: the best
  int device = -1;
};
// "auto", "cpu", "opencl", "opencl:PLATFORM", "opencl:PLATFORM:DEVICE". Throws Error.
DeviceRequest ParseDeviceRequest(const std::string& text);

struct DeviceDescription {
  int platform = 0;  // indices as OpenCL lists them
  int device = 0;
  std::string platform_name, platform_version;
  std::string name, version, driver_version;
  std::string type;  // "cpu", "gpu", "accelerator", "other"
  int compute_units = 0;
  bool has_double = false;
  std::uint64_t global_memory_bytes = 0;
  std::uint64_t max_allocation_bytes = 0;
  std::uint64_t local_memory_bytes = 0;
  std::uint64_t max_work_group = 0;
  std::string problem;  // why it cannot be used; empty: it can
};

struct DeviceSurvey {
  std::vector<DeviceDescription> devices;  // of all platforms, usable or not
  // Platforms without a device, a broken driver, a crash or a hang, one line each, with advice.
  std::vector<std::string> problems;
};

// Lists all devices in a child process (fork), so that a driver that aborts, crashes or hangs
// cannot take this one down. The result is kept: the child runs once per process, or with `again`.
// Once this process uses OpenCL, no child can: `again` has no effect then.
//
// `stop` (may be empty) is called several times a second meanwhile; where the user asked to stop,
// it throws Interrupted, which ends the child and passes on. Nothing is kept then.
const DeviceSurvey& SurveyDevices(bool again = false, const std::function<void()>& stop = {});

// Places that compute kernels: a device with its compiled program, or the C++ twin.
class Backend {
 public:
  virtual ~Backend() = default;
  virtual bool is_opencl() const = 0;
  virtual bool has_double() const = 0;
  virtual std::string name() const = 0;         // "cpu", "opencl:0:0"
  virtual std::string description() const = 0;  // for people: device, platform, versions
  // Throws Error if there is no double on the device.
  virtual std::unique_ptr<Kernels<float>> NewFloat() = 0;
  virtual std::unique_ptr<Kernels<double>> NewDouble() = 0;
  virtual std::unique_ptr<RadianceSteps<float>> NewSteps(const DataTerm<float>& data) = 0;
  virtual std::unique_ptr<RadianceSteps<double>> NewSteps(const DataTerm<double>& data) = 0;
  // Keeps the picture by reference.
  virtual std::unique_ptr<ViewWarp> NewWarp(const SurfacePicture& picture) = 0;
};

// Opens what is asked for. kAuto falls back to the twin and says in `notice` (one line; may be
// null) why; kOpenCl throws Error with every problem found and, where a program does not build,
// the build log. A device is tried in a child process with a small kernel before this process
// touches it (in this process if it uses another device already). Call it before anything else in
// the process uses OpenCL. `stop`: as of SurveyDevices.
std::shared_ptr<Backend> OpenBackend(const DeviceRequest& request, std::string* notice,
                                     const std::function<void()>& stop = {});

// Largest relative differences between a backend and the twin over all kernels on a small problem
// with odd sizes, empty rows and borders.
struct AgreementCheck {
  double float_limit = 1e-4;
  double double_limit = 1e-10;
  double float_error = 0;
  double double_error = 0;  // NaN where the device has no double
  bool agrees = false;      // both errors within their limits
  std::string worst;        // the kernel with the largest difference; empty: there is none
};
AgreementCheck CheckAgreement(Backend* backend);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_DEVICE_H_

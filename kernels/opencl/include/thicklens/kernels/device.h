#ifndef THICKLENS_KERNELS_DEVICE_H_
#define THICKLENS_KERNELS_DEVICE_H_

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "thicklens/base/export.h"

namespace thicklens::kernels {

// These types are for the modules of thicklens. The headers that define them (kernels.h,
// radiance_steps.h and view_warp.h) are not installed.
template <typename Real>
class Kernels;
template <typename Real>
class RadianceSteps;
template <typename Real>
struct DataTerm;
class ViewWarp;
struct SurfaceImage;

// The device that the user requests for the kernels.
struct DeviceRequest {
  // The kind of device that is requested.
  enum class Kind {
    kAuto,    // the best OpenCL device that works, or the C++ reference if none works
    kCpu,     // the C++ reference; OpenCL is not used
    kOpenCl,  // OpenCL or an error
  };
  Kind kind = Kind::kAuto;  // the kind; kOpenCl may name platform and device
  int platform = -1;        // -1: the best
  int device = -1;          // index in the platform; -1: the best
};
// Parses "auto", "cpu", "opencl", "opencl:PLATFORM" or "opencl:PLATFORM:DEVICE". Throws Error for
// any other text.
THICKLENS_EXPORT DeviceRequest ParseDeviceRequest(const std::string& text);

// What OpenCL reports of one device.
struct DeviceDescription {
  int platform = 0;                             // indices in OpenCL's list
  int device = 0;                               // index in the platform
  std::string platform_name, platform_version;  // as the platform reports them
  std::string name, version, driver_version;    // as the device reports them
  std::string type;                             // "cpu", "gpu", "accelerator", "other"
  int compute_units = 0;                        // number of compute units
  bool has_double = false;                      // whether kernels can use double
  std::uint64_t global_memory_bytes = 0;        // memory of the device
  std::uint64_t max_allocation_bytes = 0;       // largest single buffer
  std::uint64_t local_memory_bytes = 0;         // memory that a work group shares
  std::uint64_t max_work_group = 0;             // largest number of items of a work group
  std::string problem;                          // reason why it cannot be used; empty if it can
};

// The OpenCL devices of this machine.
struct DeviceSurvey {
  std::vector<DeviceDescription> devices;  // devices of all platforms, usable or not
  // Platforms without a device, a broken driver, a crash or a hang, one line each, with advice.
  std::vector<std::string> problems;
};

// Lists all devices in a child process (fork), so that a driver that aborts, crashes or hangs
// cannot affect this process. The result is kept: the child runs once per process, or again if
// `again` is true. Once this process uses OpenCL, no child can use it, and `again` has no effect.
//
// `stop` (may be empty) is called several times a second during the survey. If the user requests
// cancellation, it throws Interrupted; the child is then ended, the exception propagates, and no
// result is kept.
THICKLENS_EXPORT const DeviceSurvey& SurveyDevices(bool again = false,
                                                   const std::function<void()>& stop = {});

// A place where kernels are computed: a device with its compiled program, or the C++ reference.
class THICKLENS_EXPORT Backend {
 public:
  virtual ~Backend() = default;
  // Returns whether kernels run on an OpenCL device.
  virtual bool is_opencl() const = 0;
  // Returns whether kernels can use double.
  virtual bool has_double() const = 0;
  virtual std::string name() const = 0;         // "cpu", "opencl:0:0"
  virtual std::string description() const = 0;  // for users: device, platform, versions
  // NewDouble and NewSteps for double throw Error if the device has no double.
  virtual std::unique_ptr<Kernels<float>> NewFloat() = 0;
  // Makes kernels for double. Throws Error if the device has no double.
  virtual std::unique_ptr<Kernels<double>> NewDouble() = 0;
  // Makes the steps of conjugate gradients; `data` is kept by reference. For double it throws Error
  // if the device has no double.
  virtual std::unique_ptr<RadianceSteps<float>> NewSteps(const DataTerm<float>& data) = 0;
  virtual std::unique_ptr<RadianceSteps<double>> NewSteps(const DataTerm<double>& data) = 0;
  // Keeps the data of the image by reference.
  virtual std::unique_ptr<ViewWarp> NewWarp(const SurfaceImage& image) = 0;
};

// Opens the requested device. kAuto falls back to the reference and writes the reason to `notice`
// (one line; may be null). kOpenCl throws Error with every problem found and, if a program does not
// build, the build log. A device is tried in a child process with a small kernel before this
// process uses it (in this process if it already uses another device). The function must be called
// before anything else in the process uses OpenCL. `stop` is that of SurveyDevices.
THICKLENS_EXPORT std::shared_ptr<Backend> OpenBackend(const DeviceRequest& request,
                                                      std::string* notice,
                                                      const std::function<void()>& stop = {});

// Maximum relative differences between a backend and the reference over all kernels, for a small
// problem with odd sizes, empty rows and borders.
struct BackendSelfTest {
  double float_limit = 1e-4;    // largest accepted error in float
  double double_limit = 1e-10;  // largest accepted error in double
  double float_error = 0;       // found error in float
  double double_error = 0;      // NaN if the device has no double
  bool agrees = false;          // both errors are within their limits
  std::string worst;            // kernel with the largest difference; empty if there is none
};
// Compares all kernels of the backend with the reference. Throws Error for errors of the device.
THICKLENS_EXPORT BackendSelfTest RunBackendSelfTest(Backend* backend);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_DEVICE_H_

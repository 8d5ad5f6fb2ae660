#ifndef THICKLENS_KERNELS_OPENCL_DEVICE_SURVEY_H_
#define THICKLENS_KERNELS_OPENCL_DEVICE_SURVEY_H_

#include <functional>
#include <string>
#include <vector>

#include "kernels/opencl/isolated_subprocess.h"
#include "kernels/opencl/opencl_device.h"
#include "thicklens/kernels/device.h"

namespace thicklens::kernels {

// Time limit of a driver in seconds; the very first compilation can take several.
constexpr double kChildLimitS = 60;

// The work of the child: reports platforms and devices from `first_platform` on.
using ListDevices = std::function<void(int first_platform, const SubprocessReport& report)>;
void ListOpenClDevices(int first_platform, const SubprocessReport& report);

// Runs `list` in a child. After a platform that crashes the child, a new child continues with the
// next platform.
DeviceSurvey SurveyWith(const ListDevices& list, double limit_s, const StopCheck& stop = {});

// Compiles a small kernel and the files on the device, and runs the small kernel. Returns the
// problem, or an empty text.
std::string TryDevice(int platform, int device, const std::vector<EmbeddedFile>& files);
// Runs TryDevice in a child process with the library's own files, once for each device. If OpenCL
// is already in use, it runs in this process.
std::string TryDeviceOnce(int platform, int device, const StopCheck& stop);

// The lines of a survey of devices.
std::string PlatformLine(int platform, const std::string& name);
std::string DeviceLine(const DeviceDescription& device);
std::string ProblemLine(const std::string& problem);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_OPENCL_DEVICE_SURVEY_H_

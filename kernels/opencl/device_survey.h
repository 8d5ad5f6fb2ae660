#ifndef THICKLENS_KERNELS_OPENCL_DEVICE_SURVEY_H_
#define THICKLENS_KERNELS_OPENCL_DEVICE_SURVEY_H_

#include <functional>
#include <string>
#include <vector>

#include "kernels/opencl/guarded_child.h"
#include "kernels/opencl/opencl_device.h"
#include "thicklens/kernels/device.h"

namespace thicklens::kernels {

// Seconds that a driver gets; the first compilation of all can take several.
constexpr double kChildLimitS = 60;

// What the child does: tells of platforms and devices from `first_platform` on.
using ListDevices = std::function<void(int first_platform, const Tell& tell)>;
void ListOpenClDevices(int first_platform, const Tell& tell);

// Runs `list` in a child, and again from the next platform on where one brings it down.
DeviceSurvey SurveyWith(const ListDevices& list, double limit_s, const StopCheck& stop = {});

// Compiles a small kernel and the files on the device, and runs the small kernel. Returns what went
// wrong, or nothing.
std::string TryDevice(int platform, int device, const std::vector<EmbeddedFile>& files);
// The same in a child process, with the library's own files, once for each device.
std::string TryDeviceOnce(int platform, int device, const StopCheck& stop);

// What is said in a survey of devices, one line each.
std::string PlatformLine(int platform, const std::string& name);
std::string DeviceLine(const DeviceDescription& device);
std::string ProblemLine(const std::string& problem);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_OPENCL_DEVICE_SURVEY_H_

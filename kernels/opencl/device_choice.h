#ifndef THICKLENS_KERNELS_OPENCL_DEVICE_CHOICE_H_
#define THICKLENS_KERNELS_OPENCL_DEVICE_CHOICE_H_

#include <string>
#include <vector>

#include "thicklens/kernels/device.h"

namespace thicklens::kernels {

// Returns the devices that the request allows and that have no problem, best first. Real devices
// precede simulators (which may claim to be GPUs), devices with double precede others, then the
// order is GPU, accelerator, CPU, other, and finally that of OpenCL's list. Each excluded device
// gets a line in `problems`.
std::vector<DeviceDescription> Candidates(const DeviceSurvey& survey, const DeviceRequest& request,
                                          std::vector<std::string>* problems);

// Returns the text of the request, such as "opencl:0:1", "opencl:0" or "opencl".
std::string RequestText(const DeviceRequest& request);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_OPENCL_DEVICE_CHOICE_H_

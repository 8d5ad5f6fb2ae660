#ifndef THICKLENS_KERNELS_OPENCL_DEVICE_CHOICE_H_
#define THICKLENS_KERNELS_OPENCL_DEVICE_CHOICE_H_

#include <string>
#include <vector>

#include "thicklens/kernels/device.h"

namespace thicklens::kernels {

// Devices that the request allows and that have no problem, best first: real ones before simulators
// (which may claim to be GPUs), with double before without, then GPU, accelerator, CPU, other, and
// as OpenCL lists them. What is left out gets a line in `problems`.
std::vector<DeviceDescription> Candidates(const DeviceSurvey& survey, const DeviceRequest& request,
                                          std::vector<std::string>* problems);

// "opencl:0:1", "opencl:0" and "opencl" as the request has it.
std::string RequestText(const DeviceRequest& request);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_OPENCL_DEVICE_CHOICE_H_

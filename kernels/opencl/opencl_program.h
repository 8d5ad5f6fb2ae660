#ifndef THICKLENS_KERNELS_OPENCL_OPENCL_PROGRAM_H_
#define THICKLENS_KERNELS_OPENCL_OPENCL_PROGRAM_H_

#include <memory>
#include <string>
#include <vector>

#include "kernels/opencl/opencl_device.h"

namespace thicklens::kernels {

// Returns a text such as "error -5, out of resources", with the name if the error is a common one.
std::string OpenClErrorText(int error);

// Returns true if the device has double. Drivers report it in two ways: as a core feature since
// 1.2, and as an extension.
bool HasDouble(const cl::Device& device);

// Opens the device with these indices. Afterwards OpenCL is in use in this process. Throws Error.
std::shared_ptr<const OpenClDevice> OpenOpenClDevice(int platform, int device);

// Converts the build log of NVIDIA's compiler, which ignores #line and counts the lines of the
// whole source: "<kernel>:LINE:" is replaced by the file and its line, as in the logs of other
// compilers.
std::string WithFilesNamed(const std::string& log, const std::string& source);

// BuildKernels for any files.
cl::Program BuildProgram(const OpenClDevice& device, const std::vector<EmbeddedFile>& files,
                         const std::string& real);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_OPENCL_OPENCL_PROGRAM_H_

#ifndef THICKLENS_KERNELS_OPENCL_OPENCL_PROGRAM_H_
#define THICKLENS_KERNELS_OPENCL_OPENCL_PROGRAM_H_

#include <memory>
#include <string>
#include <vector>

#include "kernels/opencl/opencl_device.h"

namespace thicklens::kernels {

// "error -5, out of resources"; the name where it is one of the common ones.
std::string OpenClErrorText(int error);

// Drivers have two ways of saying it: in core since 1.2, and as an extension.
bool HasDouble(const cl::Device& device);

// Opens the device with these indices. From here on OpenCL is in use in this process. Throws Error.
std::shared_ptr<const OpenClDevice> OpenOpenClDevice(int platform, int device);

// What NVIDIA's compiler says of a program. It ignores #line and counts the lines of the whole
// source: in place of "<kernel>:LINE:" stand the file and the line in it, as others have them.
std::string WithFilesNamed(const std::string& log, const std::string& source);

// BuildKernels for any files.
cl::Program BuildProgram(const OpenClDevice& device, const std::vector<EmbeddedFile>& files,
                         const std::string& real);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_OPENCL_OPENCL_PROGRAM_H_

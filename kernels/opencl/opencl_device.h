#ifndef THICKLENS_KERNELS_OPENCL_OPENCL_DEVICE_H_
#define THICKLENS_KERNELS_OPENCL_OPENCL_DEVICE_H_

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

// These macros must be equal in every source file, including tests, because the library's classes
// depend on them.
#ifndef CL_TARGET_OPENCL_VERSION
#define CL_TARGET_OPENCL_VERSION 120
#endif
#ifndef CL_HPP_TARGET_OPENCL_VERSION
#define CL_HPP_TARGET_OPENCL_VERSION 120
#endif
#define CL_HPP_ENABLE_EXCEPTIONS
#define CL_HPP_MINIMUM_OPENCL_VERSION 120
#include <CL/opencl.hpp>

#include "thicklens/kernels/kernels.h"
#include "thicklens/kernels/radiance_steps.h"
#include "thicklens/kernels/view_warp.h"

namespace thicklens::kernels {

// A .cl file with the exact content of the repository.
struct EmbeddedFile {
  std::string path;  // "kernels/opencl/project.cl", for #line and messages
  std::string text;
};
const std::vector<EmbeddedFile>& EmbeddedKernelFiles();

// An open device. Its program is compiled for one Real at a time.
struct OpenClDevice {
  cl::Context context;
  cl::Device device;
  std::string name;         // "opencl:0:0"
  std::string description;  // for users
  bool has_double = false;
  bool is_cpu = false;
};

// The division of work of kernels over images on a device: filter.cl.
struct ItemForm {
  int lanes = 1;   // adjacent pixels that an item computes together
  int tile = 32;   // adjacent pixels that share their terms; a multiple of lanes
  int slice = 32;  // rows that share their number of entries
};
ItemForm FormOf(const OpenClDevice& device, std::size_t bytes_of_real);

// Builds all kernel files as one program, each after its #line. `real` is "float" or "double"; the
// program gets it as the macro REAL (and REAL_IS_DOUBLE), and the form as LANES, TILE and SLICE.
// Throws Error with the device and the build log.
cl::Program BuildKernels(const OpenClDevice& device, const std::string& real);

template <typename Real>
std::unique_ptr<Kernels<Real>> NewOpenClKernels(std::shared_ptr<const OpenClDevice> device,
                                                const cl::Program& program);
// Copies `data` and keeps no reference to it.
template <typename Real>
std::unique_ptr<RadianceSteps<Real>> NewOpenClSteps(std::shared_ptr<const OpenClDevice> device,
                                                    const cl::Program& program,
                                                    const DataTerm<Real>& data);
std::unique_ptr<ViewWarp> NewOpenClWarp(std::shared_ptr<const OpenClDevice> device,
                                        const cl::Program& program, const SurfaceImage& image);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_OPENCL_OPENCL_DEVICE_H_

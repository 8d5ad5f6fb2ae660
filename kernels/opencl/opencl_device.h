#ifndef THICKLENS_KERNELS_OPENCL_OPENCL_DEVICE_H_
#define THICKLENS_KERNELS_OPENCL_OPENCL_DEVICE_H_

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

// The same in every source, tests included: the library's classes depend on them.
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

// A .cl file as it is in the repository, byte for byte.
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
  std::string description;  // for people
  bool has_double = false;
  bool is_cpu = false;
};

// How kernels over pictures divide their work on a device: filter.cl.
struct ItemForm {
  int lanes = 1;   // pixels beside each other that an item computes together
  int tile = 32;   // pixels beside each other that share their terms; a multiple of lanes
  int slice = 32;  // rows that share their number of entries
};
ItemForm FormOf(const OpenClDevice& device, std::size_t bytes_of_real);

// All kernel files as one program, each behind its #line. `real` is "float" or "double"; the
// program sees it as the macro REAL (and REAL_IS_DOUBLE), and the form as LANES, TILE and SLICE.
// Throws Error with the device and the build log.
cl::Program BuildKernels(const OpenClDevice& device, const std::string& real);

template <typename Real>
std::unique_ptr<Kernels<Real>> NewOpenClKernels(std::shared_ptr<const OpenClDevice> device,
                                                const cl::Program& program);
// Keeps nothing of `data`.
template <typename Real>
std::unique_ptr<RadianceSteps<Real>> NewOpenClSteps(std::shared_ptr<const OpenClDevice> device,
                                                    const cl::Program& program,
                                                    const DataTerm<Real>& data);
std::unique_ptr<ViewWarp> NewOpenClWarp(std::shared_ptr<const OpenClDevice> device,
                                        const cl::Program& program, const SurfacePicture& picture);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_OPENCL_OPENCL_DEVICE_H_

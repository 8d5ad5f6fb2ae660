#ifndef THICKLENS_KERNELS_OPENCL_OPENCL_KERNELS_H_
#define THICKLENS_KERNELS_OPENCL_OPENCL_KERNELS_H_

#include <memory>

#include "kernels/opencl/opencl_call.h"
#include "thicklens/kernels/kernels.h"

namespace thicklens::kernels {

// NewOpenClKernels on any queue, whose program is built for Real.
template <typename Real>
std::unique_ptr<Kernels<Real>> NewOpenClKernelsOn(std::unique_ptr<OpenClQueue> queue);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_OPENCL_OPENCL_KERNELS_H_

#include "kernels/opencl/opencl_use.h"

#include <atomic>

namespace thicklens::kernels {
namespace {

std::atomic<bool> opencl_in_use{false};

}  // namespace

void SetOpenClInUse() { opencl_in_use = true; }
bool IsOpenClInUse() { return opencl_in_use; }

}  // namespace thicklens::kernels

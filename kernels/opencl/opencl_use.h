#ifndef THICKLENS_KERNELS_OPENCL_OPENCL_USE_H_
#define THICKLENS_KERNELS_OPENCL_OPENCL_USE_H_

namespace thicklens::kernels {

// What looks at drivers does so in a child process, and that works only as long as OpenCL is not
// in use in this one: a copy of a process with a loaded driver lacks the driver's threads. So:
// first the survey and the trials, then the device. SetOpenClInUse says that the time has come.
// From then on the survey is the one that was made, and a trial of another device is made in this
// process, without the guard.
void SetOpenClInUse();
bool IsOpenClInUse();

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_OPENCL_OPENCL_USE_H_

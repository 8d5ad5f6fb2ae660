#ifndef THICKLENS_KERNELS_OPENCL_OPENCL_USE_H_
#define THICKLENS_KERNELS_OPENCL_OPENCL_USE_H_

namespace thicklens::kernels {

// Drivers are examined in a child process, which works only as long as OpenCL is not in use in this
// process, because a copy of a process with a loaded driver lacks the driver's threads. The survey
// and the trials therefore precede the device. SetOpenClInUse marks this point. Afterwards the
// survey returns its previous result, and a trial of another device runs in this process, without
// the guard.
void SetOpenClInUse();
bool IsOpenClInUse();

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_OPENCL_OPENCL_USE_H_

// Loaded before the OpenCL library (LD_PRELOAD), it makes calls of OpenCL fail from a chosen one
// on, as those of a driver do that has lost its device, or whose compiler is broken:
//   THICKLENS_FAULT=CALL:N:ERROR   CALL is a function below; N counts from 1 in each process.
#define CL_TARGET_OPENCL_VERSION 120
#define CL_USE_DEPRECATED_OPENCL_1_2_APIS
#include <CL/cl.h>
#include <dlfcn.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace {

struct Fault {
  char call[64] = "";
  int first = 0;
  cl_int error = CL_SUCCESS;
};

const Fault& TheFault() {
  static const Fault fault = [] {
    Fault read;
    const char* text = std::getenv("THICKLENS_FAULT");
    if (text == nullptr ||
        std::sscanf(text, "%63[^:]:%d:%d", read.call, &read.first, &read.error) != 3) {
      std::fprintf(stderr, "THICKLENS_FAULT must be CALL:N:ERROR\n");
      std::abort();
    }
    return read;
  }();
  return fault;
}

// The error with which this call is to fail, or CL_SUCCESS if it is not to fail.
cl_int FaultOf(const char* call) {
  static std::atomic<int> calls{0};
  if (std::strcmp(call, TheFault().call) != 0) return CL_SUCCESS;
  return ++calls >= TheFault().first ? TheFault().error : CL_SUCCESS;
}

template <typename Function>
Function* Real(const char* call) {
  void* found = ::dlsym(RTLD_NEXT, call);
  if (found == nullptr) std::abort();
  return reinterpret_cast<Function*>(found);
}

}  // namespace

extern "C" {

cl_int clBuildProgram(cl_program program, cl_uint device_count, const cl_device_id* devices,
                      const char* options, void(CL_CALLBACK* notify)(cl_program, void*),
                      void* user_data) {
  if (const cl_int error = FaultOf(__func__)) return error;
  return Real<decltype(clBuildProgram)>(__func__)(program, device_count, devices, options, notify,
                                                  user_data);
}

cl_int clEnqueueNDRangeKernel(cl_command_queue queue, cl_kernel kernel, cl_uint dimensions,
                              const size_t* offset, const size_t* global, const size_t* local,
                              cl_uint wait_count, const cl_event* wait, cl_event* event) {
  if (const cl_int error = FaultOf(__func__)) return error;
  return Real<decltype(clEnqueueNDRangeKernel)>(__func__)(queue, kernel, dimensions, offset, global,
                                                          local, wait_count, wait, event);
}

// A lost device does not work any more, so this call must fail as well when the loss is reported.
cl_int clFinish(cl_command_queue queue) {
  const cl_int result = Real<decltype(clFinish)>(__func__)(queue);
  if (const cl_int error = FaultOf(__func__)) return error;
  return result;
}

cl_mem clCreateBuffer(cl_context context, cl_mem_flags flags, size_t bytes, void* host,
                      cl_int* error) {
  if (const cl_int fault = FaultOf(__func__)) {
    if (error != nullptr) *error = fault;
    return nullptr;
  }
  return Real<decltype(clCreateBuffer)>(__func__)(context, flags, bytes, host, error);
}

}  // extern "C"

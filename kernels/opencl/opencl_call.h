#ifndef THICKLENS_KERNELS_OPENCL_OPENCL_CALL_H_
#define THICKLENS_KERNELS_OPENCL_OPENCL_CALL_H_

#include <cstddef>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "kernels/opencl/opencl_device.h"

namespace thicklens::kernels {

// The way in which a device gets an array of the host.
enum class HostMemory {
  kShared,  // the device works in the memory of the host
  kCopied,
};
// Returns kShared if the device reports that it shares the host's memory.
HostMemory HostMemoryOf(const OpenClDevice& device);

// A queue of a device and the kernels of a program, for one thread, because OpenCL keeps a kernel's
// arguments in the kernel. Throws Error for errors of the device.
class OpenClQueue {
 public:
  OpenClQueue(std::shared_ptr<const OpenClDevice> device, cl::Program program, HostMemory memory);

  // Returns another queue on the same device and program, with its own kernels.
  std::unique_ptr<OpenClQueue> Clone() const;

  // Waits until all data sent are available for other queues as well.
  void Finish();
  // Waits until no command uses shared memory; errors are ignored.
  void WaitNoThrow() noexcept;
  // Throws Error if the device does not allow a buffer of this size.
  void CheckAllocation(const std::string& what, std::size_t bytes) const;

 private:
  friend class OpenClCall;
  friend class DeviceArray;
  friend class DeviceMemory;

  struct Entry {
    cl::Kernel kernel;
    std::size_t group_items = 0;
  };
  Entry& EntryOf(const std::string& kernel);
  cl::Buffer NewBuffer(const std::string& what, void* data, std::size_t bytes, bool is_read,
                       bool is_written);
  // Returns at once. The data are available when the queue is done, and the event reports the
  // success.
  cl::Event EnqueueCopyToHost(const std::string& what, const cl::Buffer& buffer, void* data,
                              std::size_t bytes);

  std::shared_ptr<const OpenClDevice> device_;
  cl::Program program_;
  cl::CommandQueue queue_;
  std::map<std::string, Entry> entries_;
  HostMemory memory_;
  cl_ulong max_allocation_bytes_ = 0;
};

// Numbers that stay on the device from call to call. `data` is their memory on the host. It must
// outlive this object and must not be accessed before CopyToHost.
class DeviceArray {
 public:
  enum class Holds {
    kData,     // the numbers in the host's memory
    kNothing,  // undefined until a kernel has written every element
  };
  DeviceArray(OpenClQueue* queue, const std::string& what, void* data, std::size_t bytes,
              Holds holds = Holds::kData);
  // Waits for calls that still use the memory, because an error may have occurred before they
  // ended.
  ~DeviceArray() { queue_->WaitNoThrow(); }
  DeviceArray(const DeviceArray&) = default;
  DeviceArray& operator=(const DeviceArray&) = default;
  void CopyToHost();

 private:
  friend class OpenClCall;

  OpenClQueue* queue_;
  std::string what_;
  void* data_;
  std::size_t bytes_;
  cl::Buffer buffer_;
};

// Memory that exists only on the device.
class DeviceMemory {
 public:
  // Memory of 0 bytes is a valid argument of a kernel; Write and Read then do nothing.
  DeviceMemory(OpenClQueue* queue, const std::string& what, std::size_t bytes);
  void Clear();  // sets all bytes to 0
  void Write(const void* from);
  void Read(void* to) const;  // after all previous calls are done
  std::size_t bytes() const { return bytes_; }

 private:
  friend class OpenClCall;

  OpenClQueue* queue_;
  std::string what_;
  std::size_t bytes_;
  cl::Buffer buffer_;
};

template <typename Plain>
DeviceMemory Copied(OpenClQueue* queue, const std::string& what, const std::vector<Plain>& array) {
  DeviceMemory memory(queue, what, array.size() * sizeof(Plain));
  memory.Write(array.data());
  return memory;
}

// One call of a kernel: the arguments in the kernel's order, then Run. Arrays must not be empty.
class OpenClCall {
 public:
  OpenClCall(OpenClQueue* queue, const std::string& kernel);

  template <typename Plain>
  OpenClCall& Value(const Plain& value) {
    SetBytes(&value, sizeof(Plain));
    return *this;
  }
  template <typename Plain>
  OpenClCall& Input(const std::string& what, const std::vector<Plain>& array) {
    // The device only reads the array.
    AddArray(what, const_cast<Plain*>(array.data()), array.size() * sizeof(Plain), true, false);
    return *this;
  }
  // An array of which the kernel writes every element.
  template <typename Plain>
  OpenClCall& Output(const std::string& what, std::vector<Plain>* array) {
    AddArray(what, array->data(), array->size() * sizeof(Plain), false, true);
    return *this;
  }
  template <typename Plain>
  OpenClCall& InputOutput(const std::string& what, std::vector<Plain>* array) {
    AddArray(what, array->data(), array->size() * sizeof(Plain), true, true);
    return *this;
  }
  OpenClCall& OnDevice(const DeviceArray& array);
  OpenClCall& OnDevice(const DeviceMemory& memory);

  // Returns when the kernel is done and the outputs are in the host's memory.
  void Run(std::size_t items);
  // Returns at once; later calls and reads wait. No array may be an output, and inputs must stay
  // until the queue is done.
  void Enqueue(std::size_t items);
  // Number of groups for this number of items.
  std::size_t Groups(std::size_t items) const;

 private:
  struct Array {
    std::string what;
    cl::Buffer buffer;
    void* data;
    std::size_t bytes;
    bool is_written;
    cl::Event sent;
  };
  void SetBytes(const void* bytes, std::size_t count);
  void SetBuffer(const cl::Buffer& buffer);
  void AddArray(const std::string& what, void* data, std::size_t bytes, bool is_read,
                bool is_written);

  OpenClQueue* queue_;
  std::string name_;
  OpenClQueue::Entry* entry_;
  cl_uint next_argument_ = 0;
  std::vector<Array> arrays_;
};

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_OPENCL_OPENCL_CALL_H_

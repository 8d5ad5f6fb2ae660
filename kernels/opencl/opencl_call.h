#ifndef THICKLENS_KERNELS_OPENCL_OPENCL_CALL_H_
#define THICKLENS_KERNELS_OPENCL_OPENCL_CALL_H_

#include <cstddef>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "kernels/opencl/opencl_device.h"

namespace thicklens::kernels {

// How a device comes to a host's array.
enum class HostMemory {
  kShared,  // lent to the device, which works in it
  kCopied,
};
// kShared where the device says that it has the host's memory.
HostMemory HostMemoryOf(const OpenClDevice& device);

// A queue of a device, and the kernels of a program for one thread: OpenCL keeps a kernel's
// arguments in the kernel. Throws Error for whatever the device reports.
class OpenClQueue {
 public:
  OpenClQueue(std::shared_ptr<const OpenClDevice> device, cl::Program program, HostMemory memory);

  // Another queue on the same device and program, with its own kernels.
  std::unique_ptr<OpenClQueue> Clone() const;

  // Waits until all that was sent is there for other queues as well.
  void Finish();
  // Waits until nothing works in memory that is lent, whatever became of it.
  void Settle() noexcept;
  // Whether the device can have that much in one piece.
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
  // Returns at once: it is there when the queue is done, and the event says whether it came.
  cl::Event SendHome(const std::string& what, const cl::Buffer& buffer, void* data,
                     std::size_t bytes);

  std::shared_ptr<const OpenClDevice> device_;
  cl::Program program_;
  cl::CommandQueue queue_;
  std::map<std::string, Entry> entries_;
  HostMemory memory_;
  cl_ulong max_allocation_bytes_ = 0;
};

// Numbers that stay on the device from call to call. `data` is their home, which must outlive this
// and is not to be touched before BringHome.
class DeviceArray {
 public:
  enum class Holds {
    kData,     // what is at home
    kNothing,  // until a kernel has written every element
  };
  DeviceArray(OpenClQueue* queue, const std::string& what, void* data, std::size_t bytes,
              Holds holds = Holds::kData);
  // Waits for calls that still work in it: an error may have come between.
  ~DeviceArray() { queue_->Settle(); }
  DeviceArray(const DeviceArray&) = default;
  DeviceArray& operator=(const DeviceArray&) = default;
  void BringHome();

 private:
  friend class OpenClCall;

  OpenClQueue* queue_;
  std::string what_;
  void* data_;
  std::size_t bytes_;
  cl::Buffer buffer_;
};

// Memory of the device alone.
class DeviceMemory {
 public:
  // Of 0 bytes it is one a kernel can be given, and nothing is written or read.
  DeviceMemory(OpenClQueue* queue, const std::string& what, std::size_t bytes);
  void Clear();  // all bytes 0
  void Write(const void* from);
  void Read(void* to) const;  // when all calls before are done
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

// One call of a kernel: arguments in the kernel's order, then Run. Arrays must not be empty.
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
    // Lent for reading only.
    AddArray(what, const_cast<Plain*>(array.data()), array.size() * sizeof(Plain), true, false);
    return *this;
  }
  // What the kernel writes, every element of it.
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

  // Returns when all is done and the outputs are at home.
  void Run(std::size_t items);
  // Returns at once; what is called or read later waits. No array may be an output, and inputs must
  // stay until the queue is done.
  void Enqueue(std::size_t items);
  // Of so many items.
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

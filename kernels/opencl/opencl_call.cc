#include "kernels/opencl/opencl_call.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "kernels/opencl/opencl_program.h"
#include "thicklens/base/error.h"

namespace thicklens::kernels {
namespace {

// The size is fixed because some drivers compile a kernel once for each group size.
constexpr std::size_t kGroupItems = 64;

// Runs `work`; converts errors of OpenCL to an Error that names `what` and the device.
template <typename Work>
decltype(auto) Guarded(const OpenClDevice& device, const std::string& what, const Work& work) {
  try {
    return work();
  } catch (const cl::Error& error) {
    throw Error(fmt::format("device {}: {}: {}: {}", device.name, what, error.what(),
                            OpenClErrorText(error.err())));
  }
}

}  // namespace

HostMemory HostMemoryOf(const OpenClDevice& device) {
  return Guarded(device, "memory", [&] {
    return device.device.getInfo<CL_DEVICE_HOST_UNIFIED_MEMORY>() == CL_TRUE ? HostMemory::kShared
                                                                             : HostMemory::kCopied;
  });
}

OpenClQueue::OpenClQueue(std::shared_ptr<const OpenClDevice> device, cl::Program program,
                         HostMemory memory)
    : device_(std::move(device)), program_(std::move(program)), memory_(memory) {
  Guarded(*device_, "new queue", [&] {
    queue_ = cl::CommandQueue(device_->context, device_->device);
    max_allocation_bytes_ = device_->device.getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>();
  });
}

std::unique_ptr<OpenClQueue> OpenClQueue::Clone() const {
  return std::make_unique<OpenClQueue>(device_, program_, memory_);
}

void OpenClQueue::Finish() {
  Guarded(*device_, "queue", [&] { return queue_.finish(); });
}

void OpenClQueue::WaitNoThrow() noexcept {
  try {
    queue_.finish();
  } catch (...) {  // the original error is the one to report
  }
}

OpenClQueue::Entry& OpenClQueue::EntryOf(const std::string& kernel) {
  const auto found = entries_.find(kernel);
  if (found != entries_.end()) return found->second;
  return Guarded(*device_, "kernel " + kernel, [&]() -> Entry& {
    Entry entry;
    entry.kernel = cl::Kernel(program_, kernel.c_str());
    entry.group_items = std::min(
        kGroupItems, entry.kernel.getWorkGroupInfo<CL_KERNEL_WORK_GROUP_SIZE>(device_->device));
    return entries_.emplace(kernel, std::move(entry)).first->second;
  });
}

void OpenClQueue::CheckAllocation(const std::string& what, std::size_t bytes) const {
  if (bytes > max_allocation_bytes_) {
    throw Error(
        fmt::format("device {}: {}: {} bytes are needed, but the device allows at most {} in one "
                    "buffer; the device cpu has no such limit",
                    device_->name, what, bytes, max_allocation_bytes_));
  }
}

cl::Buffer OpenClQueue::NewBuffer(const std::string& what, void* data, std::size_t bytes,
                                  bool is_read, bool is_written) {
  CheckAllocation(what, bytes);
  return Guarded(*device_, what, [&] {
    cl_mem_flags flags = !is_written ? CL_MEM_READ_ONLY
                         : !is_read  ? CL_MEM_WRITE_ONLY
                                     : CL_MEM_READ_WRITE;
    if (memory_ == HostMemory::kShared) {
      flags |= CL_MEM_USE_HOST_PTR;
    } else if (is_read) {
      flags |= CL_MEM_COPY_HOST_PTR;
    }
    const bool has_data = memory_ == HostMemory::kShared || is_read;
    return cl::Buffer(device_->context, flags, bytes, has_data ? data : nullptr);
  });
}

cl::Event OpenClQueue::EnqueueCopyToHost(const std::string& what, const cl::Buffer& buffer,
                                         void* data, std::size_t bytes) {
  return Guarded(*device_, what, [&] {
    cl::Event sent;
    if (memory_ == HostMemory::kCopied) {
      queue_.enqueueReadBuffer(buffer, CL_FALSE, 0, bytes, data, nullptr, &sent);
      return sent;
    }
    // Mapping updates the shared memory; nothing is copied if the device works in it.
    void* mapped = queue_.enqueueMapBuffer(buffer, CL_FALSE, CL_MAP_READ, 0, bytes, nullptr, &sent);
    queue_.enqueueUnmapMemObject(buffer, mapped);
    return sent;
  });
}

DeviceArray::DeviceArray(OpenClQueue* queue, const std::string& what, void* data, std::size_t bytes,
                         Holds holds)
    : queue_(queue),
      what_(what),
      data_(data),
      bytes_(bytes),
      buffer_(queue->NewBuffer(what, data, bytes, holds == Holds::kData, true)) {}

void DeviceArray::CopyToHost() {
  const cl::Event sent = queue_->EnqueueCopyToHost(what_, buffer_, data_, bytes_);
  Guarded(*queue_->device_, what_, [&] {
    queue_->queue_.finish();
    sent.wait();
  });
}

DeviceMemory::DeviceMemory(OpenClQueue* queue, const std::string& what, std::size_t bytes)
    : queue_(queue), what_(what), bytes_(bytes) {
  queue_->CheckAllocation(what, bytes_);
  Guarded(*queue_->device_, what_, [&] {
    // OpenCL has no buffer of 0 bytes.
    buffer_ =
        cl::Buffer(queue_->device_->context, CL_MEM_READ_WRITE, std::max<std::size_t>(bytes_, 1));
  });
}

void DeviceMemory::Clear() {
  if (bytes_ == 0) return;
  Guarded(*queue_->device_, what_,
          [&] { queue_->queue_.enqueueFillBuffer(buffer_, cl_uchar{0}, 0, bytes_); });
}

void DeviceMemory::Write(const void* from) {
  if (bytes_ == 0) return;
  Guarded(*queue_->device_, what_,
          [&] { queue_->queue_.enqueueWriteBuffer(buffer_, CL_TRUE, 0, bytes_, from); });
}

void DeviceMemory::Read(void* to) const {
  if (bytes_ == 0) return;
  Guarded(*queue_->device_, what_,
          [&] { queue_->queue_.enqueueReadBuffer(buffer_, CL_TRUE, 0, bytes_, to); });
}

OpenClCall::OpenClCall(OpenClQueue* queue, const std::string& kernel)
    : queue_(queue), name_("kernel " + kernel), entry_(&queue->EntryOf(kernel)) {}

OpenClCall& OpenClCall::OnDevice(const DeviceArray& array) {
  SetBuffer(array.buffer_);
  return *this;
}

OpenClCall& OpenClCall::OnDevice(const DeviceMemory& memory) {
  SetBuffer(memory.buffer_);
  return *this;
}

void OpenClCall::SetBytes(const void* bytes, std::size_t count) {
  Guarded(*queue_->device_, name_,
          [&] { entry_->kernel.setArg(next_argument_++, count, const_cast<void*>(bytes)); });
}

void OpenClCall::SetBuffer(const cl::Buffer& buffer) {
  Guarded(*queue_->device_, name_, [&] { entry_->kernel.setArg(next_argument_++, buffer); });
}

void OpenClCall::AddArray(const std::string& what, void* data, std::size_t bytes, bool is_read,
                          bool is_written) {
  const std::string name = name_ + ", " + what;
  arrays_.push_back({name,
                     queue_->NewBuffer(name, data, bytes, is_read, is_written),
                     data,
                     bytes,
                     is_written,
                     {}});
  SetBuffer(arrays_.back().buffer);
}

std::size_t OpenClCall::Groups(std::size_t items) const {
  return (items + entry_->group_items - 1) / entry_->group_items;
}

void OpenClCall::Enqueue(std::size_t items) {
  Guarded(*queue_->device_, name_, [&] {
    const std::size_t group = entry_->group_items;
    queue_->queue_.enqueueNDRangeKernel(entry_->kernel, cl::NullRange,
                                        cl::NDRange(Groups(items) * group), cl::NDRange(group));
  });
}

void OpenClCall::Run(std::size_t items) {
  try {
    Enqueue(items);
    for (Array& array : arrays_) {
      if (!array.is_written) continue;
      array.sent = queue_->EnqueueCopyToHost(array.what, array.buffer, array.data, array.bytes);
    }
    // One wait for everything, because on a CPU each wait costs as much as a small kernel. An error
    // while the kernel runs is reported with its name.
    Guarded(*queue_->device_, name_, [&] { queue_->queue_.finish(); });
    for (const Array& array : arrays_) {
      if (array.is_written) Guarded(*queue_->device_, array.what, [&] { array.sent.wait(); });
    }
  } catch (...) {
    queue_->WaitNoThrow();  // the arrays may be destroyed after the error
    throw;
  }
}

}  // namespace thicklens::kernels

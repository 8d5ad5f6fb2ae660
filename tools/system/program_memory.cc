// This file is linked with programs themselves and is not part of a library: it replaces operator
// new.
#include "tools/system/program_memory.h"

#include <cstdlib>  // says whether it is glibc

#include "tools/system/sanitized.h"

#if defined(__GLIBC__) && defined(__linux__) && !defined(THICKLENS_IS_SANITIZED)

#include <malloc.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <mutex>
#include <new>

namespace {

constexpr std::size_t kMib = std::size_t{1} << 20;
// For smaller allocations the growth of the heap is not checked.
constexpr std::size_t kLarge = 64 * 1024;
// An allocation of this size is outside the heap, and returns to the system when it is freed.
constexpr std::size_t kOutsideHeap = 64 * kMib;

// The end of the part of the heap for which huge pages were requested. glibc can do this by itself,
// but only if its environment says so before the program starts (glibc.malloc.hugetlb).
std::mutex heap_mutex;
std::atomic<std::uintptr_t> asked_until = 0;  // 0: nothing was requested yet

std::uintptr_t HeapEnd() { return reinterpret_cast<std::uintptr_t>(::sbrk(0)); }

std::uintptr_t PageAtOrAbove(std::uintptr_t place) {
  static const auto page = static_cast<std::uintptr_t>(::sysconf(_SC_PAGESIZE));
  return (place + page - 1) / page * page;
}

// This is only a request: if the system does not grant it, memory works as without it.
void AskForHugePages(std::uintptr_t from, std::uintptr_t to) {
  if (from < to) ::madvise(reinterpret_cast<void*>(from), to - from, MADV_HUGEPAGE);
}

// Requests huge pages for the part by which the heap has grown since the last call. A part that
// shrank and grew again between two calls is missed. If another thread is doing this already, the
// function returns at once: no thread waits, and neither does a child after fork().
void FollowHeapEnd() {
  const std::unique_lock<std::mutex> lock(heap_mutex, std::try_to_lock);
  if (!lock || asked_until == 0) return;
  const std::uintptr_t end = HeapEnd();
  AskForHugePages(asked_until, end);
  asked_until = std::min(end, HeapEnd());  // another thread may have released it meanwhile
}

void* TakeMemory(std::size_t bytes) {
  if (bytes < kLarge) return std::malloc(bytes > 0 ? bytes : 1);
  FollowHeapEnd();  // it may have shrunk
  void* const memory = std::malloc(bytes);
  FollowHeapEnd();
  if (memory != nullptr && bytes >= kOutsideHeap && asked_until != 0) {
    const auto begin = reinterpret_cast<std::uintptr_t>(memory);
    AskForHugePages(PageAtOrAbove(begin), begin + bytes);
  }
  return memory;
}

bool MemoryIsLimited() {
  for (const auto resource : {RLIMIT_AS, RLIMIT_DATA}) {
    rlimit limit{};
    if (::getrlimit(resource, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY) return true;
  }
  return false;
}

}  // namespace

void* operator new(std::size_t bytes) {
  for (;;) {
    if (void* memory = TakeMemory(bytes)) return memory;
    const std::new_handler handler = std::get_new_handler();
    if (handler == nullptr) throw std::bad_alloc();
    handler();
  }
}

void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace thicklens::tools {

void KeepFreedMemory() {
  mallopt(M_MMAP_THRESHOLD, kOutsideHeap);
  mallopt(M_TRIM_THRESHOLD, 256 * kMib);
  // All threads share one heap, so that memory which one of them has freed is available to the
  // next.
  mallopt(M_ARENA_MAX, 1);
  // The heap grows by much more than a huge page. If memory is limited, it grows only by what is
  // needed, because glibc does not retry with less.
  if (!MemoryIsLimited()) mallopt(M_TOP_PAD, 64 * kMib);
  const std::lock_guard<std::mutex> lock(heap_mutex);
  asked_until = PageAtOrAbove(HeapEnd());
}

}  // namespace thicklens::tools

#else

namespace thicklens::tools {

void KeepFreedMemory() {}

}  // namespace thicklens::tools

#endif

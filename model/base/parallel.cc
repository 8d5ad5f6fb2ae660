#include "thicklens/base/parallel.h"

#include <algorithm>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

#include "thicklens/base/cancel.h"

namespace thicklens {

int ResolveThreads(int threads) {
  if (threads > 0) return threads;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

void ParallelFor(int count, int threads, const std::function<void(int)>& work) {
  std::mutex mutex;
  int next = 0;
  int failed_index = count;
  std::exception_ptr failure;
  const CancelToken* const token = CurrentCancelToken();
  const auto run = [&] {
    const CancelScope scope(token);
    for (;;) {
      int index = 0;
      {
        const std::lock_guard<std::mutex> lock(mutex);
        // Indices are assigned in order, so that every index below a failed one has already been
        // started.
        if (next >= count || failure) return;
        index = next++;
      }
      try {
        ThrowIfCancelled();
        work(index);
      } catch (...) {
        const std::lock_guard<std::mutex> lock(mutex);
        if (index < failed_index) {
          failed_index = index;
          failure = std::current_exception();
        }
      }
    }
  };
  const int workers = std::min(ResolveThreads(threads), count);
  std::vector<std::thread> pool;
  try {
    for (int i = 1; i < workers; ++i) pool.emplace_back(run);
  } catch (const std::system_error&) {
    // The system provides no more threads; the existing ones do the work.
  }
  run();
  for (std::thread& thread : pool) thread.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace thicklens

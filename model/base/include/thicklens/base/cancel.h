#ifndef THICKLENS_BASE_CANCEL_H_
#define THICKLENS_BASE_CANCEL_H_

#include <atomic>

#include "thicklens/base/error.h"

// How a computation is stopped. Whoever starts it makes a CancelToken and a CancelScope:
//
//   thicklens::CancelToken token;  // token.Cancel() by another thread, or by a signal handler
//   const thicklens::CancelScope scope(&token);
//   estimator::EstimateScene(...);  // throws Interrupted soon after the token was cancelled
//
// Every function of the modules looks at the token of the thread that calls it, and so do the
// threads that it starts. It throws Interrupted at its next safe point; what it was to fill is then
// in no defined state, and may be filled again or destroyed. Nothing is printed, and no process
// ends.
//
// The longest interval between two safe points, of CPU time of one thread of an Intel Xeon:
// - loops of these modules: 0.2 s is what they are written for. They look at the token at least
// once
//   per row of an image, per solver step, or per 1/32 of a pass over an image; 0.12 s is the
//   longest that was measured (1282 x 1110 px, 7 x 7 views).
// - a library that computes in one call: as long as that takes. These are the factorization of one
//   block by SuiteSparse or Eigen (EstimateByBlocks: 1 s was measured for blocks of the usual size;
//   it grows with the power 1.5 to 2 of the number of unknowns), the dense decompositions of
//   ConditioningOfBlock (2.4 s), one image blurred, transformed or registered by OpenCV,
//   cv::inpaint (InpaintHiddenRays; minutes where most of a large image is hidden), and an OpenCL
//   driver that compiles or computes (seconds).
// A program that has to end at once meanwhile removes what is unfinished by AbandonOutputs
// (thicklens/base/temporaries.h) and ends its process.
namespace thicklens {

// Says that a computation is to stop: once cancelled, it stays so.
class CancelToken {
 public:
  // From any thread, and from a signal handler.
  void Cancel() noexcept { is_cancelled_.store(true, std::memory_order_relaxed); }
  bool IsCancelled() const noexcept { return is_cancelled_.load(std::memory_order_relaxed); }

 private:
  std::atomic<bool> is_cancelled_{false};
  static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may not take a lock");
};

namespace internal {
inline thread_local const CancelToken* cancel_token = nullptr;
}  // namespace internal

// The token that this thread's computations look at; null: none.
inline const CancelToken* CurrentCancelToken() noexcept { return internal::cancel_token; }

// As long as it lives, this thread's computations look at that token, which must outlive it; null:
// at none. It must end on the thread where it began, after those that began later.
class CancelScope {
 public:
  explicit CancelScope(const CancelToken* token) noexcept : before_(internal::cancel_token) {
    internal::cancel_token = token;
  }
  ~CancelScope() { internal::cancel_token = before_; }
  CancelScope(const CancelScope&) = delete;
  CancelScope& operator=(const CancelScope&) = delete;

 private:
  const CancelToken* before_;
};

// Whether this thread's computation is to stop. Costs about as much as a read of memory.
inline bool IsCancelled() noexcept {
  const CancelToken* token = CurrentCancelToken();
  return token != nullptr && token->IsCancelled();
}

// A safe point.
inline void ThrowIfCancelled() {
  if (IsCancelled()) throw Interrupted();
}

}  // namespace thicklens

#endif  // THICKLENS_BASE_CANCEL_H_

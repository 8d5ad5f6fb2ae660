#ifndef THICKLENS_BASE_CANCEL_H_
#define THICKLENS_BASE_CANCEL_H_

#include <atomic>

#include "thicklens/base/error.h"
#include "thicklens/base/export.h"

// Cancellation of a computation. The caller makes a CancelToken and a CancelScope:
//
//   thicklens::CancelToken token;  // token.Cancel() by another thread, or by a signal handler
//   const thicklens::CancelScope scope(&token);
//   estimator::EstimateScene(...);  // throws Interrupted soon after the token was cancelled
//
// Every function of the modules checks the token of the thread that calls it, and so do the threads
// that it starts. After a cancellation it throws Interrupted at its next safe point. Its outputs
// are then in no defined state; they may be filled again or destroyed. Nothing is printed, and the
// process does not end.
//
// The longest interval between two safe points, as CPU time of one thread of an Intel Xeon:
// - Loops of these modules are designed for 0.2 s. They check the token at least once per row of an
//   image, per solver step, or per 1/32 of a pass over an image. The longest measured interval is
//   0.12 s (1282 x 1110 px, 7 x 7 views).
// - A library that computes in one call has no safe point during the call. Such calls are the
//   factorization of one block by SuiteSparse or Eigen (EstimateByBlocks: 1 s was measured for
//   blocks of the usual size; it grows with the power 1.5 to 2 of the number of unknowns), the
//   dense decompositions of ConditioningOfBlock (2.4 s), the blur, transformation or registration
//   of one image by OpenCV, cv::inpaint (InpaintOccludedRays; minutes where most of a large image
//   is hidden), and an OpenCL driver that compiles or computes (seconds).
// A program that must end immediately removes its unfinished outputs by AbandonOutputs
// (thicklens/base/temporaries.h) and ends its process.
namespace thicklens {

// A request to stop a computation. Once cancelled, a token remains cancelled.
class CancelToken {
 public:
  // May be called from any thread and from a signal handler.
  void Cancel() noexcept { is_cancelled_.store(true, std::memory_order_relaxed); }
  // Returns true after Cancel.
  bool IsCancelled() const noexcept { return is_cancelled_.load(std::memory_order_relaxed); }

 private:
  std::atomic<bool> is_cancelled_{false};
  static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may not take a lock");
};

namespace internal {
// One variable in all libraries and the program.
THICKLENS_EXPORT inline thread_local const CancelToken* cancel_token = nullptr;
}  // namespace internal

// The token that the computations of this thread check; null: none.
inline const CancelToken* CurrentCancelToken() noexcept { return internal::cancel_token; }

// During the lifetime of a scope, the computations of this thread check its token (null: none). The
// scope does not own the token, which must outlive it. A scope must be destroyed on the thread on
// which it was made, after the scopes that were made later.
class CancelScope {
 public:
  // Makes `token` (null: none) the token of this thread until the scope ends.
  explicit CancelScope(const CancelToken* token) noexcept : before_(internal::cancel_token) {
    internal::cancel_token = token;
  }
  ~CancelScope() { internal::cancel_token = before_; }
  CancelScope(const CancelScope&) = delete;
  CancelScope& operator=(const CancelScope&) = delete;

 private:
  const CancelToken* before_;
};

// Returns true if the computation of this thread must stop. The cost is about that of a memory
// read.
inline bool IsCancelled() noexcept {
  const CancelToken* token = CurrentCancelToken();
  return token != nullptr && token->IsCancelled();
}

// A safe point: throws Interrupted if the token of this thread was cancelled.
inline void ThrowIfCancelled() {
  if (IsCancelled()) throw Interrupted();
}

}  // namespace thicklens

#endif  // THICKLENS_BASE_CANCEL_H_

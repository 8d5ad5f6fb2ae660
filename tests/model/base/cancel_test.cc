#include "thicklens/base/cancel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <csignal>
#include <thread>

#include "thicklens/base/error.h"
#include "thicklens/base/parallel.h"

namespace thicklens {
namespace {

TEST(Cancel, WithoutATokenNothingIsCancelled) {
  EXPECT_EQ(CurrentCancelToken(), nullptr);
  EXPECT_FALSE(IsCancelled());
  EXPECT_NO_THROW(ThrowIfCancelled());
}

TEST(Cancel, AScopeLooksAtItsTokenAndThenAtTheOneBefore) {
  CancelToken outer, inner;
  const CancelScope scope(&outer);
  inner.Cancel();
  {
    const CancelScope nested(&inner);
    EXPECT_THROW(ThrowIfCancelled(), Interrupted);
    const CancelScope none(nullptr);
    EXPECT_NO_THROW(ThrowIfCancelled());
  }
  EXPECT_EQ(CurrentCancelToken(), &outer);
  EXPECT_NO_THROW(ThrowIfCancelled());
  outer.Cancel();
  EXPECT_THROW(ThrowIfCancelled(), Interrupted);
}

// A function does not know what its caller has written before.
TEST(Cancel, ClaimsNothingAboutFiles) { EXPECT_STREQ(Interrupted().what(), "interrupted"); }

TEST(Cancel, OtherThreadsAreNotAffected) {
  CancelToken token;
  const CancelScope scope(&token);
  token.Cancel();
  bool is_cancelled = true;
  std::thread([&] { is_cancelled = IsCancelled(); }).join();
  EXPECT_FALSE(is_cancelled);
}

TEST(Cancel, ASignalHandlerMayCancel) {
  static CancelToken token;
  const CancelScope scope(&token);
  const auto before = std::signal(SIGUSR1, [](int) { token.Cancel(); });
  EXPECT_FALSE(IsCancelled());
  std::raise(SIGUSR1);
  std::signal(SIGUSR1, before);
  EXPECT_TRUE(IsCancelled());
}

TEST(CancelParallelFor, StartsNothingAfterItIsAskedFor) {
  for (const int threads : {1, 2, 5}) {
    CancelToken token;
    const CancelScope scope(&token);
    std::atomic<int> calls{0};
    EXPECT_THROW(ParallelFor(100000, threads,
                             [&](int) {
                               if (++calls == 10) token.Cancel();
                             }),
                 Interrupted);
    // Each of the other threads may run one more item.
    EXPECT_GE(calls, 10);
    EXPECT_LT(calls, 10 + threads);
  }
}

TEST(CancelParallelFor, ItsThreadsLookAtTheCallersToken) {
  CancelToken token;
  const CancelScope scope(&token);
  std::atomic<int> others{0};
  ParallelFor(64, 4, [&](int) { others += CurrentCancelToken() != &token; });
  EXPECT_EQ(others, 0);
  // Also of one within another.
  ParallelFor(4, 4, [&](int) {
    ParallelFor(4, 2, [&](int) { others += CurrentCancelToken() != &token; });
  });
  EXPECT_EQ(others, 0);
}

TEST(CancelParallelFor, TwoComputationsAreStoppedOnTheirOwn) {
  CancelToken stopped;
  stopped.Cancel();
  int done = 0;
  std::thread other([&] { ParallelFor(10, 1, [&](int) { ++done; }); });
  const CancelScope scope(&stopped);
  EXPECT_THROW(ParallelFor(10, 1, [](int) { FAIL() << "was called"; }), Interrupted);
  other.join();
  EXPECT_EQ(done, 10);
}

}  // namespace
}  // namespace thicklens

#include "thicklens/base/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "support/error_message.h"
#include "thicklens/base/error.h"

namespace thicklens {
namespace {

using ::thicklens::testing::ErrorOf;

TEST(ParallelFor, CallsEachIndexOnce) {
  for (const int threads : {0, 1, 2, 7, 64}) {
    for (const int count : {1, 2, 3, 1000}) {
      std::vector<std::atomic<int>> calls(static_cast<std::size_t>(count));
      ParallelFor(count, threads, [&](int i) { ++calls[static_cast<std::size_t>(i)]; });
      for (const auto& times : calls) ASSERT_EQ(times, 1) << threads << " threads, " << count;
    }
  }
}

TEST(ParallelFor, NothingToDo) {
  ParallelFor(0, 4, [](int) { FAIL() << "was called"; });
}

TEST(ParallelFor, MoreThreadsThanItems) {
  std::atomic<int> calls{0};
  ParallelFor(3, 1000000, [&](int) { ++calls; });
  EXPECT_EQ(calls, 3);
}

TEST(ParallelFor, OneThreadIsTheCallersAndInOrder) {
  std::vector<int> order;
  const auto caller = std::this_thread::get_id();
  ParallelFor(5, 1, [&](int i) {
    EXPECT_EQ(std::this_thread::get_id(), caller);
    order.push_back(i);
  });
  EXPECT_EQ(order, (std::vector<int>{0, 1, 2, 3, 4}));
}

// Two calls wait for each other: they can only end if they run at the same time.
TEST(ParallelFor, RunsAtTheSameTime) {
  std::atomic<int> inside{0};
  ParallelFor(2, 2, [&](int) {
    ++inside;
    while (inside < 2) std::this_thread::yield();
  });
  EXPECT_EQ(inside, 2);
}

// Index 2 is the last to fail, after 5, but its exception is still the one that is rethrown.
TEST(ParallelFor, RethrowsTheSmallestFailingIndexWhateverTheTiming) {
  for (int repeat = 0; repeat < 20; ++repeat) {
    std::atomic<bool> five_failed{false};
    const std::string message = ErrorOf([&] {
      ParallelFor(100, 8, [&](int i) {
        if (i == 2) {
          while (!five_failed) std::this_thread::yield();
          throw Error("two");
        }
        if (i == 5) {
          five_failed = true;
          throw Error("five");
        }
      });
    });
    ASSERT_EQ(message, "two");
  }
}

TEST(ParallelFor, StartsNothingNewAfterAFailure) {
  std::mutex mutex;
  std::set<int> started;
  const std::string message = ErrorOf([&] {
    ParallelFor(1000, 1, [&](int i) {
      const std::lock_guard<std::mutex> lock(mutex);
      started.insert(i);
      if (i == 10) throw Error("ten");
    });
  });
  EXPECT_EQ(message, "ten");
  EXPECT_EQ(started.size(), 11U);
}

TEST(ParallelFor, OtherExceptionsPassAsTheyAre) {
  EXPECT_THROW(ParallelFor(4, 2, [](int) { throw Interrupted(); }), Interrupted);
  EXPECT_THROW(ParallelFor(4, 2, [](int) { throw std::string("text"); }), std::string);
}

TEST(ResolveThreads, ZeroIsOnePerCore) {
  EXPECT_EQ(ResolveThreads(3), 3);
  EXPECT_GE(ResolveThreads(0), 1);
  EXPECT_EQ(ResolveThreads(-1), ResolveThreads(0));
}

}  // namespace
}  // namespace thicklens

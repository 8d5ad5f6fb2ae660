// A line on standard input, which may be anything that a shell, nohup or a service gives.
#include "tools/system/wait_for_line.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <chrono>

namespace thicklens::tools {
namespace {

using Milliseconds = std::chrono::milliseconds;

class LineWaiterTest : public ::testing::Test {
 protected:
  LineWaiterTest() : before_(::dup(STDIN_FILENO)) {}
  ~LineWaiterTest() override {
    if (before_ >= 0) {
      ::dup2(before_, STDIN_FILENO);
      ::close(before_);
    } else {
      ::close(STDIN_FILENO);
    }
  }
  // Makes a descriptor standard input, and closes it.
  static void TakeAsInput(int descriptor) {
    ASSERT_GE(descriptor, 0);
    ASSERT_EQ(::dup2(descriptor, STDIN_FILENO), STDIN_FILENO);
    ::close(descriptor);
  }
  // Expects no line, and that the last of two calls waits for all of its time.
  static void ExpectRest() {
    LineWaiter waiter;
    EXPECT_FALSE(waiter.WaitFor(0.05));
    const auto start = std::chrono::steady_clock::now();
    EXPECT_FALSE(waiter.WaitFor(0.05));
    EXPECT_GE(std::chrono::steady_clock::now() - start, Milliseconds(45));
  }

  int before_;
};

TEST_F(LineWaiterTest, ReturnsALineOnce) {
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe(ends.data()), 0);
  TakeAsInput(ends[0]);
  LineWaiter waiter;
  EXPECT_FALSE(waiter.WaitFor(0.01));
  ASSERT_EQ(::write(ends[1], "\n", 1), 1);
  EXPECT_TRUE(waiter.WaitFor(10));
  EXPECT_FALSE(waiter.WaitFor(0.01));
  ::close(ends[1]);
}

TEST_F(LineWaiterTest, RestsAtTheEndOfTheInput) {
  TakeAsInput(::open("/dev/null", O_RDONLY));
  ExpectRest();
}

// nohup opens it so: it is ready at all times and cannot be read.
TEST_F(LineWaiterTest, RestsWhereTheInputCannotBeRead) {
  TakeAsInput(::open("/dev/null", O_WRONLY));
  ExpectRest();
}

}  // namespace
}  // namespace thicklens::tools

#include "thicklens/base/forked_process.h"

#include <gtest/gtest.h>

#include <csignal>

namespace thicklens {
namespace {

constexpr int kDone = 7, kHandled = 8;

// A handler of the program, which must not run in the new process.
void EndAsHandled(int /*signal*/) { ::_exit(kHandled); }

// Runs `work` in a process made by fork, which begins as the child of `parent`.
template <typename Work>
int StatusOf(pid_t parent, const Work& work) {
  const pid_t process = ::fork();
  if (process == 0) {
    BeginForkedProcess(parent, {SIGTERM, SIGXCPU}, {SIGINT});
    work();
    ::_exit(kDone);
  }
  EXPECT_GT(process, 0);
  return StatusAtEnd(process);
}

// SIGTERM, SIGXCPU and SIGINT have handlers, and SIGTERM is blocked.
class ForkedProcessTest : public ::testing::Test {
 protected:
  ForkedProcessTest() {
    for (const int number : {SIGTERM, SIGXCPU, SIGINT}) ::signal(number, EndAsHandled);
    sigset_t blocked;
    ::sigemptyset(&blocked);
    ::sigaddset(&blocked, SIGTERM);
    ::pthread_sigmask(SIG_BLOCK, &blocked, &before_);
  }
  ~ForkedProcessTest() override {
    for (const int number : {SIGTERM, SIGXCPU, SIGINT}) ::signal(number, SIG_DFL);
    ::pthread_sigmask(SIG_SETMASK, &before_, nullptr);
  }

  sigset_t before_{};
};

TEST_F(ForkedProcessTest, SignalsActByDefaultAndAreNotBlocked) {
  const int status = StatusOf(::getpid(), [] { ::raise(SIGTERM); });
  ASSERT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(WTERMSIG(status), SIGTERM);
}

TEST_F(ForkedProcessTest, SignalsAreIgnored) {
  const int status = StatusOf(::getpid(), [] { ::raise(SIGINT); });
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), kDone);
}

TEST_F(ForkedProcessTest, NoCoreFileIsLeft) {
  const int status = StatusOf(::getpid(), [] {
    rlimit core{};
    if (::getrlimit(RLIMIT_CORE, &core) != 0 || core.rlim_cur != 0) ::_exit(1);
  });
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), kDone);
}

// The parent may end before the new process asks to be killed with it.
TEST_F(ForkedProcessTest, EndsIfItsParentHasEnded) {
  const int status = StatusOf(::getppid(), [] {});
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 1);
}

}  // namespace
}  // namespace thicklens

#include "thicklens/base/memory_available.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "support/temporary_folder.h"

namespace thicklens::tools {
namespace {

using testing::TemporaryFolder;

// A machine on which 1000 MiB are available to a process that holds 10 MiB.
class MemoryAvailable : public ::testing::Test {
 protected:
  void SetUp() override {
    Put("proc/meminfo", "MemTotal: 4096000 kB\nMemAvailable: 1024000 kB\n");
    Put("proc/self/status", "Name: thicklens\nVmRSS: 10240 kB\n");
  }
  void Put(const std::string& name, const std::string& content) {
    std::filesystem::create_directories(std::filesystem::path(Root() + "/" + name).parent_path());
    folder_.Put(name, content);
  }
  std::string Root() const { return folder_.path(); }
  double LimitMib() const { return UsualMemoryLimitMib(Root()).value(); }

  TemporaryFolder folder_;
};

TEST_F(MemoryAvailable, IsFourFifthsBesideWhatIsHeld) { EXPECT_DOUBLE_EQ(LimitMib(), 810); }

TEST_F(MemoryAvailable, AContainerHasLess) {
  Put("sys/fs/cgroup/memory.max", "209715200\n");
  Put("sys/fs/cgroup/memory.current", "104857600\n");
  EXPECT_DOUBLE_EQ(LimitMib(), 0.8 * 100 + 10);
}

// Otherwise a container that has read much would seem to be full.
TEST_F(MemoryAvailable, FilesThatWereReadMakeRoom) {
  Put("sys/fs/cgroup/memory.max", "209715200\n");
  Put("sys/fs/cgroup/memory.current", "209715200\n");
  Put("sys/fs/cgroup/memory.stat",
      "anon 52428800\nfile 157286400\ninactive_file 104857600\nactive_file 52428800\n");
  EXPECT_DOUBLE_EQ(LimitMib(), 0.8 * 150 + 10);
}

TEST_F(MemoryAvailable, AGroupWithoutALimitHasWhatTheMachineHas) {
  Put("sys/fs/cgroup/memory.max", "max\n");
  Put("sys/fs/cgroup/memory.current", "104857600\n");
  EXPECT_DOUBLE_EQ(LimitMib(), 810);
}

TEST_F(MemoryAvailable, TheGroupIsThatOfTheProcess) {
  Put("proc/self/cgroup", "0::/lab/night\n");
  Put("sys/fs/cgroup/lab/night/memory.max", "52428800\n");
  Put("sys/fs/cgroup/lab/night/memory.current", "0\n");
  EXPECT_DOUBLE_EQ(LimitMib(), 0.8 * 50 + 10);
}

TEST_F(MemoryAvailable, TheOlderInterfaceCountsToo) {
  Put("proc/self/cgroup", "7:memory:/lab\n");
  Put("sys/fs/cgroup/memory/lab/memory.limit_in_bytes", "52428800\n");
  Put("sys/fs/cgroup/memory/lab/memory.usage_in_bytes", "62428800\n");
  EXPECT_DOUBLE_EQ(LimitMib(), 10);
}

TEST_F(MemoryAvailable, IsUnknownWhereTheSystemDoesNotSay) {
  EXPECT_FALSE(UsualMemoryLimitMib(Root() + "/elsewhere"));
}

}  // namespace
}  // namespace thicklens::tools

// Inputs are regular files of limited size, and the watch is called for each.
#include "thicklens/base/input_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/yaml_reader.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::model {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using ::thicklens::testing::ErrorOf;
using ::thicklens::testing::TemporaryFolder;

// Each would wait for ever, or read without end, if it were opened as a file is.
TEST(InputFile, WhatIsNoRegularFileIsRefusedByItsKind) {
  const TemporaryFolder folder;
  const auto refusal = [](const std::string& path) {
    const std::string of_text = ErrorOf([&] { ReadTextFile(path); });
    EXPECT_EQ(ErrorOf([&] { ReadWholeFile(path); }), of_text);
    EXPECT_EQ(ErrorOf([&] { RequireRegularFile(path); }), of_text);
    EXPECT_THAT(of_text, StartsWith(path + ": is "));
    return of_text;
  };
  ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
  EXPECT_THAT(refusal(folder / "pipe"), HasSubstr("a named pipe; a regular file is expected"));
  fs::create_symlink("pipe", folder / "link");
  EXPECT_THAT(refusal(folder / "link"), HasSubstr("a named pipe"));
  EXPECT_THAT(refusal(folder.path()), HasSubstr("a folder; a file is expected"));
  EXPECT_THAT(refusal("/dev/zero"), HasSubstr("a character device"));

  const int listener = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string socket_path = folder / "socket";
  ASSERT_LT(socket_path.size(), sizeof address.sun_path);
  std::copy(socket_path.begin(), socket_path.end(), address.sun_path);
  ASSERT_EQ(::bind(listener, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  EXPECT_THAT(refusal(socket_path), HasSubstr("a socket"));
  ::close(listener);
}

// bash gives /dev/fd/63 for <(...).
TEST(InputFile, AProcessSubstitutionIsRefusedWithThatReason) {
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  for (const std::string folder : {"/dev/fd/", "/proc/self/fd/"}) {
    if (!fs::exists(folder)) GTEST_SKIP() << "there is no " << folder;
    EXPECT_THAT(ErrorOf([&] { ReadTextFile(folder + std::to_string(ends[0])); }),
                HasSubstr("process substitution"));
  }
  ::close(ends[0]);
  ::close(ends[1]);
  // A regular file that is open is one by that name, too.
  const TemporaryFolder temporary;
  std::FILE* file = std::fopen(temporary.Put("a", "content").c_str(), "r");
  ASSERT_NE(file, nullptr);
  EXPECT_EQ(ReadTextFile("/proc/self/fd/" + std::to_string(::fileno(file))), "content");
  std::fclose(file);
}

TEST(InputFile, StandardInputIsNotRead) {
  EXPECT_THAT(ErrorOf([] { ReadTextFile("-"); }), HasSubstr("standard input is not read"));
}

TEST(InputFile, ATextHasALimitedSize) {
  const TemporaryFolder folder;
  const std::string path = folder.Put("a.yaml");
  fs::resize_file(path, kMaxTextBytes);
  EXPECT_EQ(ReadTextFile(path).size(), kMaxTextBytes);
  fs::resize_file(path, kMaxTextBytes + 1);
  EXPECT_EQ(ErrorOf([&] { ReadTextFile(path); }),
            path + ": has 67108865 bytes; a file of this kind may have at most 64 MiB");
  EXPECT_EQ(ReadWholeFile(path).size(), kMaxTextBytes + 1);
  EXPECT_THAT(ErrorOf([&] { YamlNode::LoadFile(path); }), HasSubstr("at most 64 MiB"));
  fs::resize_file(path, kMaxInputBytes + 1);  // takes no room
  EXPECT_THAT(ErrorOf([&] { ReadWholeFile(path); }), HasSubstr("at most 4 GiB"));
}

// A file of the system has no size of its own.
TEST(InputFile, WhatGrowsWhileItIsReadHasTheSameLimit) {
  if (!fs::exists("/proc/self/status")) GTEST_SKIP() << "there is no /proc";
  EXPECT_THAT(ErrorOf([] { ReadOwnFile("/proc/self/status", 10); }),
              HasSubstr("more than 10 bytes"));
  EXPECT_THAT(ReadOwnFile("/proc/self/status"), HasSubstr("Name:"));
}

class WatchedInputs : public ::testing::Test {
 protected:
  WatchedInputs() {
    WatchInputs([this](const std::string& path) { reported_.push_back(path); });
  }
  ~WatchedInputs() override { WatchInputs({}); }

  std::vector<std::string> reported_;
  TemporaryFolder folder_;
};

TEST_F(WatchedInputs, EveryFileThatIsReadIsReported) {
  const std::string path = folder_.Put("a", "x");
  ReadWholeFile(path);
  ReadTextFile(path);
  EXPECT_EQ(reported_, (std::vector<std::string>{path, path}));
  ReadOwnFile(path);
  EXPECT_EQ(reported_.size(), 2U);
}

// Frames, camera, table and folder are known before the first frame is read.
TEST_F(WatchedInputs, FilesThatASweepNamesAreReported) {
  for (const char* name : {"a.png", "b.png", "c.png"}) folder_.Put(std::string("f/") + name, "x");
  folder_.Put("t.csv", "a.png,1\nb.png,2\nc.png,3\n");
  const std::string yaml = folder_.Put("s.yaml",
                                       "schema: thicklens/sweep/1\ncamera: ../c.yaml\n"
                                       "frames_csv: t.csv\nframes_dir: f\n");
  ReadSweep(yaml, nullptr);
  const std::string camera = fs::path(folder_.path()).parent_path() / "c.yaml";
  for (const std::string& path : {yaml, camera, folder_ / "t.csv", folder_ / "f/a.png",
                                  folder_ / "f/b.png", folder_ / "f/c.png"}) {
    EXPECT_THAT(reported_, Contains(path));
  }
}

TEST_F(WatchedInputs, AWatcherMayRefuseAFile) {
  WatchInputs([](const std::string& path) { throw Error(path + ": not this one"); });
  EXPECT_EQ(ErrorOf([&] { ReadCamera(folder_ / "a"); }), folder_ / "a" + ": not this one");
}

}  // namespace
}  // namespace thicklens::model

#ifndef THICKLENS_TESTS_MODEL_BASE_OUTPUT_FIXTURE_H_
#define THICKLENS_TESTS_MODEL_BASE_OUTPUT_FIXTURE_H_

#include <sched.h>
#include <sys/mount.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "thicklens/base/output_file.h"

namespace thicklens::testing {

// Code that the tests of output files and folders share.

// The file by which an output folder of these tests is recognised.
inline constexpr char kMarker[] = "truth.yaml";

// Makes an output folder with the marker and one frame, both of that content.
inline void WriteFolder(const std::string& path, const std::string& content,
                        const std::vector<std::string>& own = {}) {
  OutputFolder out(path, kMarker, own);
  out.Write(kMarker, content);
  out.Write("frames/a.png", content);
  out.Commit();
}

// The message with which an output at this place is refused; "(no error)" if it is not.
inline std::string FolderRefusal(const std::string& path,
                                 const std::vector<std::string>& own = {}) {
  return ErrorOf([&] { OutputFolder out(path, kMarker, own); });
}
inline std::string FileRefusal(const std::string& path) {
  return ErrorOf([&] { OutputFile file(path); });
}

// Runs `work` in a child process and returns its exit status; 99 if it ended otherwise.
template <typename Work>
int StatusOfChild(const Work& work) {
  const pid_t child = ::fork();
  if (child == 0) ::_exit(work());
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 99;
}

// Runs `work` in a child process and returns the text that it returns, which fits into a pipe. An
// empty text means that all is as it should be, and "skip: .." that the test cannot be run here.
template <typename Work>
std::string TextOfChild(const Work& work) {
  int ends[2];
  if (::pipe(ends) != 0) return "no pipe";
  const int status = StatusOfChild([&] {
    const std::string text = work();
    const ssize_t written = ::write(ends[1], text.data(), text.size());
    return written == static_cast<ssize_t>(text.size()) ? 0 : 1;
  });
  ::close(ends[1]);
  std::string text;
  char buffer[4096];
  for (ssize_t n; (n = ::read(ends[0], buffer, sizeof buffer)) > 0;)
    text.append(buffer, static_cast<std::size_t>(n));
  ::close(ends[0]);
  return status == 0 ? text : text + " (ended badly)";
}

// Fails with the text of a child, or skips the test.
#define EXPECT_CHILD_SUCCEEDS(...)                                        \
  const std::string outcome = __VA_ARGS__;                                \
  if (outcome.rfind("skip: ", 0) == 0) GTEST_SKIP() << outcome.substr(6); \
  EXPECT_EQ(outcome, "")

// Text that a child process prints: empty if the condition holds.
inline std::string Unless(bool condition, const std::string& text) {
  return condition ? "" : text + "; ";
}

// Gives this process mounts of its own. A user who is not root becomes root of a user namespace,
// who may mount.
inline std::string OwnMounts() {
  const std::string user = std::to_string(::geteuid()), group = std::to_string(::getegid());
  if (user != "0") {
    if (::unshare(CLONE_NEWUSER) != 0)
      return std::string("skip: no user namespace: ") + std::strerror(errno);
    std::ofstream("/proc/self/setgroups") << "deny";
    std::ofstream("/proc/self/uid_map") << "0 " + user + " 1";
    std::ofstream("/proc/self/gid_map") << "0 " + group + " 1";
  }
  if (::unshare(CLONE_NEWNS) != 0)
    return std::string("skip: no mount namespace: ") + std::strerror(errno);
  if (::mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0)
    return std::string("skip: mounts cannot be made private: ") + std::strerror(errno);
  return "";
}

// Runs `work` as TextOfChild does. In the child, the new folder is a mount point of a file system
// of 1 MB.
template <typename Work>
std::string TextOfChildWithMount(const std::string& folder, const Work& work) {
  return TextOfChild([&]() -> std::string {
    std::filesystem::create_directory(folder);
    if (const std::string skip = OwnMounts(); !skip.empty()) return skip;
    if (::mount("none", folder.c_str(), "tmpfs", 0, "size=1m") != 0)
      return std::string("skip: no tmpfs can be mounted: ") + std::strerror(errno);
    return work();
  });
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_MODEL_BASE_OUTPUT_FIXTURE_H_

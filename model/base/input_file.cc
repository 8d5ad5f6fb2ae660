#include "thicklens/base/input_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"

namespace thicklens {
namespace {

namespace fs = std::filesystem;

InputWatch& Watch() {
  static InputWatch watch;
  return watch;
}

Error CannotBeRead(const std::string& path, int error) {
  return Error(fmt::format("{}: cannot be read: {}", path, std::strerror(error)));
}

// Whether the name is that of an open descriptor: /dev/stdin, /dev/fd/63, /proc/self/fd/63.
bool IsDescriptor(const std::string& path) {
  if (path == "/dev/stdin") return true;
  std::error_code failure;
  const fs::path folder = fs::canonical(fs::path(path).parent_path(), failure);
  return !failure && folder.filename() == "fd" && folder.string().rfind("/proc/", 0) == 0;
}

void RequireRegular(const std::string& path, mode_t mode) {
  if (S_ISREG(mode)) return;
  const std::string kind = KindOfFile(mode);
  if (S_ISFIFO(mode) && IsDescriptor(path)) {
    throw Error(fmt::format(
        "{}: is a pipe, such as a process substitution <(...) or a pipeline creates; inputs are "
        "read more than once, so a regular file is expected: write the data to a file first",
        path));
  }
  throw Error(
      fmt::format("{}: is {}; a {}file is expected", path, kind, S_ISDIR(mode) ? "" : "regular "));
}

struct stat StatusOf(const std::string& path) {
  struct stat info {};
  if (::stat(path.c_str(), &info) == 0) return info;
  const int error = errno;
  if (path == "-" && error == ENOENT) {
    throw Error("-: standard input is not read; the name of a file is expected");
  }
  throw CannotBeRead(path, error);
}

class OpenedFile {
 public:
  // The name may have got another meaning since the call of stat. Therefore opening never waits,
  // and the opened file is checked again.
  explicit OpenedFile(const std::string& path)
      : fd_(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY)) {
    if (fd_ < 0) throw CannotBeRead(path, errno);
    struct stat info {};
    const bool is_known = ::fstat(fd_, &info) == 0;
    const int error = errno;
    try {
      if (!is_known) throw CannotBeRead(path, error);
      RequireRegular(path, info.st_mode);
    } catch (...) {
      ::close(fd_);
      throw;
    }
    bytes_ = static_cast<std::uint64_t>(info.st_size);
  }
  ~OpenedFile() { ::close(fd_); }
  OpenedFile(const OpenedFile&) = delete;
  OpenedFile& operator=(const OpenedFile&) = delete;

  int fd() const { return fd_; }
  std::uint64_t bytes() const { return bytes_; }

 private:
  int fd_;
  std::uint64_t bytes_ = 0;
};

std::string SizeText(std::uint64_t bytes) {
  return bytes % (std::uint64_t{1} << 30) == 0 ? fmt::format("{} GiB", bytes >> 30)
                                               : fmt::format("{} MiB", bytes >> 20);
}

Error TooLarge(const std::string& path, std::uint64_t bytes, std::uint64_t most_bytes) {
  return Error(fmt::format("{}: has {}{} bytes; a file of this kind may have at most {}", path,
                           bytes > most_bytes ? "" : "more than ", bytes, SizeText(most_bytes)));
}

}  // namespace

std::string KindOfFile(unsigned mode) {
  if (S_ISREG(mode)) return "a file";
  if (S_ISDIR(mode)) return "a folder";
  if (S_ISFIFO(mode)) return "a named pipe";
  if (S_ISSOCK(mode)) return "a socket";
  if (S_ISCHR(mode)) return "a character device";
  if (S_ISBLK(mode)) return "a block device";
  if (S_ISLNK(mode)) return "a symbolic link";
  return "not an ordinary file";
}

void RequireRegularFile(const std::string& path) { RequireRegular(path, StatusOf(path).st_mode); }

std::string ReadOwnFile(const std::string& path, std::uint64_t most_bytes) {
  RequireRegularFile(path);  // opening a device may have side effects
  const OpenedFile file(path);
  if (file.bytes() > most_bytes) throw TooLarge(path, file.bytes(), most_bytes);
  std::string content;
  content.reserve(static_cast<std::size_t>(file.bytes()));
  // Files of /proc state no size, and a file may grow while it is read.
  char block[1 << 16];
  for (;;) {
    const ssize_t n = ::read(file.fd(), block, sizeof block);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw CannotBeRead(path, errno);
    if (n == 0) return content;
    content.append(block, static_cast<std::size_t>(n));
    if (content.size() > most_bytes) throw TooLarge(path, most_bytes, most_bytes);
  }
}

std::string ReadWholeFile(const std::string& path) {
  ReportInput(path);
  return ReadOwnFile(path, kMaxInputBytes);
}

std::string ReadTextFile(const std::string& path) {
  ReportInput(path);
  return ReadOwnFile(path, kMaxTextBytes);
}

void WatchInputs(InputWatch watch) { Watch() = std::move(watch); }

void ReportInput(const std::string& path) {
  if (Watch()) Watch()(path);
}

}  // namespace thicklens

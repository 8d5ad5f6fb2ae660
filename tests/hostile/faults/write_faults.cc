// This library is loaded before the C library (LD_PRELOAD). It makes the program's writing to a
// folder fail from a chosen call on, as on a disk that is full, over its quota or broken:
//   THICKLENS_WRITE_FAULT=N:ERRNO:FOLDER   N counts from 1 in each process
//   THICKLENS_FAULT_MARK=FILE              is made when a call failed for the first time
// Only calls that write, create or rename below the folder count and fail. Calls that remove
// something do not fail, and reading works.
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace {

struct Fault {
  int first = 0;
  int error = 0;
  char folder[4096] = "";
};

template <typename Function>
Function* Real(const char* call) {
  void* found = ::dlsym(RTLD_NEXT, call);
  if (found == nullptr) std::abort();
  return reinterpret_cast<Function*>(found);
}

const Fault& TheFault() {
  static const Fault fault = [] {
    Fault read;
    const char* text = std::getenv("THICKLENS_WRITE_FAULT");
    if (text == nullptr ||
        std::sscanf(text, "%d:%d:%4095[^\n]", &read.first, &read.error, read.folder) != 3) {
      std::fprintf(stderr, "THICKLENS_WRITE_FAULT must be N:ERRNO:FOLDER\n");
      std::abort();
    }
    return read;
  }();
  return fault;
}

// Returns true and sets errno if this call must fail.
bool FailsNow() {
  static std::atomic<int> calls{0};
  const int call = ++calls;
  if (call < TheFault().first) return false;
  const char* mark = std::getenv("THICKLENS_FAULT_MARK");
  if (mark != nullptr) {
    const int fd = Real<decltype(::open)>("open")(mark, O_WRONLY | O_CREAT | O_CLOEXEC, 0666);
    if (fd >= 0) ::close(fd);
  }
  errno = TheFault().error;
  return true;
}

bool IsBelow(const char* path) {
  const std::size_t length = std::strlen(TheFault().folder);
  return std::strncmp(path, TheFault().folder, length) == 0;
}

// Looks at the name that the open file has now.
bool IsBelow(int fd) {
  char link[64], path[4096];
  std::snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
  const ssize_t length = ::readlink(link, path, sizeof path - 1);
  if (length < 0) return false;
  path[length] = '\0';
  return IsBelow(path);
}

// Looks at a name as the program gives it, which may be relative to the current folder or to an
// open one.
bool IsBelow(int folder, const char* path) {
  if (path[0] == '/') return IsBelow(path);
  if (folder != AT_FDCWD) return IsBelow(folder);
  char current[4096];
  if (::getcwd(current, sizeof current - 1) == nullptr) return false;
  std::strcat(current, "/");
  return IsBelow(current);
}

}  // namespace

extern "C" {

ssize_t write(int fd, const void* bytes, size_t count) {
  if (IsBelow(fd) && FailsNow()) return -1;
  return Real<decltype(::write)>("write")(fd, bytes, count);
}

ssize_t writev(int fd, const struct iovec* parts, int count) {
  using Function = ssize_t(int, const struct iovec*, int);
  if (IsBelow(fd) && FailsNow()) return -1;
  return Real<Function>("writev")(fd, parts, count);
}

ssize_t pwrite64(int fd, const void* bytes, size_t count, off64_t at) {
  if (IsBelow(fd) && FailsNow()) return -1;
  return Real<decltype(::pwrite64)>("pwrite64")(fd, bytes, count, at);
}

int fsync(int fd) {
  if (IsBelow(fd) && FailsNow()) return -1;
  return Real<decltype(::fsync)>("fsync")(fd);
}

int ftruncate(int fd, off_t size) {
  if (IsBelow(fd) && FailsNow()) return -1;
  return Real<decltype(::ftruncate)>("ftruncate")(fd, size);
}

int mkdir(const char* path, mode_t mode) {
  if (IsBelow(AT_FDCWD, path) && FailsNow()) return -1;
  return Real<decltype(::mkdir)>("mkdir")(path, mode);
}

int mkdirat(int folder, const char* path, mode_t mode) {
  if (IsBelow(folder, path) && FailsNow()) return -1;
  return Real<decltype(::mkdirat)>("mkdirat")(folder, path, mode);
}

int rename(const char* from, const char* to) {
  if (IsBelow(AT_FDCWD, to) && FailsNow()) return -1;
  return Real<decltype(::rename)>("rename")(from, to);
}

int renameat(int from_folder, const char* from, int to_folder, const char* to) {
  if (IsBelow(to_folder, to) && FailsNow()) return -1;
  return Real<decltype(::renameat)>("renameat")(from_folder, from, to_folder, to);
}

int renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) {
  using Function = int(int, const char*, int, const char*, unsigned);
  if (IsBelow(to_folder, to) && FailsNow()) return -1;
  return Real<Function>("renameat2")(from_folder, from, to_folder, to, flags);
}

int open(const char* path, int flags, ...) {
  std::va_list more;
  va_start(more, flags);
  const auto mode = (flags & O_CREAT) != 0 ? va_arg(more, mode_t) : 0;
  va_end(more);
  if ((flags & O_CREAT) != 0 && IsBelow(AT_FDCWD, path) && FailsNow()) return -1;
  return Real<decltype(::open)>("open")(path, flags, mode);
}

int open64(const char* path, int flags, ...) {
  std::va_list more;
  va_start(more, flags);
  const auto mode = (flags & O_CREAT) != 0 ? va_arg(more, mode_t) : 0;
  va_end(more);
  if ((flags & O_CREAT) != 0 && IsBelow(AT_FDCWD, path) && FailsNow()) return -1;
  return Real<decltype(::open64)>("open64")(path, flags, mode);
}

int openat(int folder, const char* path, int flags, ...) {
  std::va_list more;
  va_start(more, flags);
  const auto mode = (flags & O_CREAT) != 0 ? va_arg(more, mode_t) : 0;
  va_end(more);
  if ((flags & O_CREAT) != 0 && IsBelow(folder, path) && FailsNow()) return -1;
  return Real<decltype(::openat)>("openat")(folder, path, flags, mode);
}

}  // extern "C"

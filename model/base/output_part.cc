#include "model/base/output_part.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdint>
#include <functional>
#include <new>
#include <system_error>
#include <thread>
#include <vector>

#include "model/base/output_target.h"
#include "thicklens/base/error.h"

namespace thicklens {
namespace {

namespace fs = std::filesystem;

constexpr char kEnding[] = ".part";
constexpr std::size_t kRandomDigits = 16;
// The name of a part may have at most 255 bytes, as any file name.
constexpr std::size_t kMaxStem = 200;

// The beginning of a part's name. A hash distinguishes long names with the same beginning.
std::string Beginning(const std::string& stem) {
  if (stem.size() <= kMaxStem) return "." + stem + ".";
  return fmt::format(".{}~{:016x}.", stem.substr(0, kMaxStem - 17), std::hash<std::string>()(stem));
}

std::uint64_t Unpredictable() {
  std::uint64_t bits = 0;
  if (::getrandom(&bits, sizeof bits, 0) == static_cast<ssize_t>(sizeof bits)) return bits;
  // This fallback is predictable, but parts are only created, so that no existing file is opened.
  return static_cast<std::uint64_t>(std::chrono::steady_clock::now().time_since_epoch().count()) *
             0x9E3779B97F4A7C15U ^
         static_cast<std::uint64_t>(::getpid());
}

// Runs search for each other's parts one after the other. Otherwise two runs that start together
// would each find the other's part, and neither would continue. If another process never releases
// the lock of the folder, the constructor stops waiting; two runs may then both be refused.
class FolderTurn {
 public:
  explicit FolderTurn(const fs::path& folder)
      : fd_(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
    constexpr int kMaxTries = 1000;
    for (int i = 0; fd_ >= 0 && i < kMaxTries; ++i) {
      if (::flock(fd_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
  }
  ~FolderTurn() {
    if (fd_ >= 0) ::close(fd_);
  }
  FolderTurn(const FolderTurn&) = delete;
  FolderTurn& operator=(const FolderTurn&) = delete;

 private:
  int fd_;
};

std::vector<std::string> PartsIn(const fs::path& folder, const std::string& stem) {
  std::vector<std::string> parts;
  std::error_code failure;
  for (fs::directory_iterator entry(folder, failure), end; !failure && entry != end;
       entry.increment(failure)) {
    if (IsPartName(entry->path().filename().string(), stem))
      parts.push_back(entry->path().string());
  }
  return parts;
}

enum class Found { kNothing, kHeld, kLeftOver };

// A part of another run, opened and locked if no run holds its lock. No link is followed, and no
// call waits.
class FoundPart {
 public:
  explicit FoundPart(const std::string& path) {
    struct stat info {};
    if (::lstat(path.c_str(), &info) != 0 || info.st_uid != ::geteuid()) return;
    if (!S_ISREG(info.st_mode) && !S_ISDIR(info.st_mode)) return;
    fd_ = ::open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    if (fd_ < 0) return;
    if (::flock(fd_, LOCK_EX | LOCK_NB) != 0) {
      what_ = errno == EWOULDBLOCK ? Found::kHeld : Found::kNothing;
    } else if (IsNamed(fd_, path)) {
      what_ = Found::kLeftOver;
    }
  }
  ~FoundPart() {
    if (fd_ >= 0) ::close(fd_);
  }
  FoundPart(const FoundPart&) = delete;
  FoundPart& operator=(const FoundPart&) = delete;

  Found what() const { return what_; }

 private:
  int fd_ = -1;
  Found what_ = Found::kNothing;
};

struct NameIsTaken {};

// The present path of an opened file or folder; empty if it cannot be determined.
std::string PathOf(int fd) {
  std::error_code failure;
  const fs::path path = fs::read_symlink(fmt::format("/proc/self/fd/{}", fd), failure);
  return failure ? "" : path.string();
}

int Create(const std::string& path, PartKind kind) {
  constexpr int kAlways = O_CLOEXEC | O_NOFOLLOW;
  if (kind == PartKind::kFile)
    return ::open(path.c_str(), kAlways | O_RDWR | O_CREAT | O_EXCL, 0666);
  if (::mkdir(path.c_str(), 0777) != 0) return -1;
  const int fd = ::open(path.c_str(), kAlways | O_RDONLY | O_DIRECTORY);
  const int error = errno;
  if (fd < 0) ::rmdir(path.c_str());
  errno = error;
  return fd;
}

}  // namespace

bool IsPartName(const std::string& name, const std::string& stem) {
  const std::string beginning = Beginning(stem);
  const std::size_t ending = sizeof kEnding - 1;
  if (name.size() != beginning.size() + kRandomDigits + ending ||
      name.compare(0, beginning.size(), beginning) != 0 ||
      name.compare(name.size() - ending, ending, kEnding) != 0) {
    return false;
  }
  return name.find_first_not_of("0123456789abcdef", beginning.size()) == name.size() - ending;
}

bool HasLeftOverPart(const fs::path& folder, const std::string& stem, const std::string& inner) {
  for (const std::string& path : PartsIn(folder, stem)) {
    std::error_code ignored;
    if (!inner.empty() && !fs::exists(fs::path(path) / inner, ignored)) continue;
    if (FoundPart(path).what() == Found::kLeftOver) return true;
  }
  return false;
}

void RemoveLeftOverParts(const fs::path& folder, const std::string& stem) {
  for (const std::string& path : PartsIn(folder, stem)) {
    const FoundPart found(path);
    std::error_code ignored;
    if (found.what() == Found::kLeftOver) fs::remove_all(path, ignored);
  }
}

OutputPart::OutputPart(const fs::path& folder, const std::string& stem, PartKind kind,
                       const std::string& shown) {
  const FolderTurn turn(folder);
  for (const std::string& path : PartsIn(folder, stem)) {
    const FoundPart found(path);
    if (found.what() == Found::kHeld) {
      throw Error(fmt::format(
          "{}: another run is writing this output; wait for it or choose another name", shown));
    }
    std::error_code failure;
    if (found.what() == Found::kLeftOver) fs::remove_all(path, failure);
    // Its owner may be removing it at the same time.
    if (failure == std::errc::no_such_file_or_directory) failure.clear();
    if (failure == std::errc::not_enough_memory) throw std::bad_alloc();
    if (failure) {
      throw Error(fmt::format(
          "{}: cannot be written: {}, which an earlier run left behind, cannot be removed: {}",
          shown, path, failure.message()));
    }
  }
  constexpr int kMaxTries = 100;
  for (int i = 0; i < kMaxTries; ++i) {
    try {
      temporary_ = Temporary([&] {
        path_ = (folder / fmt::format("{}{:016x}{}", Beginning(stem), Unpredictable(), kEnding))
                    .string();
        fd_ = Create(path_, kind);
        if (fd_ < 0 && errno == EEXIST) throw NameIsTaken();
        if (fd_ < 0) throw CannotBeWritten(shown, errno);
        return path_;
      });
    } catch (const NameIsTaken&) {
      continue;
    }
    // A run that did not wait for its turn may have mistaken the new part for one that was left
    // behind.
    if (::flock(fd_, LOCK_EX | LOCK_NB) == 0 && IsNamed(fd_, path_)) return;
    const int error = errno;
    const bool is_there = IsNamed(fd_, path_);
    ::close(fd_);
    fd_ = -1;
    temporary_ = Temporary();
    if (is_there && error != EWOULDBLOCK) {
      std::error_code ignored;
      fs::remove(path_, ignored);
      throw CannotBeWritten(shown, error);
    }
  }
  throw Error(
      fmt::format("{}: cannot be written: another process repeatedly removes the temporary file or "
                  "folder beside it",
                  shown));
}

OutputPart::~OutputPart() {
  if (fd_ < 0) return;
  std::error_code ignored;
  // Another program may have renamed the folder that contains the part.
  if (!IsNamed(fd_, path_)) path_ = PathOf(fd_);
  const bool is_ours = !path_.empty() && IsNamed(fd_, path_);
  ::close(fd_);  // before remove_all, which needs a free descriptor to empty a folder
  if (is_ours) fs::remove_all(path_, ignored);
}

void OutputPart::RequireThere(const std::string& shown) const {
  if (IsNamed(fd_, path_)) return;
  throw Error(
      fmt::format("{}: cannot be written: its temporary file or folder {} was removed or renamed "
                  "by another process",
                  shown, path_));
}

void OutputPart::Release() {
  ::close(fd_);
  fd_ = -1;
  temporary_ = Temporary();
}

}  // namespace thicklens

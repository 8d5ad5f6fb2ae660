#include "thicklens/model/output_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <fnmatch.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <new>
#include <system_error>

#include "thicklens/error.h"

namespace thicklens::model {
namespace {

namespace fs = std::filesystem;

Error CannotBeWritten(const std::string& target, int error) {
  return Error(fmt::format("{}: cannot be written: {}", target, std::strerror(error)));
}

// Whether that is the name of what was opened.
bool IsNamed(int fd, const std::string& name) {
  struct stat opened {
  }, named{};
  return ::fstat(fd, &opened) == 0 && ::stat(name.c_str(), &named) == 0 &&
         opened.st_ino == named.st_ino && opened.st_dev == named.st_dev;
}

// What was written so far would be missing, or be somebody else's, and nobody would know.
void RequireStillNamed(int fd, const std::string& part, const std::string& target) {
  if (IsNamed(fd, part)) return;
  throw Error(fmt::format(
      "{}: cannot be written: {}, where it is made, was removed or renamed by somebody else",
      target, part));
}

enum class PartKind { kFile, kFolder };

// Creates, opens and locks the part file or folder of an output. If another run holds the lock,
// that is an Error; a part that a killed run left behind carries no lock.
int OpenLocked(const std::string& part, const std::string& target, PartKind kind) {
  const int flags = kind == PartKind::kFile ? O_RDWR | O_CREAT : O_RDONLY | O_DIRECTORY;
  for (;;) {
    if (kind == PartKind::kFolder && ::mkdir(part.c_str(), 0777) != 0 && errno != EEXIST)
      throw CannotBeWritten(target, errno);
    const int fd = ::open(part.c_str(), flags | O_CLOEXEC, 0666);
    if (fd < 0 && errno == ENOENT && kind == PartKind::kFolder) continue;  // its holder removed it
    if (fd < 0) throw CannotBeWritten(target, errno);
    if (::flock(fd, LOCK_EX | LOCK_NB) != 0) {
      const int error = errno;
      ::close(fd);
      if (error != EWOULDBLOCK) throw CannotBeWritten(target, error);
      throw Error(fmt::format(
          "{}: another run is writing this output; wait for it or choose another name", target));
    }
    // Between open and flock the holder may have renamed or removed what was opened.
    if (IsNamed(fd, part)) return fd;
    ::close(fd);
  }
}

std::string PartName(const fs::path& target) {
  return (target.parent_path() / ("." + target.filename().string() + ".part")).string();
}

void RequireParentFolder(const fs::path& target) {
  const fs::path parent = target.has_parent_path() ? target.parent_path() : fs::path(".");
  std::error_code ignored;
  if (!fs::is_directory(parent, ignored)) {
    throw Error(fmt::format("{}: the folder {} does not exist", target.string(), parent.string()));
  }
}

void WriteAll(int fd, const std::string& content, const std::string& target) {
  std::size_t done = 0;
  while (done < content.size()) {
    const ssize_t n = ::write(fd, content.data() + done, content.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw CannotBeWritten(target, errno);
    done += static_cast<std::size_t>(n);
  }
  if (::fsync(fd) != 0 && errno != EINVAL) throw CannotBeWritten(target, errno);
}

// "a/b/", "a/b/." and "a/b" are the same folder; "." and ".." have no name of their own.
fs::path WithoutTrailingSlash(const std::string& path) {
  const fs::path result = fs::path(path).lexically_normal();
  return result.has_filename() ? result : result.parent_path();
}

// What a symbolic link points at: renaming over the link itself would leave its target as it was.
fs::path Followed(const fs::path& target) {
  std::error_code failure;
  if (!fs::is_symlink(target, failure)) return target;
  const fs::path followed = fs::canonical(target, failure);
  return failure ? target : followed;
}

Error WouldBeLost(const fs::path& folder, const std::string& name) {
  return Error(
      fmt::format("{}: this folder also holds '{}', which would be lost; move it away or choose "
                  "another name",
                  folder.string(), name));
}

// Throws Error for what is in that folder of an output folder and matches none of the patterns.
void RequireOwn(const fs::path& folder, const std::string& name,
                const std::vector<std::string>& patterns) {
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder / name, ignored)) {
    const std::string inner = name + "/" + entry.path().filename().string();
    const bool is_own = std::any_of(patterns.begin(), patterns.end(), [&](const auto& pattern) {
      return ::fnmatch(pattern.c_str(), inner.c_str(), FNM_PATHNAME) == 0;
    });
    if (!is_own || fs::is_directory(entry.symlink_status())) throw WouldBeLost(folder, inner);
  }
}

// A folder that is there already is replaced only if that can lose nothing of anybody else's.
void RequireReplaceable(const fs::path& folder, const std::string& marker_file,
                        const std::vector<std::string>& own_entries) {
  std::error_code ignored;
  if (!fs::exists(folder, ignored)) return;
  if (!fs::is_directory(folder, ignored))
    throw Error(fmt::format("{}: is a file; a folder is expected", folder.string()));
  if (!fs::is_empty(folder, ignored) && !fs::exists(folder / marker_file, ignored)) {
    throw Error(
        fmt::format("{}: this folder holds other files (no {} in it) and is not replaced; choose "
                    "another name",
                    folder.string(), marker_file));
  }
  if (own_entries.empty()) return;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    const std::string name = entry.path().filename().string();
    if (std::find(own_entries.begin(), own_entries.end(), name) != own_entries.end()) continue;
    std::vector<std::string> patterns;  // of what may be in it
    std::copy_if(own_entries.begin(), own_entries.end(), std::back_inserter(patterns),
                 [&](const std::string& own) { return own.rfind(name + "/", 0) == 0; });
    if (patterns.empty() || !fs::is_directory(entry.path(), ignored))
      throw WouldBeLost(folder, name);
    RequireOwn(folder, name, patterns);
  }
}

// A name beside the target that nothing has yet.
fs::path NameToStepAside(const fs::path& target) {
  std::error_code ignored;
  for (int i = 1;; ++i) {
    fs::path aside =
        target.parent_path() / fmt::format(".{}.old-{}", target.filename().string(), i);
    if (!fs::exists(fs::symlink_status(aside, ignored))) return aside;
  }
}

// Gives two folders each the other's name, so that there is none at no moment. False where the file
// system cannot.
bool ExchangeNames(const std::string& a, const std::string& b) {
#ifdef RENAME_EXCHANGE
  return ::renameat2(AT_FDCWD, a.c_str(), AT_FDCWD, b.c_str(), RENAME_EXCHANGE) == 0;
#else
  static_cast<void>(a);
  static_cast<void>(b);
  return false;
#endif
}

// The part takes the place of the folder that is there, which goes. False: nothing was done.
bool ReplaceAtOnce(const std::string& part, const std::string& target) {
  // The old folder gets the part's name, under which other runs look for one that nobody holds.
  const int old = ::open(target.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (old < 0) return false;
  const bool done = ::flock(old, LOCK_EX | LOCK_NB) == 0 && ExchangeNames(part, target);
  std::error_code failure, ignored;
  if (done) fs::remove_all(part, failure);
  // What cannot be removed must not be in the way of the next run.
  if (done && failure) fs::rename(part, NameToStepAside(target), ignored);
  ::close(old);
  return done;
}

}  // namespace

struct OutputFile::Impl {
  std::string path;    // as it was given, for messages
  std::string target;  // the same, links followed
  std::string part;
  int fd = -1;

  ~Impl() {
    if (fd < 0) return;
    if (IsNamed(fd, part)) ::unlink(part.c_str());  // else it is somebody else's
    ::close(fd);
  }
};

OutputFile::OutputFile(const std::string& path) : impl_(std::make_unique<Impl>()) {
  if (path.empty()) throw Error("the name of the output file is empty");
  std::error_code ignored;
  const fs::file_status status = fs::status(path, ignored);
  if (!fs::path(path).has_filename() || fs::is_directory(status)) {
    throw Error(fmt::format("{}: is a folder; the name of a file is expected", path));
  }
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    throw Error(fmt::format("{}: is a device or a pipe; the name of a file is expected", path));
  }
  const fs::path target = Followed(path);
  RequireParentFolder(target);
  impl_->path = path;
  impl_->target = target.string();
  impl_->part = PartName(target);
  impl_->fd = OpenLocked(impl_->part, path, PartKind::kFile);
}

OutputFile::~OutputFile() = default;
OutputFile::OutputFile(OutputFile&&) noexcept = default;
OutputFile& OutputFile::operator=(OutputFile&&) noexcept = default;

void OutputFile::Commit(const std::string& content) {
  Impl& impl = *impl_;
  if (::ftruncate(impl.fd, 0) != 0) throw CannotBeWritten(impl.path, errno);
  WriteAll(impl.fd, content, impl.path);
  RequireStillNamed(impl.fd, impl.part, impl.path);
  if (::rename(impl.part.c_str(), impl.target.c_str()) != 0)
    throw CannotBeWritten(impl.path, errno);
  ::close(impl.fd);
  impl.fd = -1;
}

const std::string& OutputFile::path() const { return impl_->path; }

struct OutputFolder::Impl {
  std::string path;
  std::string part;
  std::string marker_file;
  std::vector<std::string> own_entries;
  int fd = -1;

  // The name of a file as it will be.
  std::string Shown(const std::string& name) const { return (fs::path(path) / name).string(); }
  // Where it is written, in a folder that is there.
  std::string Place(const std::string& name) const {
    RequireStillNamed(fd, part, Shown(name));
    const fs::path file = fs::path(part) / name;
    std::error_code failure;
    // Of one that vanished after all this makes none.
    if (fs::path(name).has_parent_path()) fs::create_directory(file.parent_path(), failure);
    if (failure)
      throw Error(fmt::format("{}: cannot be written: {}", Shown(name), failure.message()));
    return file.string();
  }

  ~Impl() {
    if (fd < 0) return;
    std::error_code ignored;
    if (IsNamed(fd, part)) fs::remove_all(part, ignored);  // else it is somebody else's
    ::close(fd);
  }
};

OutputFolder::OutputFolder(const std::string& path, const std::string& marker_file,
                           const std::vector<std::string>& own_entries)
    : impl_(std::make_unique<Impl>()) {
  if (path.empty()) throw Error("the name of the output folder is empty");
  const fs::path named = WithoutTrailingSlash(path);
  if (!named.has_filename() || named.filename() == "." || named.filename() == "..")
    throw Error(fmt::format("{}: a folder of its own is expected, by name", path));
  const fs::path target = Followed(named);
  RequireParentFolder(target);
  impl_->path = target.string();
  impl_->part = PartName(target);
  impl_->marker_file = marker_file;
  impl_->own_entries = own_entries;
  impl_->fd = OpenLocked(impl_->part, path, PartKind::kFolder);
  // Under the lock: another run's Commit would be seen half-way else.
  RequireReplaceable(target, marker_file, own_entries);
  std::error_code ignored, failure;
  for (const auto& left_over : fs::directory_iterator(impl_->part, ignored))
    fs::remove_all(left_over, ignored);
  const bool is_empty = fs::is_empty(impl_->part, failure);
  if (failure == std::errc::not_enough_memory) throw std::bad_alloc();
  if (failure || !is_empty) {
    throw Error(
        fmt::format("{}: cannot be written: {}, which an earlier run left, cannot be emptied{}",
                    path, impl_->part, failure ? ": " + failure.message() : ""));
  }
}

OutputFolder::~OutputFolder() = default;
OutputFolder::OutputFolder(OutputFolder&&) noexcept = default;
OutputFolder& OutputFolder::operator=(OutputFolder&&) noexcept = default;

const std::string& OutputFolder::staging_path() const { return impl_->part; }
const std::string& OutputFolder::path() const { return impl_->path; }

void OutputFolder::Write(const std::string& name, const std::string& content) {
  const std::string shown = impl_->Shown(name);
  const std::string path = impl_->Place(name);
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (fd < 0) throw CannotBeWritten(shown, errno);
  try {
    WriteAll(fd, content, shown);
  } catch (...) {
    ::close(fd);
    throw;
  }
  if (::close(fd) != 0) throw CannotBeWritten(shown, errno);
}

void OutputFolder::WriteWith(
    const std::string& name,
    const std::function<void(const std::string& path, const std::string& shown)>& write) {
  const std::string shown = impl_->Shown(name);
  const std::string path = impl_->Place(name);
  write(path, shown);
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) throw CannotBeWritten(shown, errno);
  const int error = ::fsync(fd) != 0 ? errno : 0;
  ::close(fd);
  if (error != 0 && error != EINVAL) throw CannotBeWritten(shown, error);
}

void OutputFolder::Commit() {
  Impl& impl = *impl_;
  RequireStillNamed(impl.fd, impl.part, impl.path);
  RequireReplaceable(impl.path, impl.marker_file, impl.own_entries);  // work may have taken hours
  if (ReplaceAtOnce(impl.part, impl.path)) {
    ::close(impl.fd);
    impl.fd = -1;
    return;
  }
  std::error_code failure;
  // Not every file system can do it at once: the old folder steps aside first and comes back if the
  // new one cannot take its place.
  const fs::path aside = NameToStepAside(impl.path);
  const bool replaces = fs::exists(impl.path, failure);
  if (replaces) {
    fs::rename(impl.path, aside, failure);
    if (failure)
      throw Error(fmt::format("{}: cannot be replaced: {}", impl.path, failure.message()));
  }
  fs::rename(impl.part, impl.path, failure);
  if (failure) {
    std::error_code ignored;
    if (replaces) fs::rename(aside, impl.path, ignored);
    throw Error(fmt::format("{}: cannot be written: {}", impl.path, failure.message()));
  }
  ::close(impl.fd);
  impl.fd = -1;
  if (replaces) fs::remove_all(aside, failure);
}

void WriteFileAtomically(const std::string& path, const std::string& content) {
  OutputFile(path).Commit(content);
}

}  // namespace thicklens::model

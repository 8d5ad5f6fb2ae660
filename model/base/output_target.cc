#include "model/base/output_target.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>

#include "thicklens/base/input_file.h"

namespace thicklens {
namespace {

namespace fs = std::filesystem;

// "a/b/", "a/b/." and "a/b" are the same folder; "." and ".." have no name of their own.
fs::path WithoutTrailingSlash(fs::path path) {
  while (path.has_parent_path() && path.has_relative_path() &&
         (!path.has_filename() || path.filename() == ".")) {
    path = path.parent_path();
  }
  return path;
}

fs::path FolderOf(const fs::path& target) {
  return target.has_parent_path() ? target.parent_path() : fs::path(".");
}

void RequireName(const std::string& path, const std::string& what) {
  if (path.empty()) throw Error(fmt::format("the name of the output {} is empty", what));
  if (path != "-") return;
  throw Error(
      fmt::format("-: this output cannot be written to standard output; the name of a {} is "
                  "expected (write ./- if its name is '-')",
                  what));
}

// Throws Error for a target in the folders of descriptors, devices and system files, which contain
// no ordinary files.
void RequireOrdinaryFolder(const std::string& path, const fs::path& target) {
  std::error_code failure;
  const std::string folder = fs::canonical(FolderOf(target), failure).string() + "/";
  const auto is_below = [&](const char* of) { return folder.rfind(of, 0) == 0; };
  if (failure || !(folder == "/dev/" || is_below("/proc/") || is_below("/sys/"))) return;
  throw Error(
      fmt::format("{}: names a device or a pipe, not a file on a disk; the name of an ordinary "
                  "file is expected",
                  path));
}

fs::path Followed(const std::string& path, const fs::path& target) {
  std::error_code failure;
  if (!fs::is_symlink(target, failure)) return target;
  const fs::path followed = fs::canonical(target, failure);
  if (!failure) return followed;
  std::error_code ignored;
  throw Error(
      fmt::format("{}: is a symbolic link to {}, which cannot be reached ({}); remove the link or "
                  "create its target",
                  path, fs::read_symlink(target, ignored).string(), failure.message()));
}

void RequireParentFolder(const std::string& path, const fs::path& target) {
  std::error_code failure;
  const fs::path parent = FolderOf(target);
  const fs::file_status status = fs::status(parent, failure);
  if (fs::is_directory(status)) return;
  if (fs::exists(status)) {
    throw Error(fmt::format("{}: {} is not a folder", path, parent.string()));
  }
  if (failure && failure != std::errc::no_such_file_or_directory)
    throw Error(fmt::format("{}: cannot be written: {}", path, failure.message()));
  throw Error(fmt::format("{}: the folder {} does not exist", path, parent.string()));
}

bool MayWrite(const fs::path& path, int rights) {
  return ::faccessat(AT_FDCWD, path.c_str(), rights, AT_EACCESS) == 0;
}

// Whether the folder is sticky, as /tmp is, and this user owns neither it nor the file: only an
// owner may rename there.
bool IsStickyOfOthers(const fs::path& parent, const struct stat& older) {
  struct stat folder {};
  const uid_t user = ::geteuid();
  return user != 0 && ::stat(parent.c_str(), &folder) == 0 && (folder.st_mode & S_ISVTX) != 0 &&
         folder.st_uid != user && older.st_uid != user;
}

OutputTarget Located(const std::string& path, const fs::path& named) {
  OutputTarget result;
  result.given = path;
  RequireOrdinaryFolder(path, named);
  result.target = Followed(path, named);
  RequireParentFolder(path, result.target);
  struct stat info {};
  if (::lstat(result.target.c_str(), &info) == 0) {
    result.older = info;
  } else if (errno != ENOENT) {
    throw CannotBeWritten(path, errno);
  }
  return result;
}

void DecideHow(int rights, OutputTarget* result) {
  const fs::path parent = result->parent();
  const bool may_rename = MayWrite(parent, W_OK | X_OK);
  const int error = errno;
  if (!result->older) {
    if (!may_rename) throw CannotBeWritten(result->given, error);
    return;
  }
  // A write-protected file is not replaced, although a rename would be possible.
  if (!MayWrite(result->target, rights)) throw CannotBeWritten(result->given, errno);
  result->in_place =
      !may_rename || IsStickyOfOthers(parent, *result->older) || IsMountPoint(result->target);
}

}  // namespace

fs::path OutputTarget::parent() const { return FolderOf(target); }

OutputTarget FileTarget(const std::string& path) {
  RequireName(path, "file");
  if (!fs::path(path).has_filename())
    throw Error(fmt::format("{}: is a folder; the name of a file is expected", path));
  OutputTarget result = Located(path, path);
  if (result.older && !S_ISREG(result.older->st_mode)) {
    throw Error(fmt::format("{}: is {}; the name of a file is expected", path,
                            KindOfFile(result.older->st_mode)));
  }
  DecideHow(W_OK, &result);
  return result;
}

OutputTarget FolderTarget(const std::string& path) {
  RequireName(path, "folder");
  const fs::path named = WithoutTrailingSlash(path);
  if (!named.has_filename() || named.filename() == "." || named.filename() == "..")
    throw Error(fmt::format(
        "{}: the name of a folder for this output alone is expected, not '/', '.' or '..'", path));
  OutputTarget result = Located(path, named);
  if (result.older && !S_ISDIR(result.older->st_mode)) {
    throw Error(fmt::format("{}: is {}; a folder is expected", result.target.string(),
                            KindOfFile(result.older->st_mode)));
  }
  DecideHow(R_OK | W_OK | X_OK, &result);
  return result;
}

Error CannotBeWritten(const std::string& target, int error) {
  return Error(fmt::format("{}: cannot be written: {}", target, std::strerror(error)));
}

bool IsMountPoint(const fs::path& path) {
#ifdef STATX_ATTR_MOUNT_ROOT
  struct statx info {};
  if (::statx(AT_FDCWD, path.c_str(), AT_SYMLINK_NOFOLLOW, STATX_BASIC_STATS, &info) == 0 &&
      (info.stx_attributes_mask & STATX_ATTR_MOUNT_ROOT) != 0) {
    return (info.stx_attributes & STATX_ATTR_MOUNT_ROOT) != 0;
  }
#endif
  struct stat own {
  }, folder{};
  return ::lstat(path.c_str(), &own) == 0 && ::stat(FolderOf(path).c_str(), &folder) == 0 &&
         own.st_dev != folder.st_dev;
}

bool IsNamed(int fd, const std::string& name) {
  struct stat opened {
  }, named{};
  return ::fstat(fd, &opened) == 0 && ::lstat(name.c_str(), &named) == 0 &&
         opened.st_ino == named.st_ino && opened.st_dev == named.st_dev;
}

void KeepOwnerAndMode(int fd, const struct stat& older) {
  constexpr mode_t kGroup = 070, kRights = 01777;
  struct stat info {};
  if (::fstat(fd, &info) != 0) return;
  mode_t mode = older.st_mode & kRights;
  if (S_ISDIR(info.st_mode)) mode |= older.st_mode & S_ISGID;
  const bool is_owners =
      info.st_uid == older.st_uid || ::fchown(fd, older.st_uid, static_cast<gid_t>(-1)) == 0;
  if (!is_owners) mode &= kRights & ~S_ISVTX;
  if (info.st_gid != older.st_gid && ::fchown(fd, static_cast<uid_t>(-1), older.st_gid) != 0)
    mode = (mode & ~kGroup) | (mode & ((mode & 07) << 3));
  // Some file systems have no permissions.
  static_cast<void>(::fchmod(fd, mode));
}

void RequireStored(int fd, const std::string& shown) {
  if (::fsync(fd) != 0 && errno != EINVAL) throw CannotBeWritten(shown, errno);
  // Closing may also fail on a full disk, but this descriptor must stay open for its lock.
  const int copy = ::fcntl(fd, F_DUPFD_CLOEXEC, 0);
  if (copy >= 0 && ::close(copy) != 0) throw CannotBeWritten(shown, errno);
}

void SyncFolder(const fs::path& folder) {
  const int fd = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return;
  ::fsync(fd);
  ::close(fd);
}

}  // namespace thicklens

#include "thicklens/model/output_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <system_error>

#include "thicklens/error.h"

namespace thicklens::model {
namespace {

namespace fs = std::filesystem;

// Opens (creating it by `create`) and locks the part file or folder of an output. Another run that
// holds the lock ends in an Error; a part that a killed run left behind carries no lock.
int OpenLocked(const std::string& part, const std::string& target, int flags) {
  for (;;) {
    const int fd = ::open(part.c_str(), flags | O_CLOEXEC, 0666);
    if (fd < 0) throw Error(fmt::format("{}: cannot be written: {}", target, std::strerror(errno)));
    if (::flock(fd, LOCK_EX | LOCK_NB) != 0) {
      ::close(fd);
      throw Error(fmt::format(
          "{}: another run is writing this output; wait for it or choose another name", target));
    }
    // Between open and flock the holder may have renamed or removed what was opened.
    struct stat opened {
    }, named{};
    if (::fstat(fd, &opened) == 0 && ::stat(part.c_str(), &named) == 0 &&
        opened.st_ino == named.st_ino && opened.st_dev == named.st_dev) {
      return fd;
    }
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
    if (n < 0) throw Error(fmt::format("{}: cannot be written: {}", target, std::strerror(errno)));
    done += static_cast<std::size_t>(n);
  }
  if (::fsync(fd) != 0 && errno != EINVAL) {
    throw Error(fmt::format("{}: cannot be written: {}", target, std::strerror(errno)));
  }
}

// "a/b/" and "a/b" are the same folder.
fs::path WithoutTrailingSlash(const std::string& path) {
  fs::path result(path);
  return result.has_filename() ? result : result.parent_path();
}

}  // namespace

struct OutputFile::Impl {
  std::string path;
  std::string part;
  int fd = -1;

  ~Impl() {
    if (fd < 0) return;
    ::unlink(part.c_str());
    ::close(fd);
  }
};

OutputFile::OutputFile(const std::string& path) : impl_(std::make_unique<Impl>()) {
  const fs::path target(path);
  std::error_code ignored;
  if (!target.has_filename() || fs::is_directory(target, ignored)) {
    throw Error(fmt::format("{}: is a folder; the name of a file is expected", path));
  }
  RequireParentFolder(target);
  impl_->path = path;
  impl_->part = PartName(target);
  impl_->fd = OpenLocked(impl_->part, path, O_RDWR | O_CREAT);
}

OutputFile::~OutputFile() = default;
OutputFile::OutputFile(OutputFile&&) noexcept = default;
OutputFile& OutputFile::operator=(OutputFile&&) noexcept = default;

void OutputFile::Commit(const std::string& content) {
  Impl& impl = *impl_;
  if (::ftruncate(impl.fd, 0) != 0)
    throw Error(fmt::format("{}: cannot be written: {}", impl.path, std::strerror(errno)));
  WriteAll(impl.fd, content, impl.path);
  if (::rename(impl.part.c_str(), impl.path.c_str()) != 0) {
    throw Error(fmt::format("{}: cannot be written: {}", impl.path, std::strerror(errno)));
  }
  ::close(impl.fd);
  impl.fd = -1;
}

const std::string& OutputFile::path() const { return impl_->path; }

struct OutputFolder::Impl {
  std::string path;
  std::string part;
  int fd = -1;

  ~Impl() {
    if (fd < 0) return;
    std::error_code ignored;
    fs::remove_all(part, ignored);
    ::close(fd);
  }
};

OutputFolder::OutputFolder(const std::string& path, const std::string& marker_file)
    : impl_(std::make_unique<Impl>()) {
  const fs::path target = WithoutTrailingSlash(path);
  std::error_code ignored;
  if (fs::exists(target, ignored)) {
    if (!fs::is_directory(target, ignored))
      throw Error(fmt::format("{}: is a file; a folder is expected", path));
    if (!fs::is_empty(target, ignored) && !fs::exists(target / marker_file, ignored)) {
      throw Error(
          fmt::format("{}: this folder holds other files (no {} in it) and is not replaced; choose "
                      "another name",
                      path, marker_file));
    }
  }
  RequireParentFolder(target);
  impl_->path = target.string();
  impl_->part = PartName(target);
  if (::mkdir(impl_->part.c_str(), 0777) != 0 && errno != EEXIST) {
    throw Error(fmt::format("{}: cannot be written: {}", path, std::strerror(errno)));
  }
  impl_->fd = OpenLocked(impl_->part, path, O_RDONLY | O_DIRECTORY);
  for (const auto& left_over : fs::directory_iterator(impl_->part, ignored))
    fs::remove_all(left_over, ignored);
}

OutputFolder::~OutputFolder() = default;
OutputFolder::OutputFolder(OutputFolder&&) noexcept = default;
OutputFolder& OutputFolder::operator=(OutputFolder&&) noexcept = default;

const std::string& OutputFolder::staging_path() const { return impl_->part; }
const std::string& OutputFolder::path() const { return impl_->path; }

void OutputFolder::Write(const std::string& name, const std::string& content) {
  const fs::path file = fs::path(impl_->part) / name;
  const std::string shown = (fs::path(impl_->path) / name).string();
  std::error_code failure;
  fs::create_directories(file.parent_path(), failure);
  if (failure) throw Error(fmt::format("{}: cannot be written: {}", shown, failure.message()));
  const int fd = ::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (fd < 0) throw Error(fmt::format("{}: cannot be written: {}", shown, std::strerror(errno)));
  try {
    WriteAll(fd, content, shown);
  } catch (...) {
    ::close(fd);
    throw;
  }
  if (::close(fd) != 0)
    throw Error(fmt::format("{}: cannot be written: {}", shown, std::strerror(errno)));
}

void OutputFolder::Commit() {
  Impl& impl = *impl_;
  std::error_code failure;
  // renameat2 with RENAME_EXCHANGE would be one step, but not every file system has it. The old
  // folder steps aside first and comes back if the new one cannot take its place.
  const fs::path aside =
      fs::path(impl.path).parent_path() / ("." + fs::path(impl.path).filename().string() + ".old");
  const bool replaces = fs::exists(impl.path, failure);
  if (replaces) {
    fs::remove_all(aside, failure);
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

std::string ReadWholeFile(const std::string& path) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored))
    throw Error(fmt::format("{}: is a folder; a file is expected", path));
  errno = 0;
  std::ifstream in(path, std::ios::binary);
  if (!in)
    throw Error(
        fmt::format("{}: cannot be read: {}", path, std::strerror(errno != 0 ? errno : EIO)));
  std::ostringstream content;
  content << in.rdbuf();
  if (in.bad()) throw Error(fmt::format("{}: cannot be read to its end", path));
  return content.str();
}

}  // namespace thicklens::model

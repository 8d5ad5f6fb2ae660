#include "thicklens/base/output_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <optional>

#include "model/base/output_part.h"
#include "model/base/output_target.h"
#include "model/base/write_all.h"
#include "thicklens/base/error.h"
#include "thicklens/base/temporaries.h"

namespace thicklens {
namespace {

// The existing file, opened for writing in place and locked during the lifetime of this object.
class OlderFile {
 public:
  OlderFile(const std::string& path, const std::string& shown)
      : fd_(::open(path.c_str(), O_WRONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC)) {
    if (fd_ < 0) throw CannotBeWritten(shown, errno);
    const bool is_locked = ::flock(fd_, LOCK_EX | LOCK_NB) == 0;
    const int error = errno;
    if (is_locked && IsNamed(fd_, path)) return;
    ::close(fd_);
    if (!is_locked && error != EWOULDBLOCK) throw CannotBeWritten(shown, error);
    throw Error(fmt::format(
        "{}: another run is writing this output; wait for it or choose another name", shown));
  }
  ~OlderFile() { ::close(fd_); }
  OlderFile(const OlderFile&) = delete;
  OlderFile& operator=(const OlderFile&) = delete;

  // A full disk is detected before the older content is changed.
  void Write(const std::string& content, const std::string& shown) const {
    struct stat info {};
    if (::fstat(fd_, &info) != 0) throw CannotBeWritten(shown, errno);
    const auto bytes = static_cast<off_t>(content.size());
    if (bytes > info.st_size) {
      const int error = ::posix_fallocate(fd_, 0, bytes);
      if (error != 0 && error != EOPNOTSUPP && error != EINVAL) {
        if (::ftruncate(fd_, info.st_size) != 0) throw CannotBeWritten(shown, errno);
        throw CannotBeWritten(shown, error);
      }
    }
    if (::lseek(fd_, 0, SEEK_SET) != 0) throw CannotBeWritten(shown, errno);
    WriteAll(fd_, content, shown);
    if (::ftruncate(fd_, bytes) != 0) throw CannotBeWritten(shown, errno);
    RequireStored(fd_, shown);
  }

 private:
  int fd_;
};

}  // namespace

struct OutputFile::Impl {
  OutputTarget target;
  std::optional<OutputPart> part;  // either `part` or `older` is present
  std::optional<OlderFile> older;
};

OutputFile::OutputFile(const std::string& path) : impl_(std::make_unique<Impl>()) {
  impl_->target = FileTarget(path);
  const OutputTarget& target = impl_->target;
  if (target.in_place) {
    impl_->older.emplace(target.target.string(), path);
  } else {
    impl_->part.emplace(target.parent(), target.target.filename().string(), PartKind::kFile, path);
  }
}

OutputFile::~OutputFile() = default;
OutputFile::OutputFile(OutputFile&&) noexcept = default;
OutputFile& OutputFile::operator=(OutputFile&&) noexcept = default;

void OutputFile::Commit(const std::string& content) {
  const OutputTarget& target = impl_->target;
  const std::string& shown = target.given;
  if (impl_->older) {
    PutInPlace(shown, [&] {
      impl_->older->Write(content, shown);
      return std::string();
    });
    impl_->older.reset();
    return;
  }
  OutputPart& part = *impl_->part;
  if (::ftruncate(part.fd(), 0) != 0 || ::lseek(part.fd(), 0, SEEK_SET) != 0)
    throw CannotBeWritten(shown, errno);
  // The permissions are set before the file has content that others could read.
  struct stat older {};
  if (::lstat(target.target.c_str(), &older) == 0 && S_ISREG(older.st_mode))
    KeepOwnerAndMode(part.fd(), older);
  WriteAll(part.fd(), content, shown);
  RequireStored(part.fd(), shown);
  part.RequireThere(shown);
  PutInPlace(shown, [&] {
    if (::rename(part.path().c_str(), target.target.c_str()) != 0)
      throw CannotBeWritten(shown, errno);
    return std::string();
  });
  part.Release();
  SyncFolder(target.parent());
}

const std::string& OutputFile::path() const { return impl_->target.given; }

void WriteFileAtomically(const std::string& path, const std::string& content) {
  OutputFile(path).Commit(content);
}

}  // namespace thicklens

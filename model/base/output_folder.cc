#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <system_error>

#include "model/base/folder_content.h"
#include "model/base/output_part.h"
#include "model/base/output_target.h"
#include "model/base/write_all.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/temporaries.h"

namespace thicklens {
namespace {

namespace fs = std::filesystem;

// An unused name beside the target.
fs::path NameToStepAside(const fs::path& target) {
  std::error_code ignored;
  for (int i = 1;; ++i) {
    fs::path aside =
        target.parent_path() / fmt::format(".{}.old-{}", target.filename().string(), i);
    if (!fs::exists(fs::symlink_status(aside, ignored))) return aside;
  }
}

// Exchanges the names of two folders, so that both names exist at every moment. Returns false if
// the file system cannot do it.
bool ExchangeNames(const std::string& a, const std::string& b) {
#ifdef RENAME_EXCHANGE
  return ::renameat2(AT_FDCWD, a.c_str(), AT_FDCWD, b.c_str(), RENAME_EXCHANGE) == 0;
#else
  static_cast<void>(a);
  static_cast<void>(b);
  return false;
#endif
}

void Rename(const fs::path& from, const fs::path& to, const std::string& shown) {
  std::error_code failure;
  fs::rename(from, to, failure);
  if (failure) throw Error(fmt::format("{}: cannot be written: {}", shown, failure.message()));
}

// A file in the part of a run that writes in place. It says that the older content is no longer
// complete.
constexpr char kCommitBegun[] = ".commit-begun";

class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }

 private:
  int fd_;
};

}  // namespace

struct OutputFolder::Impl {
  OutputTarget target;
  std::string path;  // path of the target with links followed
  FolderContent content;
  std::optional<OutputPart> part;  // beside the target, or in it

  // The final path of a file.
  std::string Shown(const std::string& name) const { return (fs::path(path) / name).string(); }

  // The path at which a file is written. Its folder is created if necessary.
  std::string Place(const std::string& name) const {
    part->RequireThere(Shown(name));
    const fs::path file = fs::path(part->path()) / name;
    std::error_code failure;
    // create_directory creates no parents, so that a part that has vanished is not created again.
    if (fs::path(name).has_parent_path()) fs::create_directory(file.parent_path(), failure);
    if (failure)
      throw Error(fmt::format("{}: cannot be written: {}", Shown(name), failure.message()));
    return file.string();
  }

  void RequireReplaceable() const {
    content.RequireReplaceable(target.target, path, target.in_place, false);
  }

  // Removes the remains of a run that was killed while it wrote into this folder in place: its part
  // and, if the run was killed during Commit, the incomplete content, which has no marker. The
  // present run may nevertheless replace the folder as a whole, e.g. if it is no longer a mount
  // point.
  void RemoveLeftOver() const {
    if (!HasLeftOverPart(target.target, kInnerPartStem)) return;
    // Without that file, the run was killed before it touched the content, which is somebody's.
    const bool was_in_commit = HasLeftOverPart(target.target, kInnerPartStem, kCommitBegun);
    content.RequireReplaceable(target.target, path, true, was_in_commit);
    std::error_code ignored;
    if (was_in_commit && !fs::exists(target.target / content.marker_file, ignored)) {
      for (const fs::path& entry : EntriesInPlace(target.target)) Remove(entry);
    }
    RemoveLeftOverParts(target.target, kInnerPartStem);
  }

  void Remove(const fs::path& entry) const {
    std::error_code failure;
    fs::remove_all(entry, failure);
    if (failure) {
      throw Error(fmt::format("{}: the older {} cannot be removed: {}", path,
                              entry.filename().string(), failure.message()));
    }
  }

  // Replaces the existing folder by the part and removes the former. Returns false if nothing was
  // done.
  bool ReplaceAtOnce() {
    // The old folder is locked, because it gets the name of the part, and other runs remove parts
    // without a lock.
    const Descriptor old(::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
    if (old.get() < 0 || ::flock(old.get(), LOCK_EX | LOCK_NB) != 0) return false;
    const std::optional<Temporary> replaced = PutInPlace(path, [&]() -> std::optional<std::string> {
      if (!ExchangeNames(part->path(), path)) return std::nullopt;
      try {
        // Another program may have added content or replaced the folder since the last check.
        content.RequireReplaceable(part->path(), path, false, false);
      } catch (const Error&) {
        ExchangeNames(part->path(), path);
        throw;
      }
      return part->path();
    });
    if (!replaced) return false;
    std::error_code failure, ignored;
    fs::remove_all(part->path(), failure);
    // Remains that cannot be removed must not obstruct the next run.
    if (failure) fs::rename(part->path(), NameToStepAside(path), ignored);
    part->Release();
    return true;
  }

  // Replaces the folder on file systems that cannot exchange two names: the old folder is renamed
  // first, and renamed back if the new one cannot be moved to the target.
  void ReplaceByTwoNames() {
    std::error_code ignored;
    const std::optional<Temporary> replaced = PutInPlace(path, [&]() -> std::optional<std::string> {
      const fs::path aside = NameToStepAside(path);
      const bool replaces = fs::exists(fs::symlink_status(path, ignored));
      std::error_code failure;
      if (replaces) fs::rename(path, aside, failure);
      if (failure) return std::nullopt;
      try {
        if (replaces) content.RequireReplaceable(aside, path, false, false);
        Rename(part->path(), path, path);
      } catch (const Error&) {
        if (replaces) fs::rename(aside, path, ignored);
        throw;
      }
      return replaces ? aside.string() : std::string();
    });
    if (!replaced) {  // a folder from a lower layer of an overlay, as in a container's image
      ReplaceContent();
      return;
    }
    part->Release();
    if (!replaced->path().empty()) fs::remove_all(replaced->path(), ignored);
  }

  // The marker is removed first and added last: while it exists, the folder is complete.
  void ReplaceContent() {
    PutInPlace(path, [&] {
      MoveContent();
      return std::string();
    });
    part.reset();
    SyncFolder(target.target);
  }

  void MoveContent() const {
    const fs::path& folder = target.target;
    if (target.in_place) {
      const std::string begun = (fs::path(part->path()) / kCommitBegun).string();
      const Descriptor file(
          ::open(begun.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666));
      if (file.get() < 0) throw CannotBeWritten(path, errno);
    }
    std::error_code failure;
    fs::remove(folder / content.marker_file, failure);
    if (failure) throw Error(fmt::format("{}: cannot be replaced: {}", path, failure.message()));
    for (const fs::path& entry : EntriesInPlace(folder)) Remove(entry);
    for (const auto& entry : fs::directory_iterator(part->path(), failure)) {
      const std::string name = entry.path().filename().string();
      if (name != content.marker_file && name != kCommitBegun)
        Rename(entry.path(), folder / name, Shown(name));
    }
    SyncFolder(folder);
    const fs::path marker = fs::path(part->path()) / content.marker_file;
    if (fs::exists(marker, failure))
      Rename(marker, folder / content.marker_file, Shown(content.marker_file));
  }
};

OutputFolder::OutputFolder(const std::string& path, const std::string& marker_file,
                           const std::vector<std::string>& own_entries)
    : impl_(std::make_unique<Impl>()) {
  Impl& impl = *impl_;
  impl.target = FolderTarget(path);
  const fs::path& target = impl.target.target;
  impl.path = target.string();
  impl.content = {marker_file, own_entries};
  impl.RemoveLeftOver();
  if (impl.target.in_place) {
    impl.RequireReplaceable();
    impl.part.emplace(target, kInnerPartStem, PartKind::kFolder, path);
  } else {
    impl.part.emplace(impl.target.parent(), target.filename().string(), PartKind::kFolder, path);
  }
  // This check needs the lock; otherwise it could see an incomplete Commit of another run.
  impl.RequireReplaceable();
}

OutputFolder::~OutputFolder() = default;
OutputFolder::OutputFolder(OutputFolder&&) noexcept = default;
OutputFolder& OutputFolder::operator=(OutputFolder&&) noexcept = default;

const std::string& OutputFolder::staging_path() const { return impl_->part->path(); }
const std::string& OutputFolder::path() const { return impl_->path; }

void OutputFolder::Write(const std::string& name, const std::string& content) {
  const std::string shown = impl_->Shown(name);
  const std::string path = impl_->Place(name);
  const Descriptor file(
      ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW | O_CLOEXEC, 0666));
  if (file.get() < 0) throw CannotBeWritten(shown, errno);
  WriteAll(file.get(), content, shown);
  RequireStored(file.get(), shown);
}

void OutputFolder::WriteWith(
    const std::string& name,
    const std::function<void(const std::string& path, const std::string& shown)>& write) {
  const std::string shown = impl_->Shown(name);
  const std::string path = impl_->Place(name);
  write(path, shown);
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC));
  if (file.get() < 0) throw CannotBeWritten(shown, errno);
  RequireStored(file.get(), shown);
}

void OutputFolder::Commit() {
  Impl& impl = *impl_;
  impl.part->RequireThere(impl.path);
  impl.RequireReplaceable();  // again, because the computation may have taken hours
  if (impl.target.in_place) {
    impl.ReplaceContent();
    return;
  }
  struct stat older {};
  if (::lstat(impl.path.c_str(), &older) == 0 && S_ISDIR(older.st_mode))
    KeepOwnerAndMode(impl.part->fd(), older);
  if (!impl.ReplaceAtOnce()) impl.ReplaceByTwoNames();
  SyncFolder(impl.target.parent());
}

}  // namespace thicklens

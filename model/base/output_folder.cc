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

void Rename(const fs::path& from, const fs::path& to, const std::string& shown) {
  std::error_code failure;
  fs::rename(from, to, failure);
  if (failure) throw Error(fmt::format("{}: cannot be written: {}", shown, failure.message()));
}

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
  std::string path;  // links followed
  FolderContent content;
  std::optional<OutputPart> part;  // beside the target, or in it

  // The name of a file as it will be.
  std::string Shown(const std::string& name) const { return (fs::path(path) / name).string(); }

  // Where it is written, in a folder that is there.
  std::string Place(const std::string& name) const {
    part->RequireThere(Shown(name));
    const fs::path file = fs::path(part->path()) / name;
    std::error_code failure;
    // Where the part has vanished after all, this makes no folder.
    if (fs::path(name).has_parent_path()) fs::create_directory(file.parent_path(), failure);
    if (failure)
      throw Error(fmt::format("{}: cannot be written: {}", Shown(name), failure.message()));
    return file.string();
  }

  void RequireReplaceable() const {
    content.RequireReplaceable(target.target, path, target.in_place, false);
  }

  // Removes what a run has left which was killed while it wrote into this folder in place: its part
  // and, where it was killed while its output came into place, content of which nothing is whole
  // and which has no marker. This run may replace the folder as a whole (the mount is gone, say).
  void RemoveLeftOver() const {
    if (!HasLeftOverPart(target.target, kInnerPartStem)) return;
    content.RequireReplaceable(target.target, path, true, true);
    std::error_code ignored;
    if (!fs::exists(target.target / content.marker_file, ignored)) {
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

  // The part takes the place of the folder that is there, which goes. False: nothing was done.
  bool ReplaceAtOnce() {
    // The old folder gets the part's name, under which other runs look for one that nobody holds.
    const Descriptor old(::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
    if (old.get() < 0 || ::flock(old.get(), LOCK_EX | LOCK_NB) != 0) return false;
    const std::optional<Temporary> replaced = PutInPlace(path, [&]() -> std::optional<std::string> {
      if (!ExchangeNames(part->path(), path)) return std::nullopt;
      try {
        // Somebody may have put something into it, or into its place, since the last look.
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
    // A rest that cannot be removed must not be in the way of the next run.
    if (failure) fs::rename(part->path(), NameToStepAside(path), ignored);
    part->Release();
    return true;
  }

  // Not every file system can do it at once: the old folder steps aside first and comes back if the
  // new one cannot take its place.
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

  // The marker goes first and comes last: while it is there, the folder is whole.
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
    std::error_code failure;
    fs::remove(folder / content.marker_file, failure);
    if (failure) throw Error(fmt::format("{}: cannot be replaced: {}", path, failure.message()));
    for (const fs::path& entry : EntriesInPlace(folder)) Remove(entry);
    for (const auto& entry : fs::directory_iterator(part->path(), failure)) {
      const std::string name = entry.path().filename().string();
      if (name != content.marker_file) Rename(entry.path(), folder / name, Shown(name));
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
  // Without the lock, another run's Commit could be seen half done.
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
  impl.RequireReplaceable();  // work may have taken hours
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

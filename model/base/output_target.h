#ifndef THICKLENS_MODEL_BASE_OUTPUT_TARGET_H_
#define THICKLENS_MODEL_BASE_OUTPUT_TARGET_H_

#include <sys/stat.h>

#include <filesystem>
#include <optional>
#include <string>

#include "thicklens/base/error.h"

namespace thicklens {

// The target of an output, which is checked before anything is computed.
struct OutputTarget {
  std::string given;                 // the path as given, for messages
  std::filesystem::path target;      // links are followed, so that a link is kept, as by `cp`
  std::optional<struct stat> older;  // the existing file or folder
  // True if the existing file or folder cannot be replaced by a rename and must be written in
  // place: it is a mount point, or the rights in its folder do not permit a rename.
  bool in_place = false;

  std::filesystem::path parent() const;
};

// Check the target of a file or folder. They throw Error if the name is empty, '-' or too long, if
// the existing target has another kind, is not writable or is a link to nothing, or if the parent
// folder does not exist.
OutputTarget FileTarget(const std::string& path);
OutputTarget FolderTarget(const std::string& path);

Error CannotBeWritten(const std::string& target, int error);

bool IsMountPoint(const std::filesystem::path& path);

// Returns true if `name` is the path of the opened file or folder `fd`.
bool IsNamed(int fd, const std::string& name);

// Gives a new file or folder the owner, group and permission bits of the older one, as if the older
// one had been written in place. An owner or a group that this user may not set remains that of
// this user; the group then gets no more rights than all other users have.
void KeepOwnerAndMode(int fd, const struct stat& older);

// Waits until the content written through `fd` is on the disk. Throws Error, because some file
// systems report a full disk or a quota only then.
void RequireStored(int fd, const std::string& shown);

// Syncs a folder, so that a new name in it survives a power failure.
void SyncFolder(const std::filesystem::path& folder);

}  // namespace thicklens

#endif  // THICKLENS_MODEL_BASE_OUTPUT_TARGET_H_

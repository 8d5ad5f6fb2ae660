#ifndef THICKLENS_MODEL_BASE_OUTPUT_TARGET_H_
#define THICKLENS_MODEL_BASE_OUTPUT_TARGET_H_

#include <sys/stat.h>

#include <filesystem>
#include <optional>
#include <string>

#include "thicklens/base/error.h"

namespace thicklens {

// Where an output goes, looked at before anything is computed.
struct OutputTarget {
  std::string given;             // for messages
  std::filesystem::path target;  // links followed, so that a link stays one, as `cp` has it
  std::optional<struct stat> older;
  // The older one cannot be replaced by a new name, only written into: it is a mount point, or the
  // folder that it lies in may not be written to.
  bool in_place = false;

  std::filesystem::path parent() const;
};

// Throw Error: the name is empty, '-', or too long, what is there is of another kind, may not be
// written to, or is a link to nothing, or there is no folder for it.
OutputTarget FileTarget(const std::string& path);
OutputTarget FolderTarget(const std::string& path);

Error CannotBeWritten(const std::string& target, int error);

bool IsMountPoint(const std::filesystem::path& path);

// Whether that is the name of what was opened.
bool IsNamed(int fd, const std::string& name);

// Gives a new file or folder the owner, group and permission bits of the older one, as writing into
// that one would have kept them. An owner or a group that this user may not give stays this user's;
// the group then gets no more rights than all others have.
void KeepOwnerAndMode(int fd, const struct stat& older);

// Waits until the content written through `fd` is on the disk. Throws Error; some file systems
// report a full disk or a quota only then.
void RequireStored(int fd, const std::string& shown);

// A new name lasts beyond a power failure.
void SyncFolder(const std::filesystem::path& folder);

}  // namespace thicklens

#endif  // THICKLENS_MODEL_BASE_OUTPUT_TARGET_H_

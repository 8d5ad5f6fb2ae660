#ifndef THICKLENS_BASE_OUTPUT_FILE_H_
#define THICKLENS_BASE_OUTPUT_FILE_H_

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "thicklens/base/export.h"

namespace thicklens {

// An output file that becomes visible either completely or not at all.
//
// The constructor reserves the name: it creates a new file ".NAME.RANDOM.part" beside the target
// and locks it. It thus throws Error, before any work is done, if the output cannot be written or
// another run is writing it. Commit writes, syncs and renames. Without Commit the destructor
// removes the part file, and an existing target is not changed. A part file that a killed run left
// behind is removed. A symbolic link is kept, and the file to which it leads is replaced. The new
// file gets the owner, group and permissions of the replaced one as far as the rights of this user
// permit.
//
// A file that cannot be replaced, because it is a mount point or its folder is not writable, is
// overwritten in place at Commit. A full disk leaves this file unchanged as well if the file system
// can reserve space.
class THICKLENS_EXPORT OutputFile {
 public:
  explicit OutputFile(const std::string& path);  // throws Error
  ~OutputFile();
  OutputFile(OutputFile&&) noexcept;
  OutputFile& operator=(OutputFile&&) noexcept;

  void Commit(const std::string& content);  // throws Error, e.g. on a full disk
  const std::string& path() const;          // as given to the constructor

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// An output folder that becomes visible either completely or not at all. Files are written into
// staging_path(), and Commit moves the folder to the target and replaces an older one. An older
// folder is replaced only if it is empty, or if it contains `marker_file` (which shows that this
// program wrote it) and, where `own_entries` are given, no other entries. Otherwise the constructor
// and Commit throw Error, which names an entry that would be lost. An own entry is the name of a
// file, the name of a folder with any content, or "FOLDER/PATTERN" for a folder that contains only
// files whose names match one of its shell patterns.
//
// A folder that cannot be replaced, because it is a mount point or its parent folder is not
// writable, gets its new content at Commit, entry by entry, from a part folder within it. The older
// marker is removed first, then the older content; the new marker comes last. "lost+found" in the
// folder is not touched. The next run removes what a killed run left there.
class THICKLENS_EXPORT OutputFolder {
 public:
  // Claims the name and makes the staging folder. Throws Error if the folder cannot be written, if
  // another run is writing it, or if an entry would be lost.
  OutputFolder(const std::string& path, const std::string& marker_file,
               const std::vector<std::string>& own_entries = {});
  ~OutputFolder();
  OutputFolder(OutputFolder&&) noexcept;
  OutputFolder& operator=(OutputFolder&&) noexcept;

  // The folder into which files are written before Commit.
  const std::string& staging_path() const;
  // Writes one file below the staging folder; `name` may begin with one folder. Throws Error.
  void Write(const std::string& name, const std::string& content);
  // Lets the caller write one file: calls write(path, name for messages) and then ensures that the
  // content reaches the disk. Throws Error.
  void WriteWith(
      const std::string& name,
      const std::function<void(const std::string& path, const std::string& shown)>& write);
  void Commit();                    // throws Error
  const std::string& path() const;  // of the target, with links followed

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Writes a file by OutputFile in one step. Throws Error.
THICKLENS_EXPORT void WriteFileAtomically(const std::string& path, const std::string& content);

// Returns the whole content of an input file. Throws Error, which names the path and the reason.
// input_file.h describes which files are refused and declares the reader of text files.
THICKLENS_EXPORT std::string ReadWholeFile(const std::string& path);

}  // namespace thicklens

#endif  // THICKLENS_BASE_OUTPUT_FILE_H_

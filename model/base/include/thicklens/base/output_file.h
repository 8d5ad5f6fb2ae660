#ifndef THICKLENS_BASE_OUTPUT_FILE_H_
#define THICKLENS_BASE_OUTPUT_FILE_H_

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace thicklens {

// An output file that appears whole or not at all.
//
// The constructor claims the name: it makes a new file ".NAME.RANDOM.part" beside the target and
// locks it, so that an output that cannot be written, or that a second run is writing, is refused
// before any work is done. Commit writes, syncs and renames. Without Commit the destructor removes
// the part file and whatever stood at the target stays as it was. A part file that a killed run has
// left behind is removed. A symbolic link stays one: what it leads to is replaced. The file that is
// replaced leaves its owner, group and permissions, as far as this user may give them, to the new
// one.
//
// A file that cannot be replaced, because it is a mount point or its folder may not be written to,
// is written into at Commit; a full disk then leaves it as it was, too, where the file system can
// reserve space.
class OutputFile {
 public:
  explicit OutputFile(const std::string& path);  // throws Error
  ~OutputFile();
  OutputFile(OutputFile&&) noexcept;
  OutputFile& operator=(OutputFile&&) noexcept;

  void Commit(const std::string& content);  // throws Error, e.g. on a full disk
  const std::string& path() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// The same for a folder: files are written into staging_path(), and Commit puts the folder in
// place, replacing an older one. A folder at the target is replaced only if it is empty, or
// contains `marker_file` (the sign that this program wrote it) and nothing but `own_entries`, where
// these are given; else the constructor and Commit throw Error that names what would be lost. An
// own entry is the name of a file or folder, the folder with all that is in it, or "FOLDER/PATTERN"
// for a folder that holds nothing but files whose names match one of its shell patterns.
//
// A folder that cannot be replaced, because it is a mount point or lies in a folder that may not be
// written to, gets its new content at Commit entry by entry out of a part folder within it: the
// older marker goes first, then the older content; the new marker comes last. "lost+found" in it is
// left alone. What a run has left there that was killed meanwhile is removed by the next.
class OutputFolder {
 public:
  OutputFolder(const std::string& path, const std::string& marker_file,
               const std::vector<std::string>& own_entries = {});
  ~OutputFolder();
  OutputFolder(OutputFolder&&) noexcept;
  OutputFolder& operator=(OutputFolder&&) noexcept;

  const std::string& staging_path() const;
  // Writes one file below the staging folder; `name` may have one folder in front. Throws Error.
  void Write(const std::string& name, const std::string& content);
  // The same for who writes a file himself: calls write(path, name to be shown) and sees to it that
  // what was written reaches the disk.
  void WriteWith(
      const std::string& name,
      const std::function<void(const std::string& path, const std::string& shown)>& write);
  void Commit();
  const std::string& path() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Claims, writes and commits in one step.
void WriteFileAtomically(const std::string& path, const std::string& content);

// The whole content of a file that is an input; throws Error naming the path and the reason. See
// input_file.h for what is refused, and for texts.
std::string ReadWholeFile(const std::string& path);

}  // namespace thicklens

#endif  // THICKLENS_BASE_OUTPUT_FILE_H_

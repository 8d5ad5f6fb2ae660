#ifndef THICKLENS_MODEL_OUTPUT_FILE_H_
#define THICKLENS_MODEL_OUTPUT_FILE_H_

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace thicklens::model {

// An output file that appears whole or not at all.
//
// The constructor claims the name: it creates ".NAME.part" beside the target and locks it, so that
// an unwritable folder or a second run with the same output is told before any work is done. Commit
// writes, syncs and renames. Without Commit the destructor removes the part file and whatever stood
// at the target stays as it was. A part file left by a killed run is taken over.
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

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_OUTPUT_FILE_H_

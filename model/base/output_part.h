#ifndef THICKLENS_MODEL_BASE_OUTPUT_PART_H_
#define THICKLENS_MODEL_BASE_OUTPUT_PART_H_

#include <filesystem>
#include <string>

#include "thicklens/base/temporaries.h"

namespace thicklens {

enum class PartKind { kFile, kFolder };

// The place where an output is made before it gets its name: a new file or folder
// ".STEM.RANDOM.part", which is locked during the lifetime of this object. It is always created,
// never an existing one opened, so that it cannot be a link or a foreign file. Parts with the same
// stem that killed runs left behind have no lock and are removed. If another run has locked such a
// part, the constructor throws Error.
class OutputPart {
 public:
  // `shown` is the name of the output in messages.
  OutputPart(const std::filesystem::path& folder, const std::string& stem, PartKind kind,
             const std::string& shown);
  ~OutputPart();  // removes the part unless it was released
  OutputPart(const OutputPart&) = delete;
  OutputPart& operator=(const OutputPart&) = delete;

  int fd() const { return fd_; }
  const std::string& path() const { return path_; }
  // Throws Error if the part was removed or renamed by another program.
  void RequireThere(const std::string& shown) const;
  // Gives up the part, which now has its final name.
  void Release();

 private:
  std::string path_;
  int fd_ = -1;
  Temporary temporary_;
};

// Returns true if a run of this user that has ended left such a part in the folder.
// If `inner` is not empty, only a part that contains an entry of this name counts.
bool HasLeftOverPart(const std::filesystem::path& folder, const std::string& stem,
                     const std::string& inner = "");
// Removes such parts as far as possible.
void RemoveLeftOverParts(const std::filesystem::path& folder, const std::string& stem);
// Returns true if `name` is the name of a part with that stem.
bool IsPartName(const std::string& name, const std::string& stem);

}  // namespace thicklens

#endif  // THICKLENS_MODEL_BASE_OUTPUT_PART_H_

#ifndef THICKLENS_MODEL_BASE_OUTPUT_PART_H_
#define THICKLENS_MODEL_BASE_OUTPUT_PART_H_

#include <filesystem>
#include <string>

#include "thicklens/base/temporaries.h"

namespace thicklens {

enum class PartKind { kFile, kFolder };

// The place where an output is made before it gets its name: a new file or folder
// ".STEM.RANDOM.part", locked for as long as this lives. It is created, never opened, so that no
// link and nothing of somebody else's can stand in its place. What killed runs left behind with the
// same stem carries no lock and is removed; where another run holds one, the constructor throws
// Error.
class OutputPart {
 public:
  // `shown` is the output, for messages.
  OutputPart(const std::filesystem::path& folder, const std::string& stem, PartKind kind,
             const std::string& shown);
  ~OutputPart();  // removes it, unless it got another name
  OutputPart(const OutputPart&) = delete;
  OutputPart& operator=(const OutputPart&) = delete;

  int fd() const { return fd_; }
  const std::string& path() const { return path_; }
  // Throws Error where somebody has removed or renamed it.
  void RequireThere(const std::string& shown) const;
  // It has its name now.
  void Release();

 private:
  std::string path_;
  int fd_ = -1;
  Temporary temporary_;
};

// Whether a run that this user started, and that no longer lives, has left such a part there.
bool HasLeftOverPart(const std::filesystem::path& folder, const std::string& stem);
// Removes such parts, as far as they can be removed.
void RemoveLeftOverParts(const std::filesystem::path& folder, const std::string& stem);
// Whether the name is one of a part with that stem.
bool IsPartName(const std::string& name, const std::string& stem);

}  // namespace thicklens

#endif  // THICKLENS_MODEL_BASE_OUTPUT_PART_H_

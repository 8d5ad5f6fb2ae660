#ifndef THICKLENS_MODEL_BASE_FOLDER_CONTENT_H_
#define THICKLENS_MODEL_BASE_FOLDER_CONTENT_H_

#include <filesystem>
#include <string>
#include <vector>

namespace thicklens {

// The content that an output folder may have when it is replaced (OutputFolder).
struct FolderContent {
  std::string marker_file;
  std::vector<std::string> own_entries;

  // Throws Error, which names `shown`, unless the folder can be replaced without the loss of
  // foreign content. A missing and an empty folder can be replaced. `in_place`: the new content is
  // written into the folder itself; parts of runs and "lost+found" are then ignored.
  // `without_marker`: the marker is not required, because a killed run of this program left the
  // content.
  void RequireReplaceable(const std::filesystem::path& folder, const std::string& shown,
                          bool in_place, bool without_marker) const;
};

// Stem of the part ".thicklens.RANDOM.part" inside a folder that is being written in place.
extern const char kInnerPartStem[];

// Entries that are removed when such a folder gets new content: all except the parts of runs and
// "lost+found".
std::vector<std::filesystem::path> EntriesInPlace(const std::filesystem::path& folder);

}  // namespace thicklens

#endif  // THICKLENS_MODEL_BASE_FOLDER_CONTENT_H_

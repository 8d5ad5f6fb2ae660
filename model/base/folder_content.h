#ifndef THICKLENS_MODEL_BASE_FOLDER_CONTENT_H_
#define THICKLENS_MODEL_BASE_FOLDER_CONTENT_H_

#include <filesystem>
#include <string>
#include <vector>

namespace thicklens {

// The content that an output folder may have when it is replaced: see OutputFolder.
struct FolderContent {
  std::string marker_file;
  std::vector<std::string> own_entries;

  // Throws Error, which says `shown`, unless replacing that folder loses nothing of anybody else's.
  // A folder that is not there, and an empty one, can be replaced. `in_place`: of a folder that is
  // written into, what is ours for a while does not count, nor does what file systems keep in their
  // roots. `without_marker`: what a killed run of ours has left needs no marker.
  void RequireReplaceable(const std::filesystem::path& folder, const std::string& shown,
                          bool in_place, bool without_marker) const;
};

// The part that a folder which is written into holds while that is done: ".thicklens.RANDOM.part".
extern const char kInnerPartStem[];

// Entries that go when such a folder gets new content: all but the parts of runs and "lost+found".
std::vector<std::filesystem::path> EntriesInPlace(const std::filesystem::path& folder);

}  // namespace thicklens

#endif  // THICKLENS_MODEL_BASE_FOLDER_CONTENT_H_

#ifndef THICKLENS_WATCH_H_
#define THICKLENS_WATCH_H_

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/calib/sweep_progress.h"
#include "thicklens/run.h"
#include "thicklens/sweep.h"

namespace thicklens {

// How a folder is watched into which the frames of a sweep are written. Times are on the clock of
// the caller, s.
struct WatchOptions {
  double settle_s = 1;            // a file is whole if its size has not changed for so long
  double broken_after_s = 10;     // a file that cannot be decoded for so long is left out
  std::optional<double> pause_s;  // the sweep ends if nothing arrives for so long; absent: it waits
  int most_per_look = 8;          // frames that one look measures at most
  double wanted_blur_ratio_error = 0.01;  // SweepProgressOptions

  // Returns whether all members are in their range. Otherwise `why`, if not null, gets the field,
  // the value and the constraint.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// A file that is not a frame of the sweep, and why.
struct LeftOutFile {
  std::string image;   // its path
  std::string reason;  // one line
};

// The findings of one look at the folder.
struct WatchUpdate {
  std::vector<std::size_t> added;     // frames that were measured: indices into `progress.frames`
  std::vector<std::size_t> rejected;  // frames that a check rejects now and did not before
  std::vector<LeftOutFile> left_out;  // files that were given up
  // The findings in the frames so far; as before where nothing was added.
  calib::SweepProgressReport progress;
  std::size_t waiting = 0;     // files that are not whole yet, or have no reading yet
  std::string waiting_reason;  // why the first of them waits; empty if none does
  bool is_ended = false;       // the sweep is complete
  std::string ended_by;        // "the file done", or "a pause of 60 s"
};

// A sweep of the frames in a folder that are still being written, in any order, with a table of
// readings that grows, or with readings in the files or their names. Nothing is printed, and no
// clock is read.
class FolderWatch {
 public:
  // As ReadSweepFolder. The folder must exist; the table and the frames may come later. Throws
  // OptionError and Error.
  THICKLENS_EXPORT FolderWatch(const std::string& folder, const std::string& readings_csv,
                               const SweepOverrides& overrides, const WatchOptions& options,
                               const RunControl& run = {});
  THICKLENS_EXPORT ~FolderWatch();
  FolderWatch(const FolderWatch&) = delete;
  FolderWatch& operator=(const FolderWatch&) = delete;

  // Looks at the folder at a time that does not fall, and measures the frames that are new and
  // whole. A file named "done" in the folder ends the sweep as soon as no file is incomplete.
  // Throws Error for a folder, table or camera that cannot be used at all, and Interrupted.
  THICKLENS_EXPORT WatchUpdate Look(double now_s);

  // Returns the sweep of the frames that were measured, as ReadSweepFolder reads it, with the
  // readings of the last table that was whole. Its notices name the files that were left out, and
  // why. Throws Error if there is no frame, with the reason.
  THICKLENS_EXPORT Sweep Finish() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace thicklens

#endif  // THICKLENS_WATCH_H_

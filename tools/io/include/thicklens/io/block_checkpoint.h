#ifndef THICKLENS_IO_BLOCK_CHECKPOINT_H_
#define THICKLENS_IO_BLOCK_CHECKPOINT_H_

#include <atomic>
#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "thicklens/base/export.h"
#include "thicklens/estimator/block_store.h"
#include "thicklens/io/journal_file.h"

namespace thicklens::io {

// The blocks of `estimate --checkpoint FILE`: a journal whose first record describes the estimate
// as JSON and whose other records hold one block each.
class THICKLENS_EXPORT BlockCheckpoint final : public estimator::BlockStore {
 public:
  // `version` names the program: blocks of another version are not used. `warn` is called once, by
  // Begin, if damaged blocks are left out. Throws Error if the file is not a checkpoint or is in
  // use.
  BlockCheckpoint(const std::string& path, std::string version,
                  std::function<void(const std::string&)> warn = {});
  ~BlockCheckpoint() override;
  BlockCheckpoint(const BlockCheckpoint&) = delete;
  BlockCheckpoint& operator=(const BlockCheckpoint&) = delete;

  // The path as given to the constructor.
  const std::string& path() const { return journal_.path(); }
  // Settings of the run that left blocks in the file: the edge of its blocks, and the --device that
  // computes as it did.
  std::optional<int> block_px() const;
  // The --device that computes as that run did; absent: no run left blocks.
  std::optional<std::string> device() const;
  // Number of blocks that the current run could continue from. The function never blocks: it is
  // called when the process ends, while a disk may delay the thread that keeps a block.
  int kept() const { return kept_; }

  // Throws Error if the file belongs to another estimate, and says what differs.
  void Begin(const estimator::BlockRun& run) override;
  // Returns a block that is in the file; absent: it is not.
  std::optional<estimator::SolvedBlock> Find(int block) override;
  // Appends a solved block to the file.
  void Keep(int block, const estimator::SolvedBlock& solved) override;

  // Call this when the light field is complete. Returns whether the file could be removed.
  bool Remove();

 private:
  void CountKept();                                    // with the mutex held
  std::string Setting(const std::string& name) const;  // of the run that left blocks; empty: none

  JournalFile journal_;
  std::string version_;
  std::function<void(const std::string&)> warn_;
  struct Description;
  std::unique_ptr<Description> there_;  // what that run is of; empty: there was none
  std::string here_;                    // what this one is of; empty: its blocks follow
  mutable std::mutex mutex_;            // of what follows
  bool is_begun_ = false;
  std::map<int, std::size_t> record_of_block_;
  std::atomic<int> kept_{0};
};

}  // namespace thicklens::io

#endif  // THICKLENS_IO_BLOCK_CHECKPOINT_H_

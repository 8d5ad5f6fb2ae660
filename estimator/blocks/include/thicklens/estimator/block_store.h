#ifndef THICKLENS_ESTIMATOR_BLOCK_STORE_H_
#define THICKLENS_ESTIMATOR_BLOCK_STORE_H_

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/estimator/block_solver.h"

namespace thicklens::estimator {

// Everything that the blocks of an estimate depend on, except the program itself. Two runs with
// equal contents have the same blocks, to the bit.
struct BlockRun {
  // Settings as (name, value), in the order in which a difference should be reported.
  std::vector<std::pair<std::string, std::string>> settings;
  // Bulk numbers as they lie in memory. The views are valid until Begin returns.
  struct Data {
    std::string name;                     // what the numbers are, for messages
    std::vector<std::string_view> bytes;  // parts that follow each other
  };
  std::vector<Data> data;  // all numbers of the problem
  int blocks = 0;          // number of blocks
};

// Radiance of the rays of one block, as EstimateByBlocks finds it.
struct SolvedBlock {
  BlockReport report;  // how the block was solved
  // One vector for each channel, of report.unknowns numbers. The light field holds these numbers as
  // floats, so a store may keep them as floats.
  std::vector<std::vector<double>> channels;
};

// Keeps the blocks of a long run, so that another run can continue where the first one was
// interrupted. An exception of a member function ends the estimate.
class THICKLENS_EXPORT BlockStore {
 public:
  virtual ~BlockStore() = default;
  // Called once, before all blocks.
  virtual void Begin(const BlockRun& run) = 0;
  // Find and Keep are called from any thread, several at a time. Blocks are numbered row by row.
  virtual std::optional<SolvedBlock> Find(int block) = 0;
  // Stores a solved block; see Find.
  virtual void Keep(int block, const SolvedBlock& solved) = 0;
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_BLOCK_STORE_H_

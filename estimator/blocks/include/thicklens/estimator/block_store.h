#ifndef THICKLENS_ESTIMATOR_BLOCK_STORE_H_
#define THICKLENS_ESTIMATOR_BLOCK_STORE_H_

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "thicklens/estimator/block_solver.h"

namespace thicklens::estimator {

// All that the blocks of an estimate depend on, but the program itself. Two runs that agree in it
// have the same blocks, to the bit.
struct BlockRun {
  // In the order in which a difference is worth telling, as (name, value).
  std::vector<std::pair<std::string, std::string>> settings;
  // The numbers that are too many for words, as they lie in memory; seen until Begin returns.
  struct Data {
    std::string name;
    std::vector<std::string_view> bytes;
  };
  std::vector<Data> data;
  int blocks = 0;
};

// Radiance of a block's rays, as EstimateByBlocks finds it.
struct SolvedBlock {
  BlockReport report;
  // One vector a channel, of report.unknowns numbers. The light field holds them as floats: whoever
  // keeps them need not keep more.
  std::vector<std::vector<double>> channels;
};

// Keeps the blocks of a long run, so that another run goes on where it was interrupted. What it
// throws ends the estimate.
class BlockStore {
 public:
  virtual ~BlockStore() = default;
  // Once, before all blocks.
  virtual void Begin(const BlockRun& run) = 0;
  // From any thread, several at a time. Blocks are numbered row by row.
  virtual std::optional<SolvedBlock> Find(int block) = 0;
  virtual void Keep(int block, const SolvedBlock& solved) = 0;
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_BLOCK_STORE_H_

#ifndef THICKLENS_ESTIMATOR_BLOCKS_FACTOR_MEMORY_H_
#define THICKLENS_ESTIMATOR_BLOCKS_FACTOR_MEMORY_H_

#include <cstddef>
#include <optional>
#include <vector>

namespace thicklens::estimator {

// What SuiteSparse gives back after one factorization, kept for the next one of the same solver.
// UMFPACK takes its fronts from the system for each matrix anew, and the pages that come with them:
// where page faults are dear, as in virtual machines, they are more than half of its time.
//
// For one thread at a time.
class FactorMemory {
 public:
  FactorMemory() = default;
  ~FactorMemory();
  FactorMemory(const FactorMemory&) = delete;
  FactorMemory& operator=(const FactorMemory&) = delete;

  // While it lives, what SuiteSparse takes and gives back in this thread goes through the memory:
  // pieces below kSmallest bytes to and from the system, as all do elsewhere. They are the system's
  // own, so that what was taken inside may be given back outside, and the other way round. Does
  // nothing where SuiteSparse has been given functions of somebody else's.
  class Use {
   public:
    explicit Use(FactorMemory* memory);
    ~Use();
    Use(const Use&) = delete;
    Use& operator=(const Use&) = delete;

   private:
    FactorMemory* before_;
  };

  static constexpr std::size_t kSmallest = 64 * 1024;
  // A piece serves what needs at least a quarter of it.
  static constexpr std::size_t kMostSpare = 4;

  std::size_t kept_bytes() const;

  // As malloc, realloc and free.
  void* Take(std::size_t bytes);
  void* Resize(void* piece, std::size_t bytes);
  void Give(void* piece);

 private:
  struct Piece {
    void* start;
    std::size_t bytes;
  };

  // The smallest piece that fits; absent: none does, and those that are too small are gone.
  std::optional<void*> TakeKept(std::size_t bytes);
  // Once more without what is kept, where there is no memory.
  template <typename Ask>
  void* OfTheSystem(const Ask& ask);
  void FreeFrom(std::vector<Piece>::iterator first);

  std::vector<Piece> kept_;
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_BLOCKS_FACTOR_MEMORY_H_

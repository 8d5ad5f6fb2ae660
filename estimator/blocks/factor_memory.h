#ifndef THICKLENS_ESTIMATOR_BLOCKS_FACTOR_MEMORY_H_
#define THICKLENS_ESTIMATOR_BLOCKS_FACTOR_MEMORY_H_

#include <cstddef>
#include <optional>
#include <vector>

namespace thicklens::estimator {

// Keeps the memory that SuiteSparse frees after one factorisation for the next one of the same
// solver. For each matrix UMFPACK allocates its fronts from the system again, with new pages; where
// page faults are expensive, as in virtual machines, they take more than half of its time.
//
// Use an object in one thread at a time.
class FactorMemory {
 public:
  FactorMemory() = default;
  ~FactorMemory();
  FactorMemory(const FactorMemory&) = delete;
  FactorMemory& operator=(const FactorMemory&) = delete;

  // While an object of this class exists, the allocations of SuiteSparse in this thread go through
  // the memory. Pieces below kSmallest bytes come from and go to the system, as all pieces do
  // elsewhere. All pieces are the system's own, so a piece taken inside may be freed outside, and
  // the other way round. The class does nothing if SuiteSparse already has allocation functions of
  // another owner.
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
  // A kept piece may serve a request for at least a quarter of its size.
  static constexpr std::size_t kMaxSpare = 4;

  std::size_t kept_bytes() const;

  // These functions act as malloc, realloc and free.
  void* Take(std::size_t bytes);
  void* Resize(void* piece, std::size_t bytes);
  void Give(void* piece);

 private:
  struct Piece {
    void* start;
    std::size_t bytes;
  };

  // Returns the smallest kept piece that fits. Absent if none fits; the pieces that are too small
  // are then freed.
  std::optional<void*> TakeKept(std::size_t bytes);
  // Asks the system; if it has no memory, frees the kept pieces and asks once more.
  template <typename Ask>
  void* OfTheSystem(const Ask& ask);
  void FreeFrom(std::vector<Piece>::iterator first);

  std::vector<Piece> kept_;
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_BLOCKS_FACTOR_MEMORY_H_

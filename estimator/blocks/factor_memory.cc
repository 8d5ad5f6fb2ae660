#include "estimator/blocks/factor_memory.h"

#include <SuiteSparse_config.h>
#include <malloc.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <new>
#include <optional>

namespace thicklens::estimator {
namespace {

thread_local FactorMemory* of_this_thread = nullptr;

void* TakeHere(std::size_t bytes) {
  return of_this_thread != nullptr ? of_this_thread->Take(bytes) : std::malloc(bytes);
}

void* TakeZerosHere(std::size_t count, std::size_t bytes) {
  if (of_this_thread == nullptr) return std::calloc(count, bytes);
  std::size_t all = 0;
  if (__builtin_mul_overflow(count, bytes, &all)) return nullptr;
  // Small pieces come from the system, which knows which memory is already zero.
  if (all < FactorMemory::kSmallest) return std::calloc(count, bytes);
  void* const piece = of_this_thread->Take(all);
  return piece == nullptr ? nullptr : std::memset(piece, 0, all);
}

void* ResizeHere(void* piece, std::size_t bytes) {
  return of_this_thread != nullptr ? of_this_thread->Resize(piece, bytes)
                                   : std::realloc(piece, bytes);
}

void GiveHere(void* piece) {
  if (of_this_thread != nullptr) {
    of_this_thread->Give(piece);
  } else {
    std::free(piece);
  }
}

// Installs the functions once, unless functions of another owner are in place.
void Install() {
  static std::once_flag once;
  std::call_once(once, [] {
#if SUITESPARSE_MAIN_VERSION >= 7
    if (SuiteSparse_config_malloc_func_get() != std::malloc ||
        SuiteSparse_config_calloc_func_get() != std::calloc ||
        SuiteSparse_config_realloc_func_get() != std::realloc ||
        SuiteSparse_config_free_func_get() != std::free) {
      return;
    }
    SuiteSparse_config_malloc_func_set(TakeHere);
    SuiteSparse_config_calloc_func_set(TakeZerosHere);
    SuiteSparse_config_realloc_func_set(ResizeHere);
    SuiteSparse_config_free_func_set(GiveHere);
#else
    auto& functions = SuiteSparse_config;
    if (functions.malloc_func != std::malloc || functions.calloc_func != std::calloc ||
        functions.realloc_func != std::realloc || functions.free_func != std::free) {
      return;
    }
    functions.malloc_func = TakeHere;
    functions.calloc_func = TakeZerosHere;
    functions.realloc_func = ResizeHere;
    functions.free_func = GiveHere;
#endif
  });
}

}  // namespace

FactorMemory::Use::Use(FactorMemory* memory) : before_(of_this_thread) {
  Install();
  of_this_thread = memory;
}

FactorMemory::Use::~Use() { of_this_thread = before_; }

FactorMemory::~FactorMemory() { FreeFrom(kept_.begin()); }

void FactorMemory::FreeFrom(std::vector<Piece>::iterator first) {
  std::for_each(first, kept_.end(), [](const Piece& piece) { std::free(piece.start); });
  kept_.erase(first, kept_.end());
}

std::size_t FactorMemory::kept_bytes() const {
  std::size_t bytes = 0;
  for (const Piece& piece : kept_) bytes += piece.bytes;
  return bytes;
}

std::optional<void*> FactorMemory::TakeKept(std::size_t bytes) {
  const auto fits = [&](const Piece& piece) {
    return piece.bytes >= bytes && piece.bytes / kMaxSpare <= bytes;
  };
  auto best = kept_.end();
  for (auto piece = kept_.begin(); piece != kept_.end(); ++piece) {
    if (fits(*piece) && (best == kept_.end() || piece->bytes < best->bytes)) best = piece;
  }
  if (best != kept_.end()) {
    void* const start = best->start;
    kept_.erase(best);
    return start;
  }
  // A piece that is too small now will be too small again: kept beside its successors, it would add
  // up.
  FreeFrom(std::partition(kept_.begin(), kept_.end(),
                          [&](const Piece& piece) { return piece.bytes >= bytes; }));
  return std::nullopt;
}

template <typename Ask>
void* FactorMemory::OfTheSystem(const Ask& ask) {
  void* const start = ask();
  if (start != nullptr || kept_.empty()) return start;
  FreeFrom(kept_.begin());
  return ask();
}

void* FactorMemory::Take(std::size_t bytes) {
  if (bytes >= kSmallest) {
    if (const auto kept = TakeKept(bytes)) return *kept;
  }
  return OfTheSystem([&] { return std::malloc(bytes); });
}

void* FactorMemory::Resize(void* piece, std::size_t bytes) {
  if (piece == nullptr) return Take(bytes);
  const std::size_t now = ::malloc_usable_size(piece);
  // The end of the piece is not returned, because it will be needed again.
  if (now >= kSmallest && bytes <= now) return piece;
  if (bytes >= kSmallest) {
    if (const auto kept = TakeKept(bytes)) {
      std::memcpy(*kept, piece, std::min(now, bytes));
      Give(piece);
      return *kept;
    }
  }
  // The system moves pages; two pieces and a copy would take twice the memory.
  return OfTheSystem([&] { return std::realloc(piece, bytes); });
}

void FactorMemory::Give(void* piece) {
  const std::size_t bytes = piece == nullptr ? 0 : ::malloc_usable_size(piece);
  if (bytes < kSmallest) {
    std::free(piece);
    return;
  }
  try {
    kept_.push_back({piece, bytes});
  } catch (const std::bad_alloc&) {
    std::free(piece);
  }
}

}  // namespace thicklens::estimator

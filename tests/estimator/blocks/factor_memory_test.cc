#include "estimator/blocks/factor_memory.h"

#include <SuiteSparse_config.h>
#include <gtest/gtest.h>
#include <malloc.h>
#include <sys/resource.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "estimator/blocks/linear_solver.h"
#include "support/sanitizers.h"

namespace thicklens::estimator {
namespace {

constexpr std::size_t kPiece = 4 * FactorMemory::kSmallest;

// The names that SuiteSparse's libraries use.
std::uint8_t* Take(std::size_t bytes) {
  return static_cast<std::uint8_t*>(SuiteSparse_malloc(bytes, 1));
}

TEST(FactorMemory, ServesTheNextOfTheSameSize) {
  FactorMemory memory;
  const FactorMemory::Use use(&memory);
  std::uint8_t* const first = Take(kPiece);
  EXPECT_EQ(memory.kept_bytes(), 0U);
  SuiteSparse_free(first);
  EXPECT_GE(memory.kept_bytes(), kPiece);
  std::uint8_t* const somewhat_less = Take(kPiece - 100);
  EXPECT_EQ(somewhat_less, first);
  EXPECT_EQ(memory.kept_bytes(), 0U);
  SuiteSparse_free(somewhat_less);
}

TEST(FactorMemory, OfTwoThatFitTheSmaller) {
  FactorMemory memory;
  const FactorMemory::Use use(&memory);
  std::uint8_t* const large = Take(2 * kPiece);
  std::uint8_t* const small = Take(kPiece);
  SuiteSparse_free(large);
  SuiteSparse_free(small);
  std::uint8_t* const again = Take(kPiece - 1);
  EXPECT_EQ(again, small);
  SuiteSparse_free(again);
}

TEST(FactorMemory, WhatIsTooSmallIsNotKeptBesideWhatTakesItsPlace) {
  FactorMemory memory;
  const FactorMemory::Use use(&memory);
  for (const std::size_t pieces : {1, 2, 3, 4, 5}) SuiteSparse_free(Take(pieces * kPiece));
  EXPECT_LT(memory.kept_bytes(), 6 * kPiece);
}

TEST(FactorMemory, WhatIsMuchTooLargeWaitsForItsLike) {
  FactorMemory memory;
  const FactorMemory::Use use(&memory);
  std::uint8_t* const large = Take(16 * kPiece);
  SuiteSparse_free(large);
  std::uint8_t* const small = Take(kPiece);
  EXPECT_NE(small, large);
  SuiteSparse_free(small);
  std::uint8_t* const again = Take(16 * kPiece);
  EXPECT_EQ(again, large);
  SuiteSparse_free(again);
}

TEST(FactorMemory, KeepsWhatIsWrittenThroughEachChangeOfSize) {
  FactorMemory memory;
  const FactorMemory::Use use(&memory);
  const auto byte = [](std::size_t i) { return static_cast<std::uint8_t>(i * 31 + i / 256); };
  std::size_t filled = 1000;
  std::uint8_t* piece = Take(filled);
  std::generate_n(piece, filled, [&, i = std::size_t{0}]() mutable { return byte(i++); });
  // Sizes below and above the limit of what is kept grow and shrink, by little and by much.
  for (const std::size_t bytes : {2000 * std::size_t{1}, kPiece, 3 * kPiece, 2 * kPiece,
                                  30 * kPiece, kPiece, std::size_t{1500}, 2 * kPiece}) {
    int done = 0;
    piece = static_cast<std::uint8_t*>(SuiteSparse_realloc(bytes, filled, 1, piece, &done));
    ASSERT_EQ(done, 1);
    for (std::size_t i = 0; i < std::min(bytes, filled); ++i) ASSERT_EQ(piece[i], byte(i)) << bytes;
    for (std::size_t i = filled; i < bytes; ++i) piece[i] = byte(i);
    filled = bytes;
  }
  SuiteSparse_free(piece);
}

TEST(FactorMemory, ZerosAreZerosAgain) {
  FactorMemory memory;
  const FactorMemory::Use use(&memory);
  std::uint8_t* const dirty = Take(kPiece);
  std::fill_n(dirty, kPiece, std::uint8_t{255});
  SuiteSparse_free(dirty);
  auto* const zeros = static_cast<std::uint8_t*>(SuiteSparse_calloc(kPiece, 1));
  EXPECT_EQ(zeros, dirty);
  EXPECT_TRUE(std::all_of(zeros, zeros + kPiece, [](std::uint8_t byte) { return byte == 0; }));
  SuiteSparse_free(zeros);
}

TEST(FactorMemory, IsForItsOwnUseAlone) {
  FactorMemory outer, inner;
  std::uint8_t* taken_inside = nullptr;
  std::uint8_t* const taken_outside = Take(kPiece);
  {
    const FactorMemory::Use use(&outer);
    {
      const FactorMemory::Use other_use(&inner);
      taken_inside = Take(kPiece);
      SuiteSparse_free(taken_outside);
    }
    EXPECT_GE(inner.kept_bytes(), kPiece);
    SuiteSparse_free(Take(2 * kPiece));
    EXPECT_GE(outer.kept_bytes(), 2 * kPiece);
  }
  const std::size_t kept = outer.kept_bytes() + inner.kept_bytes();
  SuiteSparse_free(taken_inside);
  SuiteSparse_free(Take(kPiece));
  EXPECT_EQ(outer.kept_bytes() + inner.kept_bytes(), kept);
}

TEST(FactorMemory, GrowsWithoutASecondPieceWhereNoneIsKept) {
  FactorMemory memory;
  const FactorMemory::Use use(&memory);
  int done = 0;
  void* const piece = SuiteSparse_realloc(3 * kPiece, kPiece, 1, Take(kPiece), &done);
  EXPECT_EQ(done, 1);
  EXPECT_EQ(memory.kept_bytes(), 0U);
  SuiteSparse_free(piece);
}

TEST(FactorMemory, WhatCannotBeHadLeavesThePieceAndGivesUpWhatIsKept) {
  if (testing::kIsSanitized) GTEST_SKIP() << "the sanitizer ends the program";
  constexpr std::size_t kTooMuch = SIZE_MAX / 2;
  FactorMemory memory;
  void* const kept = memory.Take(2 * kPiece);
  auto* const piece = static_cast<std::uint8_t*>(memory.Take(kPiece));
  piece[kPiece - 1] = 7;
  memory.Give(kept);
  EXPECT_EQ(memory.Resize(piece, kTooMuch), nullptr);
  EXPECT_EQ(piece[kPiece - 1], 7);
  EXPECT_EQ(memory.kept_bytes(), 0U);
  EXPECT_EQ(memory.Take(kTooMuch), nullptr);
  memory.Give(piece);
}

long PageFaults() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_minflt;
}

TEST(FactorMemory, UmfpackTakesFewNewPagesForTheNextMatrix) {
  if (testing::kIsSanitized) GTEST_SKIP() << "the sanitizer has memory of its own";
  // The pieces are larger than what the system's allocator keeps by itself.
  ASSERT_EQ(mallopt(M_MMAP_THRESHOLD, 64 * 1024), 1);
  ASSERT_EQ(mallopt(M_TRIM_THRESHOLD, 64 * 1024), 1);
  kernels::CsrMatrix<double> band;
  band.rows = band.columns = 3000;
  band.row_start.push_back(0);
  for (int row = 0; row < band.rows; ++row) {
    for (int column = std::max(0, row - 60); column < std::min(band.rows, row + 61); ++column) {
      band.column.push_back(column);
      band.value.push_back(row == column ? 100 : 1.0 / (1 + (row * 31 + column * 17) % 7));
    }
    band.row_start.push_back(static_cast<std::int64_t>(band.column.size()));
  }
  const std::unique_ptr<LinearSolver> solver = NewLinearSolver(BlockSolver::kUmfpack, false);
  const auto faults_of_a_factorization = [&] {
    const long before = PageFaults();
    solver->Factorize(band);
    return PageFaults() - before;
  };
  const long first = faults_of_a_factorization();
  EXPECT_GT(first, 1000);
  // The solver's own copies of the matrix are of the system.
  EXPECT_LT(faults_of_a_factorization(), first / 2);
  EXPECT_LT(faults_of_a_factorization(), first / 2);
}

}  // namespace
}  // namespace thicklens::estimator

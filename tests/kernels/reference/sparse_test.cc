#include "thicklens/kernels/sparse.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "support/error_message.h"
#include "support/kernel_samples.h"

namespace thicklens::kernels {
namespace {

using ::thicklens::testing::DenseOf;
using ::thicklens::testing::ErrorOf;
using ::thicklens::testing::RandomCsr;

template <typename Matrix>
void ExpectSorted(const Matrix& matrix) {
  ASSERT_EQ(matrix.row_start.size(), static_cast<std::size_t>(matrix.rows) + 1);
  ASSERT_EQ(matrix.row_start.front(), 0);
  ASSERT_EQ(static_cast<std::size_t>(matrix.entries()), matrix.column.size());
  for (std::size_t row = 0; row + 1 < matrix.row_start.size(); ++row) {
    for (auto e = matrix.row_start[row] + 1; e < matrix.row_start[row + 1]; ++e) {
      const auto i = static_cast<std::size_t>(e);
      EXPECT_LT(matrix.column[i - 1], matrix.column[i]) << "row " << row;
    }
  }
}

// Makes rows in any order, in which columns occur twice or more, slots are unused anywhere, and
// rows are empty.
EllMatrix<double> ShuffledEll(int rows, int columns, int slots, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<int> column(-1, columns - 1);
  std::uniform_int_distribution<int> value(-8, 8);
  EllMatrix<double> ell{rows, columns, slots, {}, {}};
  for (int slot = 0; slot < slots; ++slot) {
    for (int row = 0; row < rows; ++row) {
      ell.column.push_back(row % 4 == 3 ? -1 : column(random));
      ell.value.push_back(value(random));
    }
  }
  return ell;
}

TEST(SparseTest, CompressionSortsAndAddsUp) {
  // 2 rows of 3 slots, (2: 5, 0: 7, 2: 1) and (unused, 1: 3, unused), are stored slot by slot.
  const EllMatrix<float> ell{2, 3, 3, {2, -1, 0, 1, 2, -1}, {5, 9, 7, 3, 1, 9}};
  const CsrMatrix<float> csr = Compress(ell);
  EXPECT_EQ(csr.rows, 2);
  EXPECT_EQ(csr.columns, 3);
  EXPECT_EQ(csr.row_start, (std::vector<std::int64_t>{0, 2, 3}));
  EXPECT_EQ(csr.column, (std::vector<std::int32_t>{0, 2, 1}));
  EXPECT_EQ(csr.value, (std::vector<float>{7, 6, 3}));
}

TEST(SparseTest, CompressionIsTheSameMatrix) {
  for (std::uint32_t seed = 0; seed < 20; ++seed) {
    // If there is one slot, the last column of a row is often the first one of the next row.
    for (const int slots : {1, 2, 9}) {
      const EllMatrix<double> ell = ShuffledEll(13, 6, slots, seed);
      const CsrMatrix<double> csr = Compress(ell);
      ExpectSorted(csr);
      EXPECT_EQ(DenseOf(csr), DenseOf(ell));
      EXPECT_EQ(csr.row_start[3], csr.row_start[4]) << "row 3 is empty";
    }
  }
}

TEST(SparseTest, TransposeIsTheTransposedMatrix) {
  for (std::uint32_t seed = 0; seed < 20; ++seed) {
    const CsrMatrix<double> a = RandomCsr<double>(11, 7, 0.3, seed);
    const CsrMatrix<double> a_t = Transpose(a);
    ExpectSorted(a_t);
    EXPECT_EQ(a_t.rows, 7);
    EXPECT_EQ(a_t.columns, 11);
    EXPECT_EQ(DenseOf(a_t), DenseOf(a).transpose());
  }
}

TEST(SparseTest, NormalPatternIsWhereTheProductAndTheDiagonalAre) {
  for (std::uint32_t seed = 0; seed < 20; ++seed) {
    const CsrMatrix<double> a = RandomCsr<double>(9, 12, 0.15, seed);
    const CsrPattern pattern = NormalPattern(a);
    ExpectSorted(pattern);
    // A pattern has no values, so its entries cannot cancel.
    const Eigen::MatrixXi present = DenseOf(PatternOf(a));
    const Eigen::MatrixXi product =
        present.transpose() * present + Eigen::MatrixXi::Identity(12, 12);
    EXPECT_EQ(DenseOf(pattern), product.cwiseMin(1));
  }
}

TEST(SparseTest, SumPatternIsTheUnion) {
  for (std::uint32_t seed = 0; seed < 20; ++seed) {
    const CsrPattern a = PatternOf(RandomCsr<float>(8, 5, 0.3, seed));
    const CsrPattern b = PatternOf(RandomCsr<float>(8, 5, 0.4, seed + 100));
    const CsrPattern sum = SumPattern(a, b);
    ExpectSorted(sum);
    EXPECT_EQ(DenseOf(sum), (DenseOf(a) + DenseOf(b)).cwiseMin(1));
  }
}

TEST(SparseTest, SmallestMatrices) {
  const CsrMatrix<float> one = Compress(EllMatrix<float>{1, 1, 2, {0, 0}, {2, 3}});
  EXPECT_EQ(one.entries(), 1);
  EXPECT_EQ(one.value, std::vector<float>{5});
  EXPECT_EQ(Transpose(one).value, std::vector<float>{5});
  EXPECT_EQ(NormalPattern(one).entries(), 1);

  const CsrMatrix<float> no_entry = Compress(EllMatrix<float>{1, 1, 1, {-1}, {2}});
  EXPECT_EQ(no_entry.entries(), 0);
  EXPECT_EQ(NormalPattern(no_entry).entries(), 1) << "the diagonal";

  const CsrMatrix<double> no_rows = Compress(EllMatrix<double>{0, 4, 3, {}, {}});
  EXPECT_EQ(no_rows.entries(), 0);
  EXPECT_EQ(Transpose(no_rows).rows, 4);
  EXPECT_EQ(Transpose(no_rows).entries(), 0);
  EXPECT_EQ(NormalPattern(no_rows).entries(), 4);

  const CsrMatrix<double> nothing;
  EXPECT_EQ(Transpose(nothing).entries(), 0);
  EXPECT_EQ(NormalPattern(nothing).entries(), 0);
  EXPECT_EQ(SumPattern(PatternOf(nothing), PatternOf(nothing)).entries(), 0);
}

TEST(SparseTest, WrongSizesAreNamed) {
  EXPECT_EQ(ErrorOf([] {
              Compress(EllMatrix<float>{2, 3, 1, {0}, {1}});
            }),
            "sparse matrix of 2 rows, 3 columns and 1 slots has 1 column numbers and 1 values: "
            "both must be rows times slots");
  EXPECT_EQ(ErrorOf([] {
              Compress(EllMatrix<float>{1, 3, 1, {3}, {1}});
            }),
            "sparse matrix of 3 columns has an entry in column 3: it must be -1 (unused) to 2");
  EXPECT_EQ(ErrorOf([] {
              Compress(EllMatrix<float>{1, 3, 1, {-2}, {1}});
            }),
            "sparse matrix of 3 columns has an entry in column -2: it must be -1 (unused) to 2");
  EXPECT_EQ(ErrorOf([] {
              SumPattern(PatternOf(RandomCsr<float>(2, 3, 1, 0)),
                         PatternOf(RandomCsr<float>(3, 2, 1, 0)));
            }),
            "patterns of 2 x 3 and 3 x 2 entries are added: their sizes must be equal");
}

}  // namespace
}  // namespace thicklens::kernels

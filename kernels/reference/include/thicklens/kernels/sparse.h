#ifndef THICKLENS_KERNELS_SPARSE_H_
#define THICKLENS_KERNELS_SPARSE_H_

#include <cstddef>
#include <cstdint>
#include <vector>

#include "thicklens/base/export.h"

namespace thicklens::kernels {

// A sparse matrix with a fixed number of slots per row. Kernels fill it with one item per row or
// per slot, without a search; neighbouring items write neighbouring addresses. Entry (row, slot) is
// at slot * rows + row; column -1 marks an unused slot.
template <typename Real>
struct EllMatrix {
  int rows = 0;
  int columns = 0;
  int slots = 0;
  std::vector<std::int32_t> column;
  std::vector<Real> value;
};

// Compressed rows; columns ascend within a row, without duplicates.
template <typename Real>
struct CsrMatrix {
  int rows = 0;
  int columns = 0;
  std::vector<std::int64_t> row_start;  // rows + 1 numbers
  std::vector<std::int32_t> column;
  std::vector<Real> value;

  std::int64_t entries() const { return row_start.empty() ? 0 : row_start.back(); }
};

// The positions of the entries of a matrix, without values.
struct CsrPattern {
  int rows = 0;
  int columns = 0;
  std::vector<std::int64_t> row_start;
  std::vector<std::int32_t> column;

  std::int64_t entries() const { return row_start.empty() ? 0 : row_start.back(); }
};

// Removes unused slots and sorts each row; entries of the same column are added.
template <typename Real>
THICKLENS_EXPORT CsrMatrix<Real> Compress(const EllMatrix<Real>& ell);

template <typename Real>
THICKLENS_EXPORT CsrMatrix<Real> Transpose(const CsrMatrix<Real>& matrix);

// Returns the pattern of A^T A + Id: symmetric, with the whole diagonal.
template <typename Real>
THICKLENS_EXPORT CsrPattern NormalPattern(const CsrMatrix<Real>& a);
template <typename Real>
THICKLENS_EXPORT CsrPattern PatternOf(const CsrMatrix<Real>& a);
// Returns the union of two patterns of the same size. Throws Error if the sizes differ.
THICKLENS_EXPORT CsrPattern SumPattern(const CsrPattern& a, const CsrPattern& b);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_SPARSE_H_

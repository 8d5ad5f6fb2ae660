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
  int rows = 0;                      // number of rows
  int columns = 0;                   // number of columns
  int slots = 0;                     // slots of each row
  std::vector<std::int32_t> column;  // rows * slots numbers; -1: unused
  std::vector<Real> value;           // rows * slots numbers
};

// Compressed rows; columns ascend within a row, without duplicates.
template <typename Real>
struct CsrMatrix {
  int rows = 0;                         // number of rows
  int columns = 0;                      // number of columns
  std::vector<std::int64_t> row_start;  // rows + 1 numbers
  std::vector<std::int32_t> column;     // column of each entry
  std::vector<Real> value;              // value of each entry

  // Number of stored entries.
  std::int64_t entries() const { return row_start.empty() ? 0 : row_start.back(); }
};

// The positions of the entries of a matrix, without values.
struct CsrPattern {
  int rows = 0;                         // number of rows
  int columns = 0;                      // number of columns
  std::vector<std::int64_t> row_start;  // rows + 1 numbers
  std::vector<std::int32_t> column;     // column of each entry, ascending in a row

  // Number of entries.
  std::int64_t entries() const { return row_start.empty() ? 0 : row_start.back(); }
};

// Removes unused slots and sorts each row; entries of the same column are added.
template <typename Real>
THICKLENS_EXPORT CsrMatrix<Real> Compress(const EllMatrix<Real>& ell);

// Returns A^T.
template <typename Real>
THICKLENS_EXPORT CsrMatrix<Real> Transpose(const CsrMatrix<Real>& matrix);

// Returns the pattern of A^T A + Id: symmetric, with the whole diagonal.
template <typename Real>
THICKLENS_EXPORT CsrPattern NormalPattern(const CsrMatrix<Real>& a);
// Returns the positions of the stored entries of A.
template <typename Real>
THICKLENS_EXPORT CsrPattern PatternOf(const CsrMatrix<Real>& a);
// Returns the union of two patterns of the same size. Throws Error if the sizes differ.
THICKLENS_EXPORT CsrPattern SumPattern(const CsrPattern& a, const CsrPattern& b);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_SPARSE_H_

#include "thicklens/kernels/sparse.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <utility>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/index.h"

namespace thicklens::kernels {
namespace {

template <typename Real>
void CheckEll(const EllMatrix<Real>& ell) {
  const bool counts_fit = ell.rows >= 0 && ell.columns >= 0 && ell.slots >= 0;
  const std::size_t entries = counts_fit ? Index(ell.rows) * Index(ell.slots) : 0;
  if (!counts_fit || ell.column.size() != entries || ell.value.size() != entries) {
    throw Error(fmt::format(
        "sparse matrix of {} rows, {} columns and {} slots has {} column numbers and {} values: "
        "both must be rows times slots",
        ell.rows, ell.columns, ell.slots, ell.column.size(), ell.value.size()));
  }
  for (const std::int32_t column : ell.column) {
    if (column < -1 || column >= ell.columns) {
      throw Error(fmt::format(
          "sparse matrix of {} columns has an entry in column {}: it must be -1 (unused) to {}",
          ell.columns, column, ell.columns - 1));
    }
  }
}

// Converts the column counts in start[1 ...] to the starts of the rows.
void SumUp(std::vector<std::int64_t>* start) {
  for (std::size_t i = 1; i < start->size(); ++i) (*start)[i] += (*start)[i - 1];
}

// Sorts the entries [begin, end) by column, keeping the order of equal ones, adds entries of the
// same column, and moves the row to `to`. Returns its new end. The insertion sort is fast because
// rows from kernels are nearly sorted.
template <typename Real>
std::int64_t SortRow(std::int64_t begin, std::int64_t end, std::int64_t to,
                     std::vector<std::int32_t>* columns, std::vector<Real>* values) {
  for (std::int64_t e = begin + 1; e < end; ++e) {
    const std::int32_t column = (*columns)[Index(e)];
    const Real value = (*values)[Index(e)];
    std::int64_t hole = e;
    for (; hole > begin && (*columns)[Index(hole - 1)] > column; --hole) {
      (*columns)[Index(hole)] = (*columns)[Index(hole - 1)];
      (*values)[Index(hole)] = (*values)[Index(hole - 1)];
    }
    (*columns)[Index(hole)] = column;
    (*values)[Index(hole)] = value;
  }
  const std::int64_t start = to;
  for (std::int64_t e = begin; e < end; ++e) {
    if (to > start && (*columns)[Index(to - 1)] == (*columns)[Index(e)]) {
      (*values)[Index(to - 1)] += (*values)[Index(e)];
      continue;
    }
    (*columns)[Index(to)] = (*columns)[Index(e)];
    (*values)[Index(to)] = (*values)[Index(e)];
    ++to;
  }
  return to;
}

// Returns the positions of the entries of the transposed matrix. Calls moved(e, to) for each entry
// e that moves to `to`.
template <typename Moved>
CsrPattern TransposePattern(int rows, int columns, const std::vector<std::int64_t>& row_start,
                            const std::vector<std::int32_t>& column, const Moved& moved) {
  CsrPattern transposed;
  transposed.rows = columns;
  transposed.columns = rows;
  transposed.row_start.assign(Index(columns) + 1, 0);
  for (const std::int32_t c : column) ++transposed.row_start[Index(c) + 1];
  SumUp(&transposed.row_start);
  transposed.column.resize(column.size());
  std::vector<std::int64_t> next(transposed.row_start.begin(), transposed.row_start.end() - 1);
  for (int row = 0; row < rows; ++row) {
    ThrowIfCancelled();
    for (std::int64_t e = row_start[Index(row)]; e < row_start[Index(row) + 1]; ++e) {
      const std::int64_t to = next[Index(column[Index(e)])]++;
      transposed.column[Index(to)] = row;
      moved(e, to);
    }
  }
  return transposed;
}

}  // namespace

template <typename Real>
CsrMatrix<Real> Compress(const EllMatrix<Real>& ell) {
  CheckEll(ell);
  CsrMatrix<Real> csr;
  csr.rows = ell.rows;
  csr.columns = ell.columns;
  csr.row_start.assign(Index(ell.rows) + 1, 0);
  std::size_t e = 0;
  for (int slot = 0; slot < ell.slots; ++slot) {
    for (int row = 0; row < ell.rows; ++row, ++e) {
      if (ell.column[e] >= 0) ++csr.row_start[Index(row) + 1];
    }
  }
  SumUp(&csr.row_start);

  csr.column.resize(Index(csr.entries()));
  csr.value.resize(Index(csr.entries()));
  std::vector<std::int64_t> next(csr.row_start.begin(), csr.row_start.end() - 1);
  e = 0;
  for (int slot = 0; slot < ell.slots; ++slot) {
    for (int row = 0; row < ell.rows; ++row, ++e) {
      if (ell.column[e] < 0) continue;
      const std::size_t to = Index(next[Index(row)]++);
      csr.column[to] = ell.column[e];
      csr.value[to] = ell.value[e];
    }
  }

  std::int64_t begin = 0;
  std::int64_t to = 0;
  for (int row = 0; row < ell.rows; ++row) {
    ThrowIfCancelled();
    const std::int64_t end = csr.row_start[Index(row) + 1];
    to = SortRow(begin, end, to, &csr.column, &csr.value);
    csr.row_start[Index(row) + 1] = to;
    begin = end;
  }
  csr.column.resize(Index(to));
  csr.value.resize(Index(to));
  return csr;
}

template <typename Real>
CsrMatrix<Real> Transpose(const CsrMatrix<Real>& matrix) {
  CsrMatrix<Real> transposed;
  transposed.value.resize(matrix.value.size());
  CsrPattern pattern = TransposePattern(matrix.rows, matrix.columns, matrix.row_start,
                                        matrix.column, [&](std::int64_t e, std::int64_t to) {
                                          transposed.value[Index(to)] = matrix.value[Index(e)];
                                        });
  transposed.rows = pattern.rows;
  transposed.columns = pattern.columns;
  transposed.row_start = std::move(pattern.row_start);
  transposed.column = std::move(pattern.column);
  return transposed;
}

template <typename Real>
CsrPattern NormalPattern(const CsrMatrix<Real>& a) {
  const auto ignore = [](std::int64_t, std::int64_t) {};
  const CsrPattern a_t = TransposePattern(a.rows, a.columns, a.row_start, a.column, ignore);
  // Row i has the columns of all rows of A that have an entry in column i, in the order in which
  // they are found.
  std::vector<std::int64_t> row_start(Index(a.columns) + 1, 0);
  std::vector<std::int32_t> column;
  std::vector<std::int32_t> seen_by(Index(a.columns), -1);
  const auto add = [&](int i, std::int32_t j) {
    if (seen_by[Index(j)] == i) return;
    seen_by[Index(j)] = i;
    column.push_back(j);
  };
  for (int i = 0; i < a.columns; ++i) {
    add(i, i);
    for (std::int64_t e = a_t.row_start[Index(i)]; e < a_t.row_start[Index(i) + 1]; ++e) {
      const std::size_t r = Index(a_t.column[Index(e)]);
      for (std::int64_t f = a.row_start[r]; f < a.row_start[r + 1]; ++f) {
        add(i, a.column[Index(f)]);
      }
    }
    row_start[Index(i) + 1] = static_cast<std::int64_t>(column.size());
  }
  // The pattern is symmetric, so that the transposition only sorts it.
  return TransposePattern(a.columns, a.columns, row_start, column, ignore);
}

template <typename Real>
CsrPattern PatternOf(const CsrMatrix<Real>& a) {
  return {a.rows, a.columns, a.row_start, a.column};
}

CsrPattern SumPattern(const CsrPattern& a, const CsrPattern& b) {
  if (a.rows != b.rows || a.columns != b.columns) {
    throw Error(
        fmt::format("patterns of {} x {} and {} x {} entries are added: their sizes must be equal",
                    a.rows, a.columns, b.rows, b.columns));
  }
  CsrPattern sum;
  sum.rows = a.rows;
  sum.columns = a.columns;
  sum.row_start.assign(Index(a.rows) + 1, 0);
  sum.column.reserve(a.column.size() + b.column.size());
  for (std::size_t row = 0; row < Index(a.rows); ++row) {
    std::set_union(a.column.begin() + a.row_start[row], a.column.begin() + a.row_start[row + 1],
                   b.column.begin() + b.row_start[row], b.column.begin() + b.row_start[row + 1],
                   std::back_inserter(sum.column));
    sum.row_start[row + 1] = static_cast<std::int64_t>(sum.column.size());
  }
  return sum;
}

template CsrMatrix<float> Compress(const EllMatrix<float>&);
template CsrMatrix<double> Compress(const EllMatrix<double>&);
template CsrMatrix<float> Transpose(const CsrMatrix<float>&);
template CsrMatrix<double> Transpose(const CsrMatrix<double>&);
template CsrPattern NormalPattern(const CsrMatrix<float>&);
template CsrPattern NormalPattern(const CsrMatrix<double>&);
template CsrPattern PatternOf(const CsrMatrix<float>&);
template CsrPattern PatternOf(const CsrMatrix<double>&);

}  // namespace thicklens::kernels

// Compressed rows. Transposed products need no atomics, because the kernels get the transposed
// matrix.

// One item per row: y_i = sum_j A_ij x_j.
kernel void MultiplyRows(const int rows, global const long* row_start, global const int* column,
                         global const REAL* value, global const REAL* x, global REAL* y) {
  const int row = (int)get_global_id(0);
  if (row >= rows) return;
  REAL sum = 0;
  for (long e = row_start[row]; e < row_start[row + 1]; ++e) sum += value[e] * x[column[e]];
  y[row] = sum;
}

// One item per entry (i, j) of the pattern: N_ij += scale * sum_r A_ri A_rj. Both rows of A^T are
// sorted, so that one pass finds their common columns.
kernel void AddNormalProduct(const long entries, const REAL scale, global const int* pattern_row,
                             global const int* pattern_column, global const long* row_start,
                             global const int* column, global const REAL* value,
                             global REAL* sums) {
  const long entry = (long)get_global_id(0);
  if (entry >= entries) return;
  const int i = pattern_row[entry];
  const int j = pattern_column[entry];
  long e = row_start[i];
  long f = row_start[j];
  const long e_end = row_start[i + 1];
  const long f_end = row_start[j + 1];
  REAL sum = 0;
  while (e < e_end && f < f_end) {
    const int e_column = column[e];
    const int f_column = column[f];
    if (e_column == f_column) sum += value[e] * value[f];
    e += e_column <= f_column;
    f += f_column <= e_column;
  }
  sums[entry] += scale * sum;
}

#ifndef THICKLENS_TESTS_SUPPORT_KERNEL_SAMPLES_H_
#define THICKLENS_TESTS_SUPPORT_KERNEL_SAMPLES_H_

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "thicklens/kernels/kernels.h"

namespace thicklens::testing {

// Random blocks, vectors and sparse matrices, and their dense matrices.

template <typename Real>
using Dense = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;

struct BlockSize {
  int first_x, first_y, width_px, height_px, s_count, t_count, u_count, v_count;
};

// A block with shifts of up to `largest_shift` samples, fractions of all kinds and positive
// weights.
inline kernels::BlockGeometry RandomBlock(const BlockSize& size, int largest_shift,
                                          std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<int> shift(-largest_shift, largest_shift);
  std::uniform_real_distribution<double> fraction(-0.5, 0.5);
  std::uniform_real_distribution<double> weight(0.1, 1.0);
  kernels::BlockGeometry block;
  block.first_x = size.first_x;
  block.first_y = size.first_y;
  block.width_px = size.width_px;
  block.height_px = size.height_px;
  block.s_count = size.s_count;
  block.t_count = size.t_count;
  block.u_count = size.u_count;
  block.v_count = size.v_count;
  // The first shifts are special: exactly on a pixel, and halfway.
  for (int k = 0; k < size.u_count; ++k) {
    block.s_shift.push_back(shift(random));
    block.s_fraction.push_back(k == 1 ? 0.0 : k == 2 ? -0.5 : fraction(random));
  }
  for (int l = 0; l < size.v_count; ++l) {
    block.t_shift.push_back(shift(random));
    block.t_fraction.push_back(l == 1 ? 0.0 : l == 2 ? -0.5 : fraction(random));
  }
  for (int view = 0; view < size.u_count * size.v_count; ++view) {
    block.view_weight.push_back(weight(random));
  }
  return block;
}

template <typename Real>
std::vector<Real> RandomReals(std::size_t count, double low, double high, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> value(low, high);
  std::vector<Real> reals(count);
  for (Real& real : reals) real = static_cast<Real>(value(random));
  return reals;
}

// Each row has some of the columns, and every third row has none.
template <typename Real>
kernels::CsrMatrix<Real> RandomCsr(int rows, int columns, double density, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> chance(0, 1);
  std::uniform_real_distribution<double> value(-1, 1);
  kernels::CsrMatrix<Real> csr;
  csr.rows = rows;
  csr.columns = columns;
  csr.row_start.push_back(0);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; row % 3 != 1 && column < columns; ++column) {
      if (chance(random) >= density) continue;
      csr.column.push_back(column);
      csr.value.push_back(static_cast<Real>(value(random)));
    }
    csr.row_start.push_back(static_cast<std::int64_t>(csr.column.size()));
  }
  return csr;
}

template <typename Real>
Dense<Real> DenseOf(const kernels::EllMatrix<Real>& ell) {
  Dense<Real> dense = Dense<Real>::Zero(ell.rows, ell.columns);
  for (int slot = 0; slot < ell.slots; ++slot) {
    for (int row = 0; row < ell.rows; ++row) {
      const auto at = static_cast<std::size_t>(slot) * static_cast<std::size_t>(ell.rows) +
                      static_cast<std::size_t>(row);
      if (ell.column[at] >= 0) dense(row, ell.column[at]) += ell.value[at];
    }
  }
  return dense;
}

template <typename Real>
Dense<Real> DenseOf(const kernels::CsrMatrix<Real>& csr) {
  Dense<Real> dense = Dense<Real>::Zero(csr.rows, csr.columns);
  for (int row = 0; row < csr.rows; ++row) {
    const auto r = static_cast<std::size_t>(row);
    for (std::int64_t e = csr.row_start[r]; e < csr.row_start[r + 1]; ++e) {
      dense(row, csr.column[static_cast<std::size_t>(e)]) += csr.value[static_cast<std::size_t>(e)];
    }
  }
  return dense;
}

// An entry is 1 where the pattern has an entry, and larger where it has the entry twice.
inline Eigen::MatrixXi DenseOf(const kernels::CsrPattern& pattern) {
  Eigen::MatrixXi dense = Eigen::MatrixXi::Zero(pattern.rows, pattern.columns);
  for (int row = 0; row < pattern.rows; ++row) {
    const auto r = static_cast<std::size_t>(row);
    for (std::int64_t e = pattern.row_start[r]; e < pattern.row_start[r + 1]; ++e) {
      ++dense(row, pattern.column[static_cast<std::size_t>(e)]);
    }
  }
  return dense;
}

template <typename Real>
Eigen::Matrix<Real, Eigen::Dynamic, 1> DenseOf(const std::vector<Real>& vector) {
  return Eigen::Map<const Eigen::Matrix<Real, Eigen::Dynamic, 1>>(
      vector.data(), static_cast<Eigen::Index>(vector.size()));
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_SUPPORT_KERNEL_SAMPLES_H_

#ifndef THICKLENS_TESTS_SUPPORT_DIFFERENCE_MATRIX_H_
#define THICKLENS_TESTS_SUPPORT_DIFFERENCE_MATRIX_H_

#include <Eigen/Core>

namespace thicklens::testing {

// Differences of neighbouring aperture samples with free ends: first the rows across, then those
// down.
inline Eigen::MatrixXd DifferenceMatrix(int u_count, int v_count) {
  const int across = (u_count - 1) * v_count, down = u_count * (v_count - 1);
  Eigen::MatrixXd d = Eigen::MatrixXd::Zero(across + down, u_count * v_count);
  int row = 0;
  for (int l = 0; l < v_count; ++l) {
    for (int k = 0; k + 1 < u_count; ++k, ++row) {
      d(row, l * u_count + k) = -1;
      d(row, l * u_count + k + 1) = 1;
    }
  }
  for (int l = 0; l + 1 < v_count; ++l) {
    for (int k = 0; k < u_count; ++k, ++row) {
      d(row, l * u_count + k) = -1;
      d(row, (l + 1) * u_count + k) = 1;
    }
  }
  return d;
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_SUPPORT_DIFFERENCE_MATRIX_H_

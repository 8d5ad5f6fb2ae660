#include "calib/sharpness/log_parabola.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace thicklens::calib {

std::optional<model::Estimate> VertexOfLogs(const Eigen::VectorXd& readings_mm,
                                            const Eigen::VectorXd& log_index, double middle_mm,
                                            double half_mm) {
  if (!(half_mm > 0)) return std::nullopt;
  const Eigen::Index n = readings_mm.size();
  Eigen::MatrixXd design(n, 3);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double x = (readings_mm[i] - middle_mm) / half_mm;
    design.row(i) << 1, x, x * x;
  }
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(design);
  const Eigen::Vector3d c = qr.solve(log_index);
  if (qr.rank() < 3 || !(c[2] < 0)) return std::nullopt;
  const double x_peak = -c[1] / (2 * c[2]);
  if (!(std::abs(x_peak) <= 1)) return std::nullopt;
  const double variance = (design * c - log_index).squaredNorm() /
                          static_cast<double>(std::max<Eigen::Index>(1, n - 3));
  const Eigen::Vector3d slope(0, -1 / (2 * c[2]), c[1] / (2 * c[2] * c[2]));
  const Eigen::Matrix3d inverse = (design.transpose() * design).inverse();
  const double x_sigma = std::sqrt(std::max(0.0, variance * slope.dot(inverse * slope)));
  return model::Estimate{middle_mm + half_mm * x_peak, half_mm * x_sigma};
}

}  // namespace thicklens::calib

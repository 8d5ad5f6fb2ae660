#include "calib/registration/tile_map.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinTiles = 6;
constexpr int kRounds = 8;
constexpr double kCut = 5;  // cut of Tukey's weights, in standard deviations
// Minimum error of a shift, independent of its spectrum: interpolation and sampling of the blur.
constexpr double kMinShiftSigmaPx = 0.002;
constexpr double kMedianOfChi2 = 1.386;  // two degrees of freedom
constexpr double kMinCondition = 1e-9;

// The terms of a displacement at one place.
template <int kParameters>
using Design = Eigen::Matrix<double, 2, kParameters>;
using FieldDesign = Design<7>;  // shift, linear map, cubic term
using RigidDesign = Design<3>;  // shift, turn

// Lengths are in units of `unit_px`, so that the columns have similar sizes. With a weight
// symmetric about the tile's centre q and of second moment m along each axis, the mean of |p|^2 p
// over the tile is (|q|^2 + 4 m) q (derived here, [D59]).
FieldDesign FieldDesignAt(const Eigen::Vector2d& place_px, double moment_px2, double unit_px) {
  const Eigen::Vector2d q = place_px / unit_px;
  const Eigen::Vector2d cubic = (q.squaredNorm() + 4 * moment_px2 / (unit_px * unit_px)) * q;
  FieldDesign design;
  design << 1, 0, q.x(), q.y(), 0, 0, cubic.x(),  //
      0, 1, 0, 0, q.x(), q.y(), cubic.y();
  return design;
}

// The remaining information if every shift has an additional error of variance `extra_px2`.
Eigen::Matrix2d WithScatter(const Eigen::Matrix2d& information, double extra_px2) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(information);
  Eigen::Vector2d values = eigen.eigenvalues().cwiseMax(0);
  for (int i = 0; i < 2; ++i) values[i] /= 1 + values[i] * extra_px2;
  return eigen.eigenvectors() * values.asDiagonal() * eigen.eigenvectors().transpose();
}

double Farthest(const std::vector<TileShift>& shifts) {
  double farthest_px = 1;
  for (const TileShift& s : shifts) farthest_px = std::max(farthest_px, s.centre_px.norm());
  return farthest_px;
}

template <int kParameters>
struct Solution {
  Eigen::Matrix<double, kParameters, 1> value;
  Eigen::Matrix<double, kParameters, kParameters> covariance;
  int tiles = 0;  // tiles that agree with the fit
};

// Least squares with Tukey's weights and a scatter of the tiles that converges with them.
template <int kParameters>
std::optional<Solution<kParameters>> FitRobustly(const std::vector<TileShift>& shifts,
                                                 const std::vector<Design<kParameters>>& designs) {
  if (shifts.size() < kMinTiles) return std::nullopt;
  Solution<kParameters> solution;
  std::vector<double> robust(shifts.size(), 1);
  double scatter_px2 = 0.01;  // wide at first, so that no tile dominates by its formal error
  double chi2 = 0, dof = 0;
  for (int round = 0; round < kRounds; ++round) {
    decltype(solution.covariance) normal;
    decltype(solution.value) right;
    normal.setZero();
    right.setZero();
    std::vector<Eigen::Matrix2d> weights;
    for (std::size_t i = 0; i < shifts.size(); ++i) {
      weights.push_back(WithScatter(shifts[i].information, scatter_px2));
      normal += robust[i] * designs[i].transpose() * weights[i] * designs[i];
      right += robust[i] * designs[i].transpose() * weights[i] * shifts[i].shift_px;
    }
    const Eigen::SelfAdjointEigenSolver<decltype(normal)> eigen(normal);
    const auto values = eigen.eigenvalues();
    if (!(values[0] > kMinCondition * values[kParameters - 1])) return std::nullopt;
    solution.covariance = eigen.eigenvectors() * values.cwiseInverse().asDiagonal() *
                          eigen.eigenvectors().transpose();
    solution.value = solution.covariance * right;
    std::vector<double> distances;
    chi2 = 0;
    dof = -kParameters;
    for (std::size_t i = 0; i < shifts.size(); ++i) {
      const Eigen::Vector2d left = shifts[i].shift_px - designs[i] * solution.value;
      const double d2 = left.dot(weights[i] * left);
      chi2 += robust[i] * d2;
      dof += 2 * robust[i];
      distances.push_back(d2);
      const double t = d2 / (kCut * kCut);
      robust[i] = t < 1 ? (1 - t) * (1 - t) : 0;
    }
    // The residuals of a fit are smaller than the errors.
    const double free = 1 - kParameters / (2.0 * static_cast<double>(shifts.size()));
    const double excess = Median(distances) / (kMedianOfChi2 * free);
    if (round + 2 < kRounds) {
      scatter_px2 = std::max(scatter_px2 * std::clamp(excess, 0.1, 10.0),
                             kMinShiftSigmaPx * kMinShiftSigmaPx);
    }
  }
  for (const double weight : robust) solution.tiles += weight > 0.3 ? 1 : 0;
  if (solution.tiles < static_cast<int>(std::max(kMinTiles, shifts.size() / 2)) || !(dof > 1))
    return std::nullopt;
  solution.covariance *= kOverlap * std::max(1.0, chi2 / dof);
  return solution;
}

}  // namespace

std::optional<DisplacementField> FitDisplacement(const std::vector<TileShift>& shifts,
                                                 double weight_variance_px2) {
  const double unit_px = Farthest(shifts);
  std::vector<FieldDesign> designs;
  for (const TileShift& s : shifts)
    designs.push_back(FieldDesignAt(s.centre_px, weight_variance_px2, unit_px));
  const auto fit = FitRobustly<7>(shifts, designs);
  if (!fit) return std::nullopt;
  const auto& value = fit->value;
  const auto& covariance = fit->covariance;
  DisplacementField field;
  field.tiles = fit->tiles;
  field.shift_px = value.head<2>();
  field.linear << value[2], value[3], value[4], value[5];
  field.linear /= unit_px;
  field.cubic = value[6] / std::pow(unit_px, 3);
  field.stretch_variance =
      0.25 * (covariance(2, 2) + covariance(5, 5) + 2 * covariance(2, 5)) / (unit_px * unit_px);
  field.cubic_variance = covariance(6, 6) / std::pow(unit_px, 6);
  field.stretch_cubic_covariance =
      0.5 * (covariance(2, 6) + covariance(5, 6)) / std::pow(unit_px, 4);
  return field;
}

std::optional<RigidDisplacement> FitRigid(const std::vector<TileShift>& shifts) {
  const double unit_px = Farthest(shifts);
  std::vector<RigidDesign> designs;
  for (const TileShift& s : shifts) {
    RigidDesign design;
    design << 1, 0, -s.centre_px.y() / unit_px,  //
        0, 1, s.centre_px.x() / unit_px;
    designs.push_back(design);
  }
  const auto fit = FitRobustly<3>(shifts, designs);
  if (!fit) return std::nullopt;
  RigidDisplacement result;
  result.shift_px = fit->value.head<2>();
  result.turn_rad = fit->value[2] / unit_px;
  result.shift_covariance_px2 = fit->covariance.topLeftCorner<2, 2>();
  return result;
}

}  // namespace thicklens::calib

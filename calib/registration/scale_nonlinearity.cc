#include "calib/registration/scale_nonlinearity.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinSamples = 9;
constexpr double kSignificant = 5;  // standard deviations
constexpr int kBlocks = 8;          // runs of neighbours in the jackknife
constexpr int kRounds = 10;
constexpr double kCauchyWidth = 3;     // in standard deviations
constexpr double kSamePosition = 0.3;  // of the mean distance of neighbours

// u is the depth that the scale gives, from -1 at the nearest frame to 1 at the farthest.
struct Point {
  double u = 0, reading_mm = 0;
  double sigma_mm = 0;        // stated error of the reading against the law
  double scale_sigma_mm = 0;  // the part of it that is the error of the scale
};
using Points = std::vector<Point>;

struct Curve {
  Eigen::Vector3d coefficients{0, 0, 0};  // reading = c0 + c1 u + c2 u^2
  double curvature_sigma = 0;  // error of c2, with the scatter if it exceeds the stated error
};

Eigen::Vector3d Powers(double u) { return {1, u, u * u}; }

// One point for all frames at one position of the stage, as in a sweep there and back. They show
// the same detail with the same blur, so that their scales have the same error, and only their
// readings have errors of their own. Taken as independent, the errors of two runs look like a bend.
// `points` is in the order of u.
Points AtOnePosition(const Points& points, double reading_sigma_mm) {
  const double within = kSamePosition * 2 / static_cast<double>(points.size() - 1);
  Points merged;
  for (std::size_t i = 0; i < points.size();) {
    std::vector<double> readings;
    Point sum;
    std::size_t end = i;
    for (; end < points.size() && points[end].u - points[i].u < within; ++end) {
      sum.u += points[end].u;
      sum.scale_sigma_mm += points[end].scale_sigma_mm;
      readings.push_back(points[end].reading_mm);
    }
    const auto count = static_cast<double>(end - i);
    sum.u /= count;
    sum.scale_sigma_mm /= count;
    // One of three and more may be wrong.
    sum.reading_mm = Median(readings);
    sum.sigma_mm =
        std::max(std::hypot(reading_sigma_mm / std::sqrt(count), sum.scale_sigma_mm), 1e-6);
    merged.push_back(sum);
    i = end;
  }
  return merged;
}

// Weighted least squares. Outliers among the readings have less weight (Cauchy).
Curve FitCurve(const Points& points) {
  Curve curve;
  double spread = 1;
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(static_cast<Eigen::Index>(points.size()));
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Point& p = points[i];
      const double weight = weights[static_cast<Eigen::Index>(i)] / (p.sigma_mm * p.sigma_mm);
      normal += weight * Powers(p.u) * Powers(p.u).transpose();
      right += weight * Powers(p.u) * p.reading_mm;
    }
    const Eigen::LDLT<Eigen::Matrix3d> solver(normal);
    curve.coefficients = solver.solve(right);
    double sum = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Point& p = points[i];
      const double off = (p.reading_mm - Powers(p.u).dot(curve.coefficients)) / p.sigma_mm;
      sum += weights[static_cast<Eigen::Index>(i)] * off * off;
      const double distance = off / (kCauchyWidth * spread);
      weights[static_cast<Eigen::Index>(i)] = 1 / (1 + distance * distance);
    }
    spread = std::sqrt(std::max(1.0, sum / (static_cast<double>(points.size()) - 3)));
    const Eigen::Vector3d unit = solver.solve(Eigen::Vector3d::UnitZ());
    curve.curvature_sigma = spread * std::sqrt(std::max(0.0, unit.z()));
  }
  return curve;
}

// Neighbours share errors (an uneven scale, a texture that registers badly). The means over runs of
// neighbours then scatter more than single frames do. Returns the factor between them, at least 1.
// `points` is in the order of u.
double NeighbourFactor(const Points& points, const Curve& curve) {
  const auto n = static_cast<int>(points.size());
  std::array<double, kBlocks> sums{}, counts{};
  double squares = 0;
  for (int i = 0; i < n; ++i) {
    const Point& p = points[static_cast<std::size_t>(i)];
    const double off = (p.reading_mm - Powers(p.u).dot(curve.coefficients)) / p.sigma_mm;
    const auto block = static_cast<std::size_t>(i * kBlocks / n);
    sums[block] += off;
    counts[block] += 1;
    squares += off * off;
  }
  double of_means = 0;
  for (std::size_t b = 0; b < kBlocks; ++b) of_means += sums[b] * sums[b] / counts[b];
  const double variance = squares / (n - 3);
  // A variance with five degrees of freedom is poorly determined; the factor 1.5 allows for that.
  return variance > 0 ? std::sqrt(std::max(1.0, 1.5 * of_means / ((kBlocks - 3) * variance))) : 1;
}

}  // namespace

// The formulas hold for reading = c0 + c1 u + c2 u^2 and u = (Z - m)/h, where Z is the depth that
// the scale gives.
//   In the middle the curve lies -c2 off the chord through its ends.
//   The chord through the middle and one end has the slope c1 -+ c2 and meets Z = 0, u = -m/h, at
//   c0 - (c1 -+ c2) m/h, which is -sign times the bench offset: far minus near = 2 sign c2 m/h.
// Derived here [D63]; m and h are the middle and half the range of the depths, sign is that of the
// direction.
std::optional<ScaleNonlinearity> FindScaleNonlinearity(const std::vector<ScaleSample>& samples,
                                                       const ScaleModel& law,
                                                       const FocusSweep& sweep) {
  if (!law.done || samples.size() < kMinSamples) return std::nullopt;
  const auto [least, most] = std::minmax_element(
      samples.begin(), samples.end(),
      [](const ScaleSample& a, const ScaleSample& b) { return a.scale < b.scale; });
  const double nearest_mm = law.reference_depth_mm / most->scale;
  const double farthest_mm = law.reference_depth_mm / least->scale;
  const double middle_mm = 0.5 * (nearest_mm + farthest_mm);
  const double half_mm = 0.5 * (farthest_mm - nearest_mm);
  if (!(half_mm > 0)) return std::nullopt;
  Points points;
  for (const ScaleSample& sample : samples) {
    const double depth_mm = law.reference_depth_mm / sample.scale;
    Point point;
    point.u = (depth_mm - middle_mm) / half_mm;
    point.reading_mm = sample.reading_mm;
    const double from_scale_mm = depth_mm * sample.registration.scale_sigma / sample.scale;
    point.scale_sigma_mm = from_scale_mm;
    point.sigma_mm = std::max(std::hypot(sweep.reading_sigma_mm, from_scale_mm), 1e-6);
    points.push_back(point);
  }
  std::sort(points.begin(), points.end(), [](const Point& a, const Point& b) { return a.u < b.u; });
  points = AtOnePosition(points, sweep.reading_sigma_mm);
  if (points.size() < kMinSamples) return std::nullopt;
  const Curve curve = FitCurve(points);
  const double curvature_mm = curve.coefficients.z();
  const double sigma_mm = curve.curvature_sigma * NeighbourFactor(points, curve);
  if (!(std::abs(curvature_mm) > kSignificant * sigma_mm)) return std::nullopt;
  ScaleNonlinearity nonlinearity;
  nonlinearity.bow_mm = {-curvature_mm, sigma_mm};
  nonlinearity.zero_spread_mm =
      2 * model::DirectionSign(sweep.direction) * curvature_mm * middle_mm / half_mm;
  return nonlinearity;
}

}  // namespace thicklens::calib

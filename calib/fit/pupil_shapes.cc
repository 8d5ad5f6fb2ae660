#include "calib/fit/pupil_shapes.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "thicklens/base/pi.h"

namespace thicklens::calib {
namespace {

constexpr double kEdgeReach = 5;  // sigmas
constexpr int kEdgeSteps = 200;

// Returns the value per axis for a blur of sigma 1: E A_x^4 = 3/8 E A^4.
double ExcessKurtosis(const model::PupilProfile& profile) {
  double fourth = 0;
  for (const model::PupilProfile::Ring& ring : profile.rings())
    fourth += ring.share * std::pow(ring.radius, 4);
  return 3.0 / 8 * fourth - 3;
}

// Returns a step seen through the blur, at equal steps from its middle to the reach. A ring of
// radius R gives 1/2 + asin(x/R)/pi.
std::vector<double> Edge(const model::PupilProfile& profile) {
  std::vector<double> edge;
  for (int i = 0; i <= kEdgeSteps; ++i) {
    const double x = kEdgeReach * i / kEdgeSteps;
    double sum = 0;
    for (const model::PupilProfile::Ring& ring : profile.rings())
      sum += ring.share * (0.5 + std::asin(std::min(1.0, x / ring.radius)) / kPi);
    edge.push_back(sum);
  }
  return edge;
}

double At(const std::vector<double>& edge, double x) {
  const double place = x / kEdgeReach * kEdgeSteps;
  const auto below = std::min(static_cast<std::size_t>(place), edge.size() - 2);
  const double rest = std::min(1.0, place - static_cast<double>(below));
  return edge[below] + rest * (edge[below + 1] - edge[below]);
}

double SquaredDifference(const std::vector<double>& law, const std::vector<double>& family,
                         double ratio) {
  double sum = 0;
  for (int i = 0; i <= kEdgeSteps; ++i) {
    const double apart =
        law[static_cast<std::size_t>(i)] - At(family, kEdgeReach * i / kEdgeSteps / ratio);
    sum += apart * apart;
  }
  return sum;
}

// Finds the ratio by golden sections; the difference has one minimum there.
double NearestRatio(const std::vector<double>& law, const std::vector<double>& family) {
  const double golden = (std::sqrt(5.0) - 1) / 2;
  double low = 0.7, high = 1.3;
  while (high - low > 1e-6) {
    const double a = high - golden * (high - low), b = low + golden * (high - low);
    (SquaredDifference(law, family, a) < SquaredDifference(law, family, b) ? high : low) =
        SquaredDifference(law, family, a) < SquaredDifference(law, family, b) ? b : a;
  }
  return (low + high) / 2;
}

}  // namespace

Eigen::Vector2d TailsOfPupilLaws(const model::PupilOptics& optics) {
  const double uniform = ExcessKurtosis({model::PupilLaw::kUniform, optics});
  Eigen::Vector2d range(0, 0);
  for (const model::PupilLaw law : model::AllPupilLaws()) {
    const double tails = (ExcessKurtosis({law, optics}) - uniform) / 24;
    range = {std::min(range.x(), tails), std::max(range.y(), tails)};
  }
  return range;
}

Eigen::Vector2d EdgeRatiosOfPupilLaws(const model::PupilOptics& optics) {
  const std::vector<double> family = Edge({model::PupilLaw::kUniform, optics});
  Eigen::Vector2d range(1, 1);
  for (const model::PupilLaw law : model::AllPupilLaws()) {
    const double ratio = NearestRatio(Edge({law, optics}), family);
    range = {std::min(range.x(), ratio), std::max(range.y(), ratio)};
  }
  return range;
}

}  // namespace thicklens::calib

#include "calib/registration/expected_scale.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

#include "calib/registration/frame_map.h"
#include "calib/registration/radial_distortion.h"
#include "calib/registration/registration.h"
#include "calib/registration/scale_tracking.h"
#include "calib/registration/tile_pass.h"
#include "thicklens/base/pi.h"
#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

double Sinc(double x) { return std::abs(x) < 1e-9 ? 1 : std::sin(kPi * x) / (kPi * x); }

// |H|^2 of a Gaussian of that variance.
double Passed(double variance_px2, double frequency) {
  return std::exp(-4 * kPi * kPi * variance_px2 * frequency * frequency);
}

// Correlation of the errors of two tiles' shifts at each distance along one axis, from 0 px on.
// Noise and texture enter a shift with the square of the Hann window, and its variance with the
// fourth power.
std::vector<double> SharedErrors(int size_px) {
  std::vector<double> squares;
  for (int i = 0; i < size_px; ++i)
    squares.push_back(std::pow(std::sin(kPi * (i + 0.5) / size_px), 4));
  std::vector<double> shared;
  for (auto begin = squares.begin(); begin != squares.end(); ++begin)
    shared.push_back(std::inner_product(begin, squares.end(), squares.begin(), 0.0));
  const double own = shared.front();
  for (double& value : shared) value /= own;
  return shared;
}

// Factor by which the errors that neighbouring tiles share widen the variance of the scale, whose
// fit weights the shift of a tile by its place [D154].
double OverlapOf(const TileLayout& layout, const std::vector<TileShift>& shifts) {
  const std::vector<double> shared = SharedErrors(layout.size_px);
  const auto at = [&shared](int distance_px) {
    const auto distance = static_cast<std::size_t>(std::abs(distance_px));
    return distance < shared.size() ? shared[distance] : 0.0;
  };
  double with = 0, without = 0;
  for (std::size_t a = 0; a < shifts.size(); ++a) {
    without += shifts[a].centre_px.squaredNorm();
    for (std::size_t b = 0; b < shifts.size(); ++b) {
      const cv::Point apart = layout.corners[a] - layout.corners[b];
      with += shifts[a].centre_px.dot(shifts[b].centre_px) * at(apart.x) * at(apart.y);
    }
  }
  return with / without;
}

struct ExpectedRegistration {
  FreeRegistration registration;
  double overlap = 1;  // the factor of OverlapOf
};

std::optional<ExpectedRegistration> Expected(const ExpectedFrame& reference,
                                             const ExpectedFrame& frame,
                                             const ExpectedField& field) {
  Registration there;
  there.scale = frame.scale;
  const FrameMap map = MapOf(there, {field.centre_px.x(), field.centre_px.y()});
  const cv::Size size(static_cast<int>(field.size_px.x()), static_cast<int>(field.size_px.y()));
  const double s2 = frame.scale * frame.scale;
  const double reference_px2 = s2 * reference.variance_px2;  // brought to the frame's scale
  const double added_px2 = frame.variance_px2 - reference_px2;
  const int factor = FactorOfPass(SharedField(map, size, size), added_px2);
  const auto layout = LayOutTiles(map, size, size, factor);
  if (!layout) return std::nullopt;
  const double blurred_px2 = std::max(frame.variance_px2, reference_px2);
  const TilePhases phases(layout->size_px);
  const double information = phases.ExpectedInformation([&](double k) {
    // Noise is white in the px of its own frame. A frame brought to another scale keeps the
    // variance of a pixel, so that the density of its noise changes with the area of a px, like the
    // texture's.
    const double nu = k / factor;
    const double box = std::pow(Sinc(nu), 4) * Passed(blurred_px2, nu);
    const double matched = Passed(std::abs(added_px2), nu);
    TilePhases::Powers powers;
    powers.texture = s2 * field.texture_px2(nu * frame.scale) * box;
    powers.frame_noise = std::pow(frame.relative_noise, 2) * (added_px2 < 0 ? matched : 1);
    powers.reference_noise =
        s2 * std::pow(reference.relative_noise, 2) * (added_px2 > 0 ? matched : 1);
    return powers;
  });
  std::vector<TileShift> shifts;
  for (const cv::Point& corner : layout->corners) {
    const Eigen::Vector2d middle =
        Eigen::Vector2d(corner.x, corner.y).array() + 0.5 * (layout->size_px - 1);
    TileShift shift;
    shift.centre_px = (factor * (middle.array() + 0.5) - 0.5).matrix() - map.centre;
    shift.information = information / (factor * factor) * Eigen::Matrix2d::Identity();
    if (information > 0) shifts.push_back(shift);
  }
  const auto displacement = FitDisplacement(shifts, phases.weight_variance_px2() * factor * factor);
  if (!displacement) return std::nullopt;
  return ExpectedRegistration{DescribeFreely(map, *displacement), OverlapOf(*layout, shifts)};
}

}  // namespace

double CornerRadiusPx(const ExpectedField& field) {
  return field.centre_px.cwiseMax(field.size_px - Eigen::Vector2d::Ones() - field.centre_px).norm();
}

ExpectedScales ExpectScales(const std::vector<ExpectedFrame>& frames, std::size_t reference,
                            const ExpectedField& field) {
  ExpectedScales expected;
  std::vector<ScaleSample>& samples = expected.samples;
  samples = {{reference, frames[reference].reading_mm, 1.0, {}, false}};
  std::vector<FreeRegistration> registrations(1);
  std::vector<double> overlaps(1, kOverlap);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (i == reference) continue;
    const auto found = Expected(frames[reference], frames[i], field);
    if (!found) continue;
    const Registration alone = found->registration.WithCubic(0, 0);
    samples.push_back({i, frames[i].reading_mm, alone.scale, alone, false});
    registrations.push_back(found->registration);
    overlaps.push_back(found->overlap);
  }
  // The scatter of what TakeOutDistortion removes from a lens without distortion.
  double scatter = 0;
  if (const auto fitted = FitRadialDistortion(samples)) {
    scatter = PartOfDistortion(CornerRadiusPx(field), fitted->sigma) * fitted->sigma *
              std::sqrt(Median(overlaps) / kOverlap);
  }
  for (std::size_t i = 0; i < samples.size(); ++i) {
    // A registration states an error with a margin.
    expected.own_sigmas.push_back(samples[i].registration.scale_sigma *
                                  std::sqrt(overlaps[i] / kOverlap));
    expected.by_distortion.push_back(registrations[i].scale_per_cubic * scatter *
                                     CubicPerDistortion(samples[i].scale));
  }
  TakeOutDistortion(CornerRadiusPx(field), registrations, &samples);
  return expected;
}

double ExpectedScales::OffsetScatterMm(double reading_sigma_mm) const {
  const auto n = static_cast<Eigen::Index>(samples.size());
  if (n < 3) return std::numeric_limits<double>::infinity();
  const double reference_mm = samples.front().reading_mm;  // direction away, offset 0
  Eigen::MatrixXd jacobian(n, 2);
  Eigen::VectorXd weight(n), own(n), common(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const ScaleSample& sample = samples[static_cast<std::size_t>(i)];
    // 1/scale changes by so much, mm of reading, for a change of the scale.
    const double by_scale = reference_mm / (sample.scale * sample.scale);
    jacobian.row(i) << -1, 1 / sample.scale;
    const double stated = std::hypot(reading_sigma_mm, by_scale * sample.registration.scale_sigma);
    weight[i] = 1 / std::max(stated * stated, 1e-12);
    own[i] = std::pow(reading_sigma_mm, 2) +
             std::pow(by_scale * own_sigmas[static_cast<std::size_t>(i)], 2);
    common[i] = by_scale * by_distortion[static_cast<std::size_t>(i)];
  }
  const Eigen::Matrix2d normal = jacobian.transpose() * weight.asDiagonal() * jacobian;
  const Eigen::RowVectorXd response =
      (normal.inverse() * jacobian.transpose() * weight.asDiagonal()).row(0);
  return std::sqrt(response.array().square().matrix().dot(own.transpose()) +
                   std::pow(response.dot(common), 2));
}

}  // namespace thicklens::calib

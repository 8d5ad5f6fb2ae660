#include "calib/registration/blur_field.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "calib/registration/image_scale.h"
#include "calib/registration/radial_distortion.h"
#include "calib/registration/tile_map.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinBlurTiles = 9;
constexpr Eigen::Index kFieldTerms = 7;
constexpr double kMinFieldCondition = 1e-12;
// Relative error of the stretch that the model of the blur leaves: 11 % in the mean of six
// simulated sweeps of dead leaves with -3 mm of curvature.
constexpr double kStretchError = 0.15;
constexpr double kUsualExponent = -2;  // of a texture that does not show it
constexpr double kSeenFactor = 2;  // standard deviations from which on a factor corrects the scales

// Textures between white noise and isolated edges. The line of the exponents is used this far
// beyond the frequencies that show them.
constexpr double kLowestExponent = -4, kHighestExponent = 0.5;
constexpr double kReachOfExponent = 0.5;

using TileDesign = Eigen::Matrix<double, 3, kFieldTerms>;

// The terms of the variances (xx, yy, xy) at a place in units: three constants, the slopes of the
// variance in x and y, the curvature, the astigmatism.
TileDesign DesignAt(const Eigen::Vector2d& q) {
  const double x = q.x(), y = q.y(), r2 = q.squaredNorm();
  TileDesign design;
  design << 1, 0, 0, x, y, r2, x * x - y * y,  //
      0, 1, 0, x, y, r2, y * y - x * x,        //
      0, 0, 1, 0, 0, 0, 2 * x * y;
  return design;
}

// The exponent of the texture's power against the logarithm of the frequency.
struct ExponentLine {
  double middle = 0, value = 0, slope = 0, low = 0, high = 0;

  double At(double log_frequency) const {
    return std::clamp(value + slope * (std::clamp(log_frequency, low, high) - middle),
                      kLowestExponent, kHighestExponent);
  }
};

std::optional<ExponentLine> FitExponents(const std::vector<BlurOverField>& blurs) {
  std::vector<Eigen::Vector2d> points;
  for (const BlurOverField& blur : blurs) {
    if (const auto& exponent = blur.texture.exponent)
      points.emplace_back(exponent->log_frequency, exponent->value);
  }
  if (points.size() < 2) return std::nullopt;
  Eigen::Vector2d mean(0, 0);
  for (const Eigen::Vector2d& point : points) mean += point / static_cast<double>(points.size());
  double xx = 0, xy = 0;
  ExponentLine line;
  line.low = line.high = points.front().x();
  for (const Eigen::Vector2d& point : points) {
    xx += (point.x() - mean.x()) * (point.x() - mean.x());
    xy += (point.x() - mean.x()) * (point.y() - mean.y());
    line.low = std::min(line.low, point.x());
    line.high = std::max(line.high, point.x());
  }
  line.middle = mean.x();
  line.value = mean.y();
  line.slope = xx > 0 ? xy / xx : 0;
  line.low -= kReachOfExponent;
  line.high += kReachOfExponent;
  return line;
}

// The factor by which scales are corrected: one that is not significant is an error alone.
model::Estimate Correcting(const model::Estimate& factor) {
  if (std::abs(factor.value) > kSeenFactor * factor.sigma) return factor;
  return {0, std::hypot(factor.value, factor.sigma)};
}

}  // namespace

std::optional<BlurField> FitBlurField(const std::vector<TileBlur>& tiles) {
  if (tiles.size() < kMinBlurTiles) return std::nullopt;
  double unit_px = 1;
  for (const TileBlur& tile : tiles) unit_px = std::max(unit_px, tile.centre_px.norm());
  Eigen::Matrix<double, kFieldTerms, kFieldTerms> normal;
  Eigen::Matrix<double, kFieldTerms, 1> right;
  normal.setZero();
  right.setZero();
  for (const TileBlur& tile : tiles) {
    const TileDesign design = DesignAt(tile.centre_px / unit_px);
    normal += design.transpose() * tile.information * design;
    right += design.transpose() * tile.information * tile.added_px2;
  }
  const Eigen::SelfAdjointEigenSolver<decltype(normal)> eigen(normal);
  const auto values = eigen.eigenvalues();
  if (!(values[0] > kMinFieldCondition * values[kFieldTerms - 1])) return std::nullopt;
  const decltype(normal) inverse =
      eigen.eigenvectors() * values.cwiseInverse().asDiagonal() * eigen.eigenvectors().transpose();
  const Eigen::Matrix<double, kFieldTerms, 1> terms = inverse * right;
  double chi2 = 0;
  for (const TileBlur& tile : tiles) {
    const Eigen::Vector3d left = tile.added_px2 - DesignAt(tile.centre_px / unit_px) * terms;
    chi2 += left.dot(tile.information * left);
  }
  const double freedom = 3 * static_cast<double>(tiles.size()) - kFieldTerms;
  const decltype(normal) covariance = kOverlap * chi2 / freedom * inverse;
  const double unit2 = unit_px * unit_px;
  const auto term = [&](Eigen::Index i) {
    return model::Estimate{terms[i] / unit2, std::sqrt(std::max(0.0, covariance(i, i))) / unit2};
  };
  return BlurField{term(5), term(6)};
}

double StretchByBlur(double curvature, double astigmatism, double texture_exponent) {
  return -0.5 * ((2 - texture_exponent) * curvature + (4 - texture_exponent) * astigmatism);
}

std::optional<BlurField> BlurPerScale(const std::vector<BlurOverField>& blurs,
                                      const std::vector<ScaleSample>& samples) {
  std::vector<ProportionalTerm> curvatures, astigmatisms;
  std::vector<model::Estimate> changes;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const double change = samples[i].scale - 1;
    if (!blurs[i].field || change == 0) continue;
    const auto& [curvature, astigmatism] = *blurs[i].field;
    if (!(curvature.sigma > 0) || !(astigmatism.sigma > 0)) continue;
    changes.push_back({change, samples[i].registration.scale_sigma});
    curvatures.push_back({change, curvature.value, curvature.sigma});
    astigmatisms.push_back({change, astigmatism.value, astigmatism.sigma});
  }
  if (!ExceedErrors(changes)) return std::nullopt;
  const auto curvature = FitProportion(curvatures);
  const auto astigmatism = FitProportion(astigmatisms);
  if (!curvature || !astigmatism) return std::nullopt;
  return BlurField{*curvature, *astigmatism};
}

BlurField SeenFactors(const BlurField& factors) {
  return {Correcting(factors.curvature), Correcting(factors.astigmatism)};
}

void StateStretchByBlur(const BlurField& factors, const std::vector<BlurOverField>& blurs,
                        const std::vector<double>& before, std::vector<ScaleSample>* samples) {
  const auto exponents = FitExponents(blurs);
  for (std::size_t i = 0; i < samples->size(); ++i) {
    ScaleSample& sample = (*samples)[i];
    const double n = exponents ? exponents->At(blurs[i].texture.log_frequency) : kUsualExponent;
    const double taken_out = std::hypot(StretchByBlur(factors.curvature.value, 0, n),
                                        StretchByBlur(0, factors.astigmatism.value, n));
    sample.shared_stretch_sigma =
        std::hypot(std::hypot(StretchByBlur(factors.curvature.sigma, 0, n),
                              StretchByBlur(0, factors.astigmatism.sigma, n)),
                   kStretchError * taken_out);
    if (before.empty()) continue;
    sample.registration.stretch_by_blur = model::Estimate{
        before[i] / sample.scale - 1, sample.shared_stretch_sigma * std::abs(sample.scale - 1)};
  }
}

}  // namespace thicklens::calib

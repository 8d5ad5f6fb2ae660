#include "calib/spectrum/expected_blur.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/spectrum/spectral_transfer.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/pi.h"

namespace thicklens::calib {

ExpectedBlur ExpectBlur(const std::vector<ExpectedSpectrum>& frames, std::size_t reference,
                        const TargetWindow& window, const std::vector<Mode>& modes,
                        const Eigen::ArrayXd& power, const RelativeBlurOptions& options) {
  ExpectedBlur expected;
  double least = std::numeric_limits<double>::infinity();
  for (const ExpectedSpectrum& frame : frames) least = std::min(least, frame.variance_px2);

  const auto n = static_cast<Eigen::Index>(frames.size());
  const auto count = static_cast<Eigen::Index>(modes.size());
  Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(count, n);  // |H|^2/N, 0 beyond the band
  Eigen::MatrixXd slopes = Eigen::MatrixXd::Zero(count, n);   // d ln H/dV
  for (Eigen::Index i = 0; i < n; ++i) {
    ThrowIfCancelled();
    const ExpectedSpectrum& frame = frames[static_cast<std::size_t>(i)];
    const double range = std::max(frame.variance_px2 - least, 1e-9);
    const double highest2 = options.band / (2 * kPi * kPi * range);
    int used = 0;
    for (Eigen::Index k = 0; k < std::min(count, static_cast<Eigen::Index>(frame.modes)); ++k) {
      const Mode& mode = modes[static_cast<std::size_t>(k)];
      const double nu = ModeFrequency(mode, window).norm();
      if (!(nu * nu < highest2)) continue;
      const TransferAndSlope h = SpectralTransfer(options.psf, options.floor_variance_px2,
                                                  frame.variance_px2, frame.scale, nu);
      const double received = h.value * BoxTransfer(mode, window, frame.scale);
      weights(k, i) = received * received / frame.noise;
      slopes(k, i) = h.log_slope;
      ++used;
    }
    expected.modes_used.push_back(used);
  }
  // ln g and V of each frame but the reference, the gains first.
  const Eigen::Index others = n - 1;
  const Eigen::ArrayXd root =
      (power / weights.rowwise().sum().array().max(std::numeric_limits<double>::min())).sqrt();
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(2 * others, 2 * others);
  Eigen::MatrixXd projection(count, 2 * others);
  Eigen::Index row = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    if (i == static_cast<Eigen::Index>(reference)) continue;
    const Eigen::ArrayXd weight = weights.col(i), slope = slopes.col(i);
    const double own = (weight * power).sum(), mixed = (weight * power * slope).sum();
    information(row, row) = own;
    information(row, others + row) = information(others + row, row) = mixed;
    information(others + row, others + row) = (weight * power * slope.square()).sum();
    projection.col(row) = weight * root;
    projection.col(others + row) = weight * root * slope;
    ++row;
  }
  information.selfadjointView<Eigen::Lower>().rankUpdate(projection.transpose(), -1);
  const Eigen::VectorXd unit = information.diagonal()
                                   .cwiseMax(std::numeric_limits<double>::min())
                                   .cwiseSqrt()
                                   .cwiseInverse();
  Eigen::MatrixXd scaled = unit.asDiagonal() *
                           Eigen::MatrixXd(information.selfadjointView<Eigen::Lower>()) *
                           unit.asDiagonal();
  scaled.diagonal().array() += 1e-12;
  const Eigen::LLT<Eigen::MatrixXd> factor(scaled);
  if (factor.info() != Eigen::Success) {
    expected.message = "the spectra would not determine the blur of every frame";
    return expected;
  }
  const Eigen::MatrixXd inverse = factor.solve(Eigen::MatrixXd::Identity(2 * others, 2 * others))
                                      .bottomRightCorner(others, others);
  expected.covariance = Eigen::MatrixXd::Zero(n, n);
  const auto place = [&](Eigen::Index i) {
    return i < static_cast<Eigen::Index>(reference) ? i : i + 1;
  };
  for (Eigen::Index a = 0; a < others; ++a) {
    for (Eigen::Index b = 0; b < others; ++b) {
      expected.covariance(place(a), place(b)) =
          kRealPart * kSharedNoise * inverse(a, b) * unit[others + a] * unit[others + b];
    }
  }
  expected.done = true;
  expected.message = "done";
  return expected;
}

}  // namespace thicklens::calib

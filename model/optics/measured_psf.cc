#include "thicklens/model/measured_psf.h"

#include <fmt/format.h>

#include <cmath>

#include "thicklens/base/error.h"
#include "thicklens/base/validity.h"

namespace thicklens::model {
namespace {

constexpr Eigen::Index kMinSide = 3, kMaxSide = 255;
constexpr double kSumTolerance = 1e-6;
constexpr double kOffCentre = 0.05;  // of sigma

// Places of the columns, or of the rows, from the middle, in steps.
Eigen::ArrayXd Places(Eigen::Index count) {
  return Eigen::ArrayXd::LinSpaced(count, -0.5 * static_cast<double>(count - 1),
                                   0.5 * static_cast<double>(count - 1));
}

}  // namespace

Eigen::Vector2d MeasuredPsf::Centroid() const {
  const double sum = light.sum();
  const Eigen::ArrayXd columns = light.colwise().sum().transpose();
  const Eigen::ArrayXd rows = light.rowwise().sum();
  return step / sum *
         Eigen::Vector2d((columns * Places(columns.size())).sum(),
                         (rows * Places(rows.size())).sum());
}

Eigen::Vector2d MeasuredPsf::AxisSigmas() const {
  const double sum = light.sum();
  const Eigen::ArrayXd columns = light.colwise().sum().transpose();
  const Eigen::ArrayXd rows = light.rowwise().sum();
  const Eigen::Vector2d centre = Centroid() / step;
  const auto along = [&](const Eigen::ArrayXd& shares, double at) {
    const double variance = (shares * (Places(shares.size()) - at).square()).sum() / sum;
    return step * std::sqrt(std::max(0.0, variance) + 1.0 / 12);
  };
  return {along(columns, centre.x()), along(rows, centre.y())};
}

double MeasuredPsf::BlurRatio() const { return AxisSigmas().norm() / std::sqrt(2.0); }

bool MeasuredPsf::IsValid(std::string* why) const {
  if (light.rows() != light.cols()) {
    return Fail(why, fmt::format("light has {} rows of {} numbers: it must be square", light.rows(),
                                 light.cols()));
  }
  if (light.rows() < kMinSide || light.rows() > kMaxSide || light.rows() % 2 == 0) {
    return Fail(why, fmt::format("light has {} rows: an odd number from {} to {} is expected",
                                 light.rows(), kMinSide, kMaxSide));
  }
  if (!(step > 0) || !std::isfinite(step))
    return Fail(why, fmt::format("step is {}: it must be finite and > 0", step));
  for (Eigen::Index j = 0; j < light.rows(); ++j) {
    for (Eigen::Index i = 0; i < light.cols(); ++i) {
      if (light(j, i) >= 0 && std::isfinite(light(j, i))) continue;
      return Fail(why, fmt::format("light in row {}, column {} is {}: it must be finite and >= 0",
                                   j + 1, i + 1, light(j, i)));
    }
  }
  if (!(std::abs(light.sum() - 1) <= kSumTolerance))
    return Fail(why, fmt::format("light has the sum {}: it must be 1", light.sum()));
  if (sigma.size() > 0) {
    if (sigma.rows() != light.rows() || sigma.cols() != light.cols()) {
      return Fail(why, fmt::format("sigma has {} rows of {} numbers: the size of light, {} x {}, "
                                   "is expected",
                                   sigma.rows(), sigma.cols(), light.cols(), light.rows()));
    }
    if (!(sigma >= 0).all() || !sigma.allFinite())
      return Fail(why, "sigma has a number that is not finite and >= 0");
  }
  const Eigen::Vector2d centroid = Centroid();
  const double largest = kOffCentre * BlurRatio();
  if (!(centroid.norm() <= largest)) {
    return Fail(why, fmt::format("light is off-centre: its centroid is at ({:.3g}, {:.3g}) blur "
                                 "radii, but at most {:.2g} from the middle is expected",
                                 centroid.x(), centroid.y(), largest));
  }
  return true;
}

MeasuredPsf Normalised(MeasuredPsf psf) {
  const double sum = psf.light.size() > 0 ? psf.light.sum() : 0;
  if (!(sum > 0) || !std::isfinite(sum))
    throw Error(fmt::format("light has the sum {}: a sum > 0 is expected", sum));
  psf.light /= sum;
  psf.sigma /= sum;
  return psf;
}

}  // namespace thicklens::model

#include "model/simulate/scene/ray_set.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "model/optics/airy.h"
#include "thicklens/base/pi.h"

namespace thicklens::model {
namespace {

// Maximum distance of the landing points for the Gaussian, in sigmas, and for the Airy pattern, in
// radii.
constexpr double kFloorDeviations = 5;
constexpr double kAiryRadii = 50;

// The standard normal distribution function.
double NormalBelow(double x) { return std::erfc(-x / std::sqrt(2.0)) / 2; }

// [D35] Distribution function at x of a box of width 1 around 0 convolved with a Gaussian: the
// difference, over the box, of the twice integrated density of the Gaussian, sigma^2 g(x) + x
// Phi(x/sigma). Without the Gaussian it is that of the box.
double PixelBelow(double x, double sigma) {
  const auto integral = [sigma](double at) {
    if (sigma == 0) return std::max(at, 0.0);
    const double deviations = at / sigma;
    return sigma / std::sqrt(2 * kPi) * std::exp(-deviations * deviations / 2) +
           at * NormalBelow(deviations);
  };
  return integral(x + 0.5) - integral(x - 0.5);
}

// Returns the x at which a distribution function that increases from -reach to reach has the value
// `share`.
template <typename Distribution>
double Quantile(const Distribution& below, double reach, double share) {
  double low = -reach;
  double high = reach;
  for (int i = 0; i < 60; ++i) {
    const double middle = (low + high) / 2;
    (below(middle) < share ? low : high) = middle;
  }
  return (low + high) / 2;
}

double NormalQuantile(double share) { return Quantile(NormalBelow, 9, share); }

double PixelQuantile(bool box, double sigma, double share) {
  if (!box) return sigma == 0 ? 0 : sigma * NormalQuantile(share);
  return Quantile([sigma](double x) { return PixelBelow(x, sigma); }, 0.5 + 9 * sigma, share);
}

// The digits of i in a base, mirrored at the point; in [0, 1).
double RadicalInverse(int i, int base) {
  double digit = 1;
  double value = 0;
  for (; i > 0; i /= base) {
    digit /= base;
    value += digit * (i % base);
  }
  return value;
}

// The radical inverses of 0 to count - 1, each replaced by its rank among them. Each coordinate
// alone is then exactly uniform, (k + 1/2)/count, for every count.
std::vector<double> EvenShares(int base, int count) {
  std::vector<std::pair<double, std::size_t>> inverses;
  for (int i = 0; i < count; ++i) inverses.emplace_back(RadicalInverse(i, base), inverses.size());
  std::sort(inverses.begin(), inverses.end());
  std::vector<double> shares(inverses.size());
  for (std::size_t rank = 0; rank < inverses.size(); ++rank) {
    shares[inverses[rank].second] = (static_cast<double>(rank) + 0.5) / count;
  }
  return shares;
}

// Maps to a uniform distribution in a disc with the second moment 1 per axis; its radius is 2.
Eigen::Vector2d InDisc(double u, double v) {
  return 2 * std::sqrt(u) * Eigen::Vector2d(std::cos(2 * kPi * v), std::sin(2 * kPi * v));
}

// Sets the mean to 0 and the variance to 1. The small errors of a finite set would displace and
// widen every blur.
void StandardiseAperture(std::vector<PixelRay>* rays) {
  const double count = static_cast<double>(rays->size());
  Eigen::Vector2d mean(0, 0);
  for (const PixelRay& ray : *rays) mean += ray.aperture / count;
  Eigen::Array2d variance(0, 0);
  for (PixelRay& ray : *rays) {
    ray.aperture -= mean;
    variance += ray.aperture.array().square() / count;
  }
  for (PixelRay& ray : *rays) ray.aperture.array() /= variance.sqrt();
}

}  // namespace

double FarthestDeviations(const RaySpread& spread) {
  if (!spread.aperture) return 0;
  return spread.aperture == Psf::kDisc ? kDiscDeviations : kGaussianDeviations;
}

double FarthestLandingPx(const RaySpread& spread) {
  return (spread.box ? 0.5 : 0) + kFloorDeviations * spread.gaussian_px +
         kAiryRadii * spread.airy_px;
}

std::vector<PixelRay> PhotographRays(const RaySpread& spread, int count) {
  const std::vector<double> v = EvenShares(2, count);
  const std::vector<double> x = EvenShares(3, count);
  const std::vector<double> y = EvenShares(5, count);
  std::vector<PixelRay> rays(v.size());
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const double u = (static_cast<double>(i) + 0.5) / count;
    if (spread.aperture == Psf::kDisc) rays[i].aperture = InDisc(u, v[i]);
    if (spread.aperture == Psf::kGaussian) {
      rays[i].aperture = {NormalQuantile(u), NormalQuantile(v[i])};
    }
    rays[i].offset_px = {PixelQuantile(spread.box, spread.gaussian_px, x[i]),
                         PixelQuantile(spread.box, spread.gaussian_px, y[i])};
  }
  if (spread.aperture) StandardiseAperture(&rays);
  if (spread.airy_px > 0) {
    const std::vector<double> radii = AiryQuantiles(count);
    const std::vector<double> radius = EvenShares(7, count);
    const std::vector<double> turn = EvenShares(11, count);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const double r_px = spread.airy_px * radii[static_cast<std::size_t>(radius[i] * count)];
      const double phi = 2 * kPi * turn[i];
      rays[i].offset_px += r_px * Eigen::Vector2d(std::cos(phi), std::sin(phi));
    }
  }
  return rays;
}

std::vector<PixelRay> ViewRays(bool box, double gaussian_px) {
  constexpr int kCount = 89;  // two consecutive Fibonacci numbers
  constexpr int kBefore = 55;
  if (!box && gaussian_px == 0) return {PixelRay()};
  std::vector<PixelRay> rays;
  for (int i = 0; i < kCount; ++i) {
    PixelRay ray;
    ray.offset_px = {PixelQuantile(box, gaussian_px, (i + 0.5) / kCount),
                     PixelQuantile(box, gaussian_px, (i * kBefore % kCount + 0.5) / kCount)};
    rays.push_back(ray);
  }
  return rays;
}

}  // namespace thicklens::model

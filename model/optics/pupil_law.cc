#include "thicklens/model/pupil_law.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

// Largest sin^2(beta) of the rays, about 72 degrees. Steeper rays do not exist.
constexpr double kLargestSquaredSine = 0.9;
constexpr double kTableStep = 0.01;
// The transfer function of a Gaussian is negligible there: exp(-10^2/2) is 2e-22.
constexpr double kGaussianReach = 10;
constexpr int kGaussianNodes = 72;
// Legendre's rule of n nodes in A^2 is exact to rounding for J0(x A/sigma) up to about x = n - 30.
constexpr int kDiscNodesBeyond = 40;
// The series for the disc's edge is not accurate enough below this x.
constexpr double kMinDiscReach = 40;
constexpr int kMomentNodes = 32;

// Nodes of A^2 for a T of sigma 1, and their weights, which sum to 1.
struct Rule {
  Eigen::ArrayXd at, weight;
};

// Gauss rule after Golub and Welsch (1969) [L3], from the recurrence of the orthogonal polynomials.
// For a Gaussian, A^2/2 has the density exp(-x): the Laguerre polynomials. For a disc of radius 2,
// A^2 is uniform from 0 to 4: the Legendre polynomials.
Rule GaussRule(Psf psf, int nodes) {
  Eigen::VectorXd diagonal = Eigen::VectorXd::Zero(nodes), beside(nodes - 1);
  for (int k = 1; k < nodes; ++k)
    beside[k - 1] = psf == Psf::kDisc ? k / std::sqrt(4.0 * k * k - 1) : k;
  if (psf == Psf::kGaussian) {
    for (int k = 0; k < nodes; ++k) diagonal[k] = 2 * k + 1;
  }
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver;
  solver.computeFromTridiagonal(diagonal, beside);
  Rule rule{solver.eigenvalues().array(),
            solver.eigenvectors().row(0).transpose().array().square()};
  rule.at = psf == Psf::kDisc ? Eigen::ArrayXd(2 * (1 + rule.at)) : Eigen::ArrayXd(2 * rule.at);
  return rule;
}

using DiscEdge = PupilProfile::DiscEdge;

// The light under a law for a T of a given sigma: A^2, mm^2, and the share of the light at each
// node. The shares sum to 1.
struct Light {
  Eigen::ArrayXd square, share;
  double second_moment = 0;  // per axis, mm^2
};

class Law {
 public:
  Law(PupilLaw law, const PupilOptics& optics, const Rule& rule)
      : law_(law),
        rule_(rule),
        focus2_(optics.focus_depth_mm * optics.focus_depth_mm),
        distance2_(optics.image_distance_mm * optics.image_distance_mm),
        optics_(optics) {}

  Light Of(double transmission_sigma_mm) const {
    Light light{transmission_sigma_mm * transmission_sigma_mm * rule_.at, rule_.weight, 0};
    if (law_ == PupilLaw::kSineCondition) {
      // The nodes are those of d1 sin(beta), and A = d1 tan(beta). The Jacobian is cos^4(beta).
      const Eigen::ArrayXd sine2 = light.square / distance2_;
      light.share = (sine2 < kLargestSquaredSine).select(light.share, 0);
      light.square /= 1 - sine2.min(kLargestSquaredSine);
    } else if (law_ != PupilLaw::kUniform) {
      const Eigen::ArrayXd behind = 1 + light.square / distance2_;
      light.share /=
          law_ == PupilLaw::kCosineFourth
              ? Eigen::ArrayXd(behind.square())
              : Eigen::ArrayXd((1 + light.square / focus2_).sqrt() * behind * behind.sqrt());
    }
    light.share /= light.share.sum();
    light.second_moment = 0.5 * (light.share * light.square).sum();
    return light;
  }

  // Edge of a disc: the density of the light over u = A^2/sigma^2 at R^2, with its first two
  // derivatives. Inside the edge the density is w(u)/(sum of w over the rule) times the uniform
  // density.
  DiscEdge EdgeOf(const Light& light, double transmission_sigma_mm) const {
    const double sigma2 = light.second_moment;                             // mm^2
    const double end = 4 * transmission_sigma_mm * transmission_sigma_mm;  // end of the rule, mm^2
    // w is the product of (1 + A^2/a)^-m.
    double a[2] = {distance2_, focus2_}, m[2] = {0, 0};
    double edge = end, share = 1;
    switch (law_) {
      case PupilLaw::kUniform:
        break;
      case PupilLaw::kPaper:
        m[0] = 1.5, m[1] = 0.5;
        break;
      case PupilLaw::kCosineFourth:
        m[0] = 2;
        break;
      case PupilLaw::kSineCondition:  // uniform over v = A^2/(1 + A^2/d1^2): w = dv/dA^2
        m[0] = 2;
        edge = end / (1 - end / distance2_);
        break;
    }
    const auto w = [&](const Eigen::ArrayXd& square) {
      return Eigen::ArrayXd((1 + square / a[0]).pow(-m[0]) * (1 + square / a[1]).pow(-m[1]));
    };
    if (law_ != PupilLaw::kSineCondition)
      share = (rule_.weight * w(transmission_sigma_mm * transmission_sigma_mm * rule_.at)).sum();
    DiscEdge result;
    result.radius = std::sqrt(edge / sigma2);
    result.density = w(Eigen::ArrayXd::Constant(1, edge))[0] / share * sigma2 / end;
    double first = 0, second = 0;  // derivatives of ln w by u
    for (int i = 0; i < 2; ++i) {
      const double reach = (a[i] + edge) / sigma2;
      first -= m[i] / reach;
      second += m[i] / (reach * reach);
    }
    result.slope = result.density * first;
    result.bend = result.density * (first * first + second);
    return result;
  }

  // The mean of A divided by i. For a weight w(A, i) it is E[A_x d ln w/d i_x]. For the sine
  // condition it is the mean of d1 tan(beta) over rays whose direction cosines are symmetric about
  // those of the chief ray.
  double MeanPerLanding(const Light& light) const {
    const auto mean = [&light](const Eigen::ArrayXd& of) { return (light.share * of).sum(); };
    const Eigen::ArrayXd half = 0.5 * light.square;  // A_x^2, averaged over a circle
    switch (law_) {
      case PupilLaw::kUniform:
        return 0;
      case PupilLaw::kPaper:
        return mean(half * (1 / (optics_.defocus_scale_mm * optics_.focus_depth_mm *
                                 (1 + light.square / focus2_)) -
                            3 / (distance2_ + light.square)));
      case PupilLaw::kCosineFourth:
        return -4 * mean(half / (distance2_ + light.square));
      case PupilLaw::kSineCondition:
        break;
    }
    const Eigen::ArrayXd secant = (1 + light.square / distance2_).sqrt();  // 1/cos(beta)
    const Eigen::ArrayXd sine2 = 1 - 1 / secant.square();
    return mean(secant + sine2 / 2 * secant.cube()) - 1;
  }

 private:
  PupilLaw law_;
  const Rule& rule_;
  double focus2_, distance2_;
  const PupilOptics& optics_;
};

// Sigma, mm, of the T whose light has the second moment sigma^2. Throws Error if there is none.
double TransmissionSigmaMm(const Law& law, double sigma_mm) {
  double transmission_mm = sigma_mm;
  for (int i = 0; i < 500; ++i) {
    const double found_mm = std::sqrt(law.Of(transmission_mm).second_moment);
    const double next_mm = transmission_mm * sigma_mm / found_mm;
    if (!std::isfinite(next_mm) || next_mm > 20 * sigma_mm) break;
    const bool settled = std::abs(next_mm - transmission_mm) <= 4e-16 * sigma_mm;
    transmission_mm = next_mm;
    if (settled) return transmission_mm;
  }
  const double found_mm = std::sqrt(law.Of(transmission_mm).second_moment);
  if (std::abs(found_mm - sigma_mm) <= 1e-12 * sigma_mm) return transmission_mm;
  throw Error(
      fmt::format("pupil law: no aperture has a blur of sigma {} mm at this distance; the aperture "
                  "must be smaller relative to the image distance",
                  sigma_mm));
}

}  // namespace

const std::vector<PupilLaw>& AllPupilLaws() {
  static const std::vector<PupilLaw> laws = {PupilLaw::kUniform, PupilLaw::kPaper,
                                             PupilLaw::kCosineFourth, PupilLaw::kSineCondition};
  return laws;
}

std::string PupilLawName(PupilLaw law) {
  switch (law) {
    case PupilLaw::kUniform:
      return "uniform";
    case PupilLaw::kPaper:
      return "paper";
    case PupilLaw::kCosineFourth:
      return "cos4";
    case PupilLaw::kSineCondition:
      break;
  }
  return "sine";
}

PupilLaw PupilLawFromName(const std::string& name) {
  for (const PupilLaw law : AllPupilLaws()) {
    if (PupilLawName(law) == name) return law;
  }
  throw Error(
      fmt::format("pupil law \"{}\" is unknown: it must be uniform, paper, cos4 or sine", name));
}

PupilOptics PupilOpticsOf(const ThickLens& lens, Psf psf, double blur_ratio,
                          double focus_depth_mm) {
  return {psf, blur_ratio * lens.aperture_radius_mm, focus_depth_mm,
          ImageDistanceMm(lens, focus_depth_mm),
          lens.front_focal_length_mm / (1 - lens.front_focal_length_mm / focus_depth_mm)};
}

PupilProfile::PupilProfile(PupilLaw law, const PupilOptics& optics, double largest_x)
    : psf_(optics.psf) {
  if (!(optics.sigma_mm > 0) || !(optics.focus_depth_mm > 0) || !(optics.image_distance_mm > 0)) {
    throw Error(
        fmt::format("pupil profile: sigma_mm is {}, focus_depth_mm {}, image_distance_mm "
                    "{}: all must be > 0",
                    optics.sigma_mm, optics.focus_depth_mm, optics.image_distance_mm));
  }
  const bool is_disc = psf_ == Psf::kDisc;
  const double reach = is_disc ? std::max(largest_x, kMinDiscReach) : kGaussianReach;
  const Rule rule =
      GaussRule(psf_, is_disc ? static_cast<int>(reach) + kDiscNodesBeyond : kGaussianNodes);
  const Law of_light(law, optics, rule);
  const double transmission_mm = TransmissionSigmaMm(of_light, optics.sigma_mm);
  const Light light = of_light.Of(transmission_mm);
  transmission_ratio_ = transmission_mm / optics.sigma_mm;
  mean_per_landing_ = of_light.MeanPerLanding(light);
  if (is_disc) edge_ = of_light.EdgeOf(light, transmission_mm);
  for (Eigen::Index i = 0; i < light.square.size(); ++i) {
    if (light.share[i] > 0)
      rings_.push_back({std::sqrt(light.square[i]) / optics.sigma_mm, light.share[i]});
  }
  const int steps = static_cast<int>(std::ceil(reach / kTableStep)) + 3;
  table_.reserve(static_cast<std::size_t>(steps) + 1);
  for (int i = -1; i < steps; ++i) table_.push_back(Sum(i * kTableStep));
}

double PupilProfile::Sum(double x) const {
  double sum = 0;
  for (const Ring& ring : rings_) sum += ring.share * ::j0(x * ring.radius);
  return sum;
}

// [D26] Repeated integration by parts of H = integral of p(u) J0(x sqrt(u)) du from 0 to R^2 gives
// the sum over k of (-1)^k 2^(k + 1) p^(k)(R^2) R^(k + 1) J_(k+1)(x R)/x^(k + 1).
double PupilProfile::TransferOfEdge(double x) const {
  const double r = edge_.radius, at = x * r, per_x = r / x;
  return per_x * (2 * edge_.density * ::j1(at) +
                  per_x * (-4 * edge_.slope * ::jn(2, at) + per_x * 8 * edge_.bend * ::jn(3, at)));
}

double PupilProfile::Transfer(double x) const {
  const double position = x / kTableStep;
  const auto node = static_cast<std::size_t>(position);
  if (node + 4 > table_.size()) return psf_ == Psf::kDisc ? TransferOfEdge(x) : 0;
  const double t = position - static_cast<double>(node);
  const double* h = &table_[node];  // at t = -1, 0, 1, 2
  return -t * (t - 1) * (t - 2) / 6 * h[0] + (t + 1) * (t - 1) * (t - 2) / 2 * h[1] -
         (t + 1) * t * (t - 2) / 2 * h[2] + (t + 1) * t * (t - 1) / 6 * h[3];
}

double CentreOfPerspectiveMm(const ThickLens& lens, Psf psf, PupilLaw law, double blur_ratio,
                             double focus_depth_mm) {
  if (law == PupilLaw::kUniform || blur_ratio == 0) return 0;
  PupilOptics optics = PupilOpticsOf(lens, psf, blur_ratio, focus_depth_mm);
  optics.sigma_mm = std::min(optics.sigma_mm, kWidestPupil * optics.image_distance_mm);
  const Rule rule = GaussRule(psf, kMomentNodes);
  const Law of_light(law, optics, rule);
  const double mean =
      of_light.MeanPerLanding(of_light.Of(TransmissionSigmaMm(of_light, optics.sigma_mm)));
  const double shift_mm = mean * optics.defocus_scale_mm;
  return -shift_mm / (1 - shift_mm / focus_depth_mm);
}

}  // namespace thicklens::model

#include "model/simulate/sweep/edge_spread.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "thicklens/base/pi.h"
#include "thicklens/model/blur_transfer.h"

namespace thicklens::model {
namespace {

// A box this narrow blurs by less than 1e-11/sigma^2, and the division by it does not lose
// significant digits.
constexpr double kNarrowestBoxPx = 1e-5;

// Reach in sigmas: Phi(-9) = 1e-19.
constexpr double kGaussianReach = 9;

// [D33] Second antiderivative, px^2, of the normal distribution Phi(x/sigma), 0 at -infinity:
// [(x^2 + sigma^2) Phi + x sigma phi]/2. Derived by parts. Limit sigma = 0: max(x, 0)^2/2.
double GaussianSecondAntiderivative(double x, double sigma) {
  if (!(sigma > 0)) return x > 0 ? x * x / 2 : 0;
  const double t = x / sigma;
  const double cumulative = std::erfc(-t / std::sqrt(2.0)) / 2;
  const double density = std::exp(-t * t / 2) / std::sqrt(2 * kPi);
  return ((x * x + sigma * sigma) * cumulative + x * sigma * density) / 2;
}

// Second antiderivative [D33], px^2, of the step blurred by a disc of radius R, 1/2 + [u s + asin
// u]/pi, u = x/R, s = sqrt(1 - u^2). Derived by integrating twice: R^2 {u^2/4 + [(u^2/2 + 1/8) asin
// u + u s (13/24 + u^2/12)]/pi + 1/16}, and x^2/2 + R^2/8 behind the disc.
double DiscSecondAntiderivative(double x, double radius) {
  if (x <= -radius) return 0;
  if (x >= radius) return x * x / 2 + radius * radius / 8;
  const double u = x / radius;
  const double s = std::sqrt(1 - u * u);
  const double bracket = (u * u / 2 + 0.125) * std::asin(u) + u * s * (13.0 / 24 + u * u / 12);
  return radius * radius * (u * u / 4 + bracket / kPi + 1.0 / 16);
}

// Second antiderivative, px^2, of the step blurred by a ring of radius R, 1/2 + asin(u)/pi.
// Derived by integrating twice: R^2 {u^2/4 + [(u^2/2 + 1/4) asin u + 3/4 u s]/pi + 1/8}, and x^2/2
// + R^2/4 behind the ring.
double RingSecondAntiderivative(double x, double radius) {
  if (x <= -radius) return 0;
  if (x >= radius) return x * x / 2 + radius * radius / 4;
  const double u = x / radius;
  const double s = std::sqrt(1 - u * u);
  const double bracket = (u * u / 2 + 0.25) * std::asin(u) + 0.75 * u * s;
  return radius * radius * (u * u / 4 + bracket / kPi + 0.125);
}

}  // namespace

EdgeSpread::EdgeSpread(double angle_rad, double gaussian_sigma_px, double disc_radius_px,
                       bool pixel_box)
    : sigma_px_(gaussian_sigma_px), radius_px_(disc_radius_px), pixel_box_(pixel_box) {
  SetBoxes(angle_rad);
  reach_px_ = radius_px_ + kGaussianReach * sigma_px_ + (wide_box_px_ + narrow_box_px_) / 2;
  if (sigma_px_ > 0 && radius_px_ > 0) Tabulate(angle_rad);
}

EdgeSpread::EdgeSpread(double angle_rad, double gaussian_sigma_px, const PupilProfile& profile,
                       double defocus_sigma_px, bool pixel_box)
    : sigma_px_(gaussian_sigma_px),
      profile_(&profile),
      defocus_sigma_px_(defocus_sigma_px),
      pixel_box_(pixel_box) {
  SetBoxes(angle_rad);
  double light_px = kGaussianReach * defocus_sigma_px;
  if (profile.psf() == Psf::kDisc) {
    light_px = 0;
    for (const PupilProfile::Ring& ring : profile.rings())
      light_px = std::max(light_px, ring.radius * defocus_sigma_px);
  }
  reach_px_ = light_px + kGaussianReach * sigma_px_ + (wide_box_px_ + narrow_box_px_) / 2;
  if (sigma_px_ > 0 || profile.psf() == Psf::kGaussian) Tabulate(angle_rad);
}

// Sets the widths of the pixel box across the edge.
void EdgeSpread::SetBoxes(double angle_rad) {
  const double a = std::abs(std::cos(angle_rad));
  const double b = std::abs(std::sin(angle_rad));
  wide_box_px_ = std::max(a, b);
  narrow_box_px_ = std::max(std::min(a, b), kNarrowestBoxPx);
}

double EdgeSpread::DefocusTransferAt(double fx, double fy) const {
  return profile_ == nullptr ? DiscTransfer(radius_px_, fx, fy)
                             : profile_->Transfer(2 * kPi * defocus_sigma_px_ * std::hypot(fx, fy));
}

double EdgeSpread::SecondAntiderivative(double x) const {
  if (profile_ != nullptr) {
    double sum = 0;
    for (const PupilProfile::Ring& ring : profile_->rings())
      sum += ring.share * RingSecondAntiderivative(x, ring.radius * defocus_sigma_px_);
    return sum;
  }
  return radius_px_ > 0 ? DiscSecondAntiderivative(x, radius_px_)
                        : GaussianSecondAntiderivative(x, sigma_px_);
}

double EdgeSpread::BlurredStep(double x) const {
  if (profile_ != nullptr) {
    double sum = 0;
    for (const PupilProfile::Ring& ring : profile_->rings()) {
      const double u = std::clamp(x / (ring.radius * defocus_sigma_px_), -1.0, 1.0);
      sum += ring.share * (0.5 + std::asin(u) / kPi);
    }
    return sum;
  }
  if (radius_px_ > 0) {
    const double u = std::clamp(x / radius_px_, -1.0, 1.0);
    return 0.5 + (u * std::sqrt(1 - u * u) + std::asin(u)) / kPi;
  }
  if (sigma_px_ > 0) return std::erfc(-x / (std::sqrt(2.0) * sigma_px_)) / 2;
  return x == 0 ? 0.5 : x > 0 ? 1 : 0;
}

// The series is that of an edge at 0, an opposite edge at L/2, and so on with period L, behind a
// real transfer function T: 1/2 + sum over odd k of 2/(pi k) T(k/L) sin(2 pi k d/L). The two edges
// do not overlap for L > 4 reach.
void EdgeSpread::Tabulate(double angle_rad) {
  // For steps of sigma/40 the cubic between four nodes has an error of 1e-8, and the Gaussian ends
  // the series long before its highest term, 20/sigma cycles per px. The transfer function of a
  // Gaussian under a pupil law does so too.
  const double smooth_px = profile_ != nullptr && profile_->psf() == Psf::kGaussian
                               ? std::hypot(sigma_px_, 0.85 * defocus_sigma_px_)
                               : sigma_px_;
  const double wanted_step_px = std::max(smooth_px / 40, 1e-4);
  const double period_px = 4.1 * (reach_px_ + 4 * wanted_step_px);
  const int nodes =
      2 * cv::getOptimalDFTSize(static_cast<int>(std::ceil(period_px / wanted_step_px / 2)));
  table_step_px_ = period_px / nodes;

  // cv::dft packs the transform of real numbers as Re 0, Re 1, Im 1, ..., Re nodes/2.
  cv::Mat packed(1, nodes, CV_64F, cv::Scalar(0));
  double* coefficients = packed.ptr<double>();
  coefficients[0] = 0.5;
  for (int k = 1; k < nodes / 2; k += 2) {
    const double fx = k / period_px * std::cos(angle_rad);
    const double fy = k / period_px * std::sin(angle_rad);
    const double gaussian = GaussianTransfer(sigma_px_, fx, fy);
    if (gaussian < 1e-17) break;
    coefficients[2 * static_cast<std::size_t>(k)] = -gaussian * DefocusTransferAt(fx, fy) *
                                                    (pixel_box_ ? PixelBoxTransfer(fx, fy) : 1) /
                                                    (kPi * k);
  }
  cv::Mat edge;
  cv::dft(packed, edge, cv::DFT_INVERSE | cv::DFT_REAL_OUTPUT);

  const int half = static_cast<int>(std::ceil(reach_px_ / table_step_px_)) + 2;
  table_.reserve(2 * static_cast<std::size_t>(half) + 1);
  for (int i = -half; i <= half; ++i) table_.push_back(edge.at<double>(0, (i + nodes) % nodes));
}

double EdgeSpread::At(double distance_px) const {
  if (distance_px <= -reach_px_) return 0;
  if (distance_px >= reach_px_) return 1;
  if (!table_.empty()) {
    const double position =
        distance_px / table_step_px_ + static_cast<double>(table_.size() - 1) / 2;
    const auto node = static_cast<std::size_t>(position);
    const double t = position - static_cast<double>(node);
    const double* e = &table_[node - 1];  // nodes at t = -1, 0, 1, 2
    return -t * (t - 1) * (t - 2) / 6 * e[0] + (t + 1) * (t - 1) * (t - 2) / 2 * e[1] -
           (t + 1) * t * (t - 2) / 2 * e[2] + (t + 1) * t * (t - 1) / 6 * e[3];
  }
  if (!pixel_box_) return BlurredStep(distance_px);
  // On the dark side F is small; the bright side follows from E(d) + E(-d) = 1.
  const double d = -std::abs(distance_px);
  const double sum = (wide_box_px_ + narrow_box_px_) / 2;
  const double difference = (wide_box_px_ - narrow_box_px_) / 2;
  const double dark = (SecondAntiderivative(d + sum) - SecondAntiderivative(d + difference) -
                       SecondAntiderivative(d - difference) + SecondAntiderivative(d - sum)) /
                      (wide_box_px_ * narrow_box_px_);
  return distance_px > 0 ? 1 - dark : dark;
}

}  // namespace thicklens::model

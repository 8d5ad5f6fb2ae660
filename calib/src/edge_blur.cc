#include "thicklens/calib/edge_blur.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "edge_pixels.h"
#include "thicklens/model/blur_transfer.h"

namespace thicklens::calib {
namespace {

constexpr int kFewestEdges = 12;
constexpr double kPixelBoxVariance = 1.0 / 12;
// A central difference is a derivative seen through a box of 2 px along its axis: 2^2/12 px^2.
constexpr double kOperatorVariance = 1.0 / 3;

// The crest of a component of the gradient across an edge, by a parabola through the logarithms of
// three neighbours: exact for an edge blurred by a Gaussian. Nothing where they form no crest.
std::optional<double> Crest(const cv::Mat& component, cv::Point at, cv::Point step) {
  const double sign = component.at<float>(at) >= 0 ? 1 : -1;
  const double before = sign * component.at<float>(at - step);
  const double here = sign * component.at<float>(at);
  const double after = sign * component.at<float>(at + step);
  if (!(before > 0 && here > 0 && after > 0)) return std::nullopt;
  const double a = std::log(before), b = std::log(here), c = std::log(after);
  const double curvature = a - 2 * b + c;
  if (!(curvature < 0)) return std::nullopt;
  const double shift = 0.5 * (a - c) / curvature;
  if (!(std::abs(shift) <= 1)) return std::nullopt;
  return std::exp(b - 0.25 * (a - c) * shift);
}

// Variance of all blur together out of the ratio of the crests, px^2. `dominant` is cos^2 of the
// angle between the edge's normal and the axis of the difference.
//
// The boxes of pixel and operator are no Gaussians: with their fourth cumulant kappa4 (-w^4/120 for
// a box of width w) the crest of a profile of variance v is that of a Gaussian times 1 + kappa4/(8
// v^2) (Edgeworth, derived here). Left out, a blur of .5 px reads .53. Valid for v well above the
// boxes' own.
double TotalVariance(double ratio, double dominant, double reblur_sigma_px) {
  const double other = 1 - dominant;
  const double kappa4 = -(16 * dominant * dominant + dominant * dominant + other * other) / 120;
  const double reblur = reblur_sigma_px * reblur_sigma_px;
  const auto crest = [kappa4](double variance) { return 1 + kappa4 / (8 * variance * variance); };
  double variance = reblur / (ratio * ratio - 1);
  for (int round = 0; round < 2; ++round) {
    const double gaussian_ratio = ratio * crest(variance + reblur) / crest(variance);
    if (!(gaussian_ratio > 1)) break;
    variance = reblur / (gaussian_ratio * gaussian_ratio - 1);
  }
  return variance;
}

// Variances sigma_t^2 (all blur together, seen by the operator) less what is the operator's.
std::vector<double> EdgeVariances(const std::vector<cv::Point>& edges, const Gradient& sharp,
                                  const Gradient& reblurred, const EdgeScale& scale) {
  std::vector<double> variances;
  for (const cv::Point& edge : edges) {
    const double gx = sharp.x.at<float>(edge);
    const double gy = sharp.y.at<float>(edge);
    const bool along_x = std::abs(gx) >= std::abs(gy);
    const cv::Point step = along_x ? cv::Point(1, 0) : cv::Point(0, 1);
    const std::optional<double> peak = Crest(along_x ? sharp.x : sharp.y, edge, step);
    const std::optional<double> low = Crest(along_x ? reblurred.x : reblurred.y, edge, step);
    if (!peak || !low) continue;
    const double ratio = *peak / *low;
    if (!(ratio > 1)) continue;
    const double dominant = std::max(gx * gx, gy * gy) / (gx * gx + gy * gy);
    variances.push_back(TotalVariance(ratio, dominant, scale.reblur_sigma_px) -
                        scale.smoothing_sigma_px * scale.smoothing_sigma_px - kPixelBoxVariance -
                        dominant * kOperatorVariance);
  }
  return variances;
}

// Blurs a frame by exact transfer functions, mirrored at its borders.
class KnownBlur {
 public:
  KnownBlur(const cv::Mat& grey, model::Psf psf) : size_(grey.size()), psf_(psf), unblurred_(grey) {
    const int rows = cv::getOptimalDFTSize(grey.rows + 2 * kMargin);
    const int cols = cv::getOptimalDFTSize(grey.cols + 2 * kMargin);
    cv::Mat padded;
    cv::copyMakeBorder(grey, padded, kMargin, rows - grey.rows - kMargin, kMargin,
                       cols - grey.cols - kMargin, cv::BORDER_REFLECT_101);
    cv::dft(padded, spectrum_, cv::DFT_COMPLEX_OUTPUT);
  }

  cv::Mat Apply(double sigma_px) const {
    if (!(sigma_px > 0)) return unblurred_;
    cv::Mat product = spectrum_.clone();
    for (int y = 0; y < product.rows; ++y) {
      const double fy = std::min(y, product.rows - y) / static_cast<double>(product.rows);
      auto* row = product.ptr<cv::Vec2f>(y);
      for (int x = 0; x < product.cols; ++x) {
        const double fx = std::min(x, product.cols - x) / static_cast<double>(product.cols);
        row[x] *= static_cast<float>(model::DefocusTransfer(psf_, sigma_px, fx, fy));
      }
    }
    cv::Mat blurred;
    cv::dft(product, blurred, cv::DFT_INVERSE | cv::DFT_REAL_OUTPUT | cv::DFT_SCALE);
    return blurred(cv::Rect(kMargin, kMargin, size_.width, size_.height)).clone();
  }

 private:
  static constexpr int kMargin = 40;  // three of the widest blur's sigmas
  cv::Size size_;
  model::Psf psf_;
  cv::Mat unblurred_;
  cv::Mat spectrum_;
};

// Blurred frames have lost their noise; a frame to compare with has not.
cv::Mat WithNoise(const cv::Mat& grey, double noise_sigma) {
  if (!(noise_sigma > 0)) return grey;
  cv::RNG random(20081);
  cv::Mat noise(grey.size(), CV_32F);
  random.fill(noise, cv::RNG::NORMAL, 0, noise_sigma);
  return grey + noise;
}

// The largest variance that is measured at a scale when there is a coarser one.
double Reach(const EdgeScale& scale) { return scale.reblur_sigma_px * scale.reblur_sigma_px; }

// What a reference scaled about `centre` covers of a frame of the same size.
cv::Rect SharedRegion(cv::Size size, double scale, cv::Point2d centre) {
  const auto from = [&](double c) {
    return std::max(0, static_cast<int>(std::ceil((1 - scale) * c)));
  };
  const auto to = [&](double c, int n) {
    return std::min(n, static_cast<int>(std::floor(scale * (n - 1) + (1 - scale) * c)) + 1);
  };
  const cv::Point first(from(centre.x), from(centre.y));
  return {first, cv::Point(to(centre.x, size.width), to(centre.y, size.height))};
}

}  // namespace

std::optional<SourceEdgeBlur> MeasureSourceEdgeBlur(const cv::Mat& grey) {
  const Gradient sharp = CentralGradient(grey);
  const Gradient reblurred = CentralGradient(Smoothed(grey, 1));
  std::vector<double> sigmas;
  for (const cv::Point& edge : EdgePixels(sharp, 0.5 * Quantile(sharp.magnitude, 0.995), 8)) {
    const double ratio = sharp.magnitude.at<float>(edge) / reblurred.magnitude.at<float>(edge);
    if (ratio > 1 && std::isfinite(ratio)) sigmas.push_back(1 / std::sqrt(ratio * ratio - 1));
  }
  if (sigmas.size() < kFewestEdges) return std::nullopt;
  return SourceEdgeBlur{Median(sigmas), static_cast<int>(sigmas.size())};
}

std::optional<EdgeVariance> MeasureEdgeVariance(const cv::Mat& grey, const EdgeScale& scale) {
  const cv::Mat base = Smoothed(grey, scale.smoothing_sigma_px);
  const Gradient sharp = CentralGradient(base);
  const Gradient reblurred = CentralGradient(Smoothed(base, scale.reblur_sigma_px));
  const double threshold = 0.5 * Quantile(sharp.magnitude, 0.995);
  if (!(threshold > 0)) return std::nullopt;
  const int margin_px = static_cast<int>(std::ceil(4 * scale.reblur_sigma_px));
  const std::vector<double> variances =
      EdgeVariances(EdgePixels(sharp, threshold, margin_px), sharp, reblurred, scale);
  if (variances.size() < kFewestEdges) return std::nullopt;
  EdgeVariance result;
  result.edge_count = static_cast<int>(variances.size());
  result.variance_px2 = Median(variances);
  std::vector<double> deviations;
  deviations.reserve(variances.size());
  for (const double v : variances) deviations.push_back(std::abs(v - result.variance_px2));
  // 1.4826 MAD estimates the standard deviation, sqrt(pi/2) that of a median; neighbours along an
  // edge share their smoothing, so about one pixel in 2 sigma counts as independent.
  const double independent = std::max(1.0, result.edge_count / (2 * scale.reblur_sigma_px));
  result.error_px2 = 1.4826 * Median(deviations) * std::sqrt(CV_PI / 2 / independent);
  return result;
}

std::optional<EdgeVariance> MeasureEdgeVariance(const cv::Mat& grey) {
  const std::optional<EdgeVariance> fine = MeasureEdgeVariance(grey, kFineEdges);
  if (fine && fine->variance_px2 < Reach(kFineEdges)) return fine;
  const std::optional<EdgeVariance> coarse = MeasureEdgeVariance(grey, kCoarseEdges);
  return coarse ? coarse : fine;
}

std::optional<double> EdgeMeterSlope(const cv::Mat& grey, double noise_sigma, model::Psf psf) {
  constexpr double kAddedPx = 1.5;
  const std::optional<EdgeVariance> before = MeasureEdgeVariance(grey, kFineEdges);
  const std::optional<EdgeVariance> after =
      MeasureEdgeVariance(WithNoise(KnownBlur(grey, psf).Apply(kAddedPx), noise_sigma), kFineEdges);
  if (!before || !after) return std::nullopt;
  return (after->variance_px2 - before->variance_px2) / (kAddedPx * kAddedPx);
}

std::optional<EdgeVariance> MeasureAddedVariance(const cv::Mat& reference, const cv::Mat& frame,
                                                 double scale, cv::Point2d centre,
                                                 double noise_sigma, model::Psf psf) {
  cv::Mat scaled;
  const cv::Matx23d map(scale, 0, (1 - scale) * centre.x, 0, scale, (1 - scale) * centre.y);
  cv::warpAffine(reference, scaled, map, reference.size(), cv::INTER_LANCZOS4,
                 cv::BORDER_REFLECT_101);
  // Both are measured over what both show.
  const cv::Rect shared = SharedRegion(reference.size(), scale, centre);
  const KnownBlur known_blur(scaled(shared).clone(), psf);
  const cv::Mat measured = frame(shared);

  for (const EdgeScale& meter : {kFineEdges, kCoarseEdges}) {
    const auto reading = MeasureEdgeVariance(measured, meter);
    if (!reading) continue;
    const auto reading_at = [&](double added_px2) {
      return MeasureEdgeVariance(WithNoise(known_blur.Apply(std::sqrt(added_px2)), noise_sigma),
                                 meter);
    };
    // Secant steps on the added variance, starting from none and from 1 px^2.
    double low_px2 = 0, high_px2 = 1;
    auto low = reading_at(low_px2), high = reading_at(high_px2);
    std::optional<EdgeVariance> found;
    for (int step = 0; step < 8 && low && high; ++step) {
      const double slope = (high->variance_px2 - low->variance_px2) / (high_px2 - low_px2);
      if (!(slope > 0.1)) break;  // the meter saturates
      const double next_px2 = low_px2 + (reading->variance_px2 - low->variance_px2) / slope;
      found = EdgeVariance{next_px2, reading->error_px2 / slope, reading->edge_count};
      const double change_px2 = std::abs(next_px2 - high_px2);
      // Sharper than the reference: nothing can be taken out of it, the slope at 0 is carried on.
      if (next_px2 <= 0 || change_px2 < 0.02 + 0.01 * next_px2) break;
      const double bounded_px2 = std::min(next_px2, 3 * high_px2 + 1);
      low = high;
      low_px2 = high_px2;
      high_px2 = bounded_px2;
      high = reading_at(high_px2);
      found.reset();
    }
    if (!found) continue;
    if (meter.reblur_sigma_px == kFineEdges.reblur_sigma_px && found->variance_px2 > Reach(meter))
      continue;
    return found;
  }
  return std::nullopt;
}

}  // namespace thicklens::calib

#include "calib/fit/blur_examples.h"

#include <algorithm>
#include <cmath>

#include "calib/edges/edge_spread.h"

namespace thicklens::calib {
namespace {

// Number of a frame's features in which a straight edge is sought.
constexpr int kMaxFeatures = 8;
// Part of an edge's profile that is shown on each side.
constexpr double kShownSigmas = 4, kShownBeyondPx = 1.5;

BlurExample TransferExample(model::Psf stated, const FittedRegion& other,
                            const BlurEvidence& evidence, std::size_t i) {
  const EstimatorRegion& region = evidence.region;
  const RelativeBlur& blur = evidence.blur;
  const auto reference = static_cast<Eigen::Index>(region.reference);
  const double scale = region.samples[i].scale;
  const auto in_other =
      std::find(other.region.frames.begin(), other.region.frames.end(), region.frames[i]);
  const bool has_other = other.blur.done && in_other != other.region.frames.end();
  // Returns the transfer of the fitted frame over that of the reference.
  const auto ratio = [&](model::Psf psf, double variance, double reference_variance, double nu) {
    const RelativeBlurOptions options = SpectralOptions(psf, evidence.assumed_floor_px2, 1);
    return BlurTransfer(options, variance, scale, nu) /
           BlurTransfer(options, reference_variance, 1, nu);
  };
  const auto ratio_of_other = [&](double nu) {
    const Eigen::VectorXd& v = other.blur.variances_px2;
    return ratio(OtherPsf(stated), v[in_other - other.region.frames.begin()],
                 v[static_cast<Eigen::Index>(other.region.reference)], nu);
  };
  const bool is_gaussian = stated == model::Psf::kGaussian;
  const RelativeBlurOptions options = SpectralOptions(stated, evidence.assumed_floor_px2, 1);
  BlurExample example;
  example.frame = static_cast<int>(evidence.spectral.frames[region.frames[i]].frame);
  for (const TransferRing& ring :
       MeasuredTransfer(region.samples[i], blur, i, blur.variances_px2[reference], region.window,
                        region.modes, region.leakage)) {
    const double by_stated = ratio(stated, blur.variances_px2[static_cast<Eigen::Index>(i)],
                                   blur.variances_px2[reference], ring.nu);
    const double by_other = has_other ? ratio_of_other(ring.nu) : by_stated;
    example.x.push_back(ring.nu / scale);
    example.measured.push_back(ring.measured /
                               BlurTransfer(options, blur.variances_px2[reference], 1, ring.nu));
    example.gaussian.push_back(is_gaussian ? by_stated : by_other);
    if (has_other || !is_gaussian) example.disc.push_back(is_gaussian ? by_other : by_stated);
  }
  return example;
}

// Returns the fitted profile at a distance by linear interpolation between its points, which are in
// rising order.
double FittedAt(const EdgeSpreadFit& fit, double distance_px) {
  const auto after = std::lower_bound(fit.distance_px.begin(), fit.distance_px.end(), distance_px);
  if (after == fit.distance_px.begin()) return fit.fitted.front();
  if (after == fit.distance_px.end()) return fit.fitted.back();
  const auto i = static_cast<std::size_t>(after - fit.distance_px.begin());
  const double before_px = fit.distance_px[i - 1];
  const double t = (distance_px - before_px) / std::max(*after - before_px, 1e-12);
  return fit.fitted[i - 1] + t * (fit.fitted[i] - fit.fitted[i - 1]);
}

}  // namespace

void AddTransferExamples(model::Psf stated, const FittedRegion& other, BlurEvidence* evidence) {
  const BlurFitSetup& setup = evidence->setup;
  const std::vector<std::size_t>& frames = evidence->region.frames;
  const double sign = model::DirectionSign(setup.direction);
  const auto is_nearer = [&](std::size_t a, std::size_t b) {
    return sign * setup.frames[evidence->fit_index[a]].reading_mm <
           sign * setup.frames[evidence->fit_index[b]].reading_mm;
  };
  const auto [nearest, farthest] = std::minmax_element(frames.begin(), frames.end(), is_nearer);
  for (const std::size_t i :
       {static_cast<std::size_t>(nearest - frames.begin()), evidence->region.reference,
        static_cast<std::size_t>(farthest - frames.begin())})
    evidence->examples.push_back(TransferExample(stated, other, *evidence, i));
}

std::optional<EdgeComparison> EdgeExample(const cv::Mat& grey, std::size_t frame, model::Psf stated,
                                          double floor_px) {
  for (const EdgeFeature& feature : FindEdges(grey, kMaxFeatures)) {
    if (feature.kind != EdgeFeature::Kind::kEdge) continue;
    const auto fit = FitEdgeSpread(grey, feature, stated, floor_px, true);
    if (!fit || fit->distance_px.empty()) continue;
    EdgeComparison comparison;
    BlurExample& example = comparison.curves;
    example.frame = static_cast<int>(frame);
    example.is_edge = true;
    const bool is_gaussian = stated == model::Psf::kGaussian;
    const auto other = FitEdgeSpread(grey, feature, OtherPsf(stated), floor_px, true);
    const bool has_other = other && !other->fitted.empty();
    const double sigma_px = fit->across_x ? fit->across_x->sigma_px : fit->across_y->sigma_px;
    for (std::size_t i = 0; i < fit->distance_px.size(); ++i) {
      const double distance_px = fit->distance_px[i];
      // The plateaus farther out give no information.
      if (std::abs(distance_px) > kShownSigmas * sigma_px + kShownBeyondPx) continue;
      const double by_other = has_other ? FittedAt(*other, distance_px) : fit->fitted[i];
      example.x.push_back(distance_px);
      example.measured.push_back(fit->level[i]);
      example.gaussian.push_back(is_gaussian ? fit->fitted[i] : by_other);
      example.disc.push_back(is_gaussian ? by_other : fit->fitted[i]);
    }
    (is_gaussian ? comparison.gaussian_chi2 : comparison.disc_chi2) = fit->chi2_per_dof;
    if (has_other)
      (is_gaussian ? comparison.disc_chi2 : comparison.gaussian_chi2) = other->chi2_per_dof;
    return comparison;
  }
  return std::nullopt;
}

}  // namespace thicklens::calib

#include "calib/uncertainty/blur_choices.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "calib/fit/blur_examples.h"
#include "calib/uncertainty/astigmatism.h"

namespace thicklens::calib {
namespace {

constexpr double kNarrowPart = 0.5;     // part of the usual band
constexpr double kLeakageMargin = 1.4;  // factor on the largest sigma expected

// Disc and Gaussian are compared over the disc's band, the narrower one.
double CommonPart(model::Psf psf) { return UsualBand(model::Psf::kDisc) / UsualBand(psf); }

class Choices {
 public:
  Choices(model::Psf stated, BlurEvidence* evidence) : stated_(stated), evidence_(*evidence) {}

  void Run() {
    if (evidence_.spectrum < 0 || evidence_.region.samples.empty()) return;
    if (!LeaveOutRejected()) return;
    if (const FittedRegion narrow = FitAny(stated_, kNarrowPart); narrow.blur.done)
      evidence_.narrow_band = FitSamples(evidence_, narrow.blur, narrow.region);
    CompareShapes();
  }

 private:
  BlurSamples& Samples() {
    return evidence_.setup.estimators[static_cast<std::size_t>(evidence_.spectrum)];
  }

  bool IsKept(std::size_t estimator_frame) {
    const std::vector<std::size_t>& kept = Samples().frames;
    return std::find(kept.begin(), kept.end(), evidence_.fit_index[estimator_frame]) != kept.end();
  }

  FittedRegion Fit(model::Psf psf, double part) const {
    return FitRegion(evidence_.region, SpectralOptions(psf, evidence_.assumed_floor_px2, part));
  }

  // Fits with the mean of the variances along both axes where the estimator uses it.
  FittedRegion FitAny(model::Psf psf, double part) const {
    return evidence_.axial ? FitMean(psf, part, evidence_.axial->leakage) : Fit(psf, part);
  }

  FittedRegion FitMean(model::Psf psf, double part, const AxisLeakage& leakage,
                       AxialBlur* axes = nullptr) const {
    RelativeBlurOptions options = SpectralOptions(psf, evidence_.assumed_floor_px2, part);
    options.hold_gains = evidence_.axial->gains_are_held;
    FittedAxes fitted = FitRegionAlongAxes(evidence_.region, leakage, options);
    FittedRegion mean{std::move(fitted.region), MeanOfAxes(fitted.blur)};
    if (axes != nullptr) *axes = std::move(fitted.blur);
    return mean;
  }

  // Returns false where the reference itself was rejected, because everything refers to it.
  bool LeaveOutRejected() {
    EstimatorRegion& region = evidence_.region;
    if (!IsKept(region.frames[region.reference])) return false;
    if (std::all_of(region.frames.begin(), region.frames.end(),
                    [this](std::size_t f) { return IsKept(f); }))
      return true;
    EstimatorRegion kept = PartOf(
        region, [this](std::size_t f) { return IsKept(f); }, [](const Mode&) { return true; });
    std::swap(region, kept);
    AxialBlur axes;
    FittedRegion fitted =
        evidence_.axial ? FitMean(stated_, 1, evidence_.axial->leakage, &axes) : Fit(stated_, 1);
    std::swap(region, kept);
    if (!fitted.blur.done) return false;
    ReplaceSpectralBlur(std::move(fitted.region), std::move(fitted.blur), &evidence_);
    if (evidence_.axial) evidence_.axial->blur = std::move(axes);
    return true;
  }

  // Compares both shapes over the same band, each with its own leakage.
  void CompareShapes() {
    const RelativeBlur as_stated = FitAny(stated_, CommonPart(stated_)).blur;
    const FittedRegion other = FitOtherShape();
    const RelativeBlur& as_other = other.blur;
    if (as_stated.done && as_other.done) {
      const bool is_gaussian = stated_ == model::Psf::kGaussian;
      evidence_.other_psf = FitSamples(evidence_, as_other, other.region);
      evidence_.gaussian_misfit = (is_gaussian ? as_stated : as_other).chi2_per_dof;
      evidence_.disc_misfit = (is_gaussian ? as_other : as_stated).chi2_per_dof;
      evidence_.shape_dof = DegreesOfFreedom(as_stated);
      evidence_.better_psf = *evidence_.gaussian_misfit <= *evidence_.disc_misfit
                                 ? model::Psf::kGaussian
                                 : model::Psf::kDisc;
    }
    AddTransferExamples(stated_, other, &evidence_);
  }

  // Counts the real and the imaginary part of each mode of each frame, minus those of the texture.
  static double DegreesOfFreedom(const RelativeBlur& blur) {
    const double used = std::accumulate(blur.modes_used.begin(), blur.modes_used.end(), 0.0);
    return std::max(0.0, 2 * (used - static_cast<double>(blur.texture.size())));
  }

  FittedRegion FitOtherShape() {
    EstimatorRegion& region = evidence_.region;
    const SpectralEstimatorSetup& estimator = evidence_.spectral;
    double largest = 0;
    for (const std::size_t f : region.frames)
      largest = std::max(largest, estimator.frames[f].expected_variance_px2);
    if (evidence_.axial) {
      SpectralEstimatorSetup other = estimator;
      other.psf = OtherPsf(stated_);
      const Eigen::Matrix2Xd& variances = evidence_.axial->blur.variances_px2;
      return FitMean(
          other.psf, CommonPart(other.psf),
          MeasureAxisLeakage(other, region, variances.maxCoeff() - variances.minCoeff()));
    }
    WindowLeakage leakage(estimator.read_grey(estimator.frames[estimator.reference].frame),
                          estimator.origin_px, region.window, region.modes,
                          region.samples[region.reference].spectrum, OtherPsf(stated_),
                          kLeakageMargin * std::sqrt(largest) + 0.5, estimator.threads);
    std::swap(region.leakage, leakage);
    FittedRegion fit = Fit(OtherPsf(stated_), CommonPart(OtherPsf(stated_)));
    std::swap(region.leakage, leakage);
    return fit;
  }

  model::Psf stated_;
  BlurEvidence& evidence_;
};

}  // namespace

void CompareChoices(model::Psf stated, BlurEvidence* evidence) { Choices(stated, evidence).Run(); }

}  // namespace thicklens::calib

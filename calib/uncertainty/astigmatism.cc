#include "calib/uncertainty/astigmatism.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "calib/fit/axial_focus.h"
#include "calib/fit/frame_outliers.h"
#include "calib/fit/misfit_causes.h"
#include "calib/uncertainty/evenly_spread.h"
#include "calib/uncertainty/systematic_advice.h"
#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinAxialFrames = 5;
constexpr std::size_t kMaxAxialFrames = 128;  // the time grows with their square
constexpr int kMinAxialModes = 16;            // of a frame
// Chi^2 per degree of freedom of the spectra with one variance for all directions. Below it, what
// an astigmatism changes in the results is smaller than their errors from noise. Simulated sweeps
// of isotropic lenses have 0.7 to 1.5.
constexpr double kMisfitOfOneVariance = 1.5;
constexpr double kRatiosDiffer = 3;  // standard deviations
constexpr double kBeyondDoubt = 4;   // standard deviations of the difference of both foci
constexpr double kMovesOfFocus = 3;  // standard deviations of a focus

bool Has(const std::vector<std::size_t>& sorted, std::size_t value) {
  return std::binary_search(sorted.begin(), sorted.end(), value);
}

EstimatorRegion WithFrames(const EstimatorRegion& region, const std::vector<std::size_t>& sorted) {
  return PartOf(
      region, [&](std::size_t f) { return Has(sorted, f); }, [](const Mode&) { return true; });
}

// The spectra of a sweep with two variances per frame.
class AxialMeasurement {
 public:
  AxialMeasurement(const FocusSweep& sweep, const BlurEvidence& evidence)
      : sweep_(sweep), evidence_(evidence) {}

  bool Run() {
    if (evidence_.spectrum < 0 || !ChooseFrames()) return false;
    MeasureLeakage();
    const RelativeBlurOptions options = OptionsOf(sweep_.camera.psf, evidence_);
    FittedAxes fitted = FitRegionAlongAxes(std::move(region_), leakage_, options);
    region_ = std::move(fitted.region);
    blur_ = std::move(fitted.blur);
    return blur_.done;
  }

  // Fits the laws along both axes to the frames that follow them.
  std::optional<AxialFocus> Focus(double floor_px2) const {
    return FocusAlongAxes(evidence_, region_.frames, blur_, floor_px2);
  }

  static RelativeBlurOptions OptionsOf(model::Psf psf, const BlurEvidence& evidence) {
    return SpectralOptions(psf, evidence.assumed_floor_px2, 1);
  }

  static std::optional<AxialFocus> FocusAlongAxes(const BlurEvidence& evidence,
                                                  const std::vector<std::size_t>& region_frames,
                                                  AxialBlur blur, double floor_px2) {
    std::vector<std::size_t> frames;
    for (const std::size_t f : region_frames) frames.push_back(evidence.fit_index[f]);
    const std::vector<std::size_t> kept = SamplesOnParabolas(evidence.setup, frames, blur);
    if (kept.size() < kMinAxialFrames) return std::nullopt;
    std::vector<Eigen::Index> columns, rows;
    std::vector<std::size_t> kept_frames;
    for (const std::size_t i : kept) {
      const auto index = static_cast<Eigen::Index>(i);
      kept_frames.push_back(frames[i]);
      columns.push_back(index);
      rows.push_back(2 * index);
      rows.push_back(2 * index + 1);
    }
    blur.variances_px2 = Eigen::Matrix2Xd(blur.variances_px2(Eigen::all, columns));
    blur.covariance = Eigen::MatrixXd(blur.covariance(rows, rows));
    BlurFitSetup setup = evidence.setup;
    setup.estimators.clear();
    setup.half_astigmatism_per_mm = 0;  // each axis follows the law alone
    setup.floor_variance_px2 = model::Estimate{floor_px2, 0};
    AxialFocus focus = FitAxialFocus(setup, kept_frames, blur);
    if (!focus.done) return std::nullopt;
    return focus;
  }

  // Fits once more with the gains held where the shape of the blur is not that of the family: a
  // halo takes contrast at all frequencies alike, more of it along one axis than along the other,
  // and one gain for both would mix them. Returns the blur before, if the new fit was possible.
  std::optional<RelativeBlur> HoldGainsOfOtherShapes() {
    if (!(blur_.chi2_per_dof > kLargestMisfitOfShape)) return std::nullopt;
    RelativeBlurOptions options = OptionsOf(sweep_.camera.psf, evidence_);
    options.hold_gains = true;
    const AxialBlur held = FitAxialBlur(region_.samples, region_.reference, region_.window,
                                        region_.modes, leakage_, options);
    if (!held.done) return std::nullopt;
    RelativeBlur free = MeanOfAxes(blur_);
    blur_ = held;
    return free;
  }

  EstimatorRegion& region() { return region_; }
  AxisLeakage& leakage() { return leakage_; }
  AxialBlur& blur() { return blur_; }
  const std::vector<std::size_t>& thinned_out() const { return thinned_out_; }

 private:
  // Evenly spread frames of a long sweep, with the fitted blur as the start along both axes.
  bool ChooseFrames() {
    const EstimatorRegion& all = evidence_.region;
    std::vector<std::size_t> chosen;
    for (const std::size_t i : EvenlySpread(all.frames.size(), all.reference, kMaxAxialFrames))
      chosen.push_back(all.frames[i]);
    for (const std::size_t f : all.frames) {
      if (!Has(chosen, f)) thinned_out_.push_back(evidence_.fit_index[f]);
    }
    region_ = WithFrames(all, chosen);
    for (std::size_t i = 0; i < region_.frames.size(); ++i) {
      const auto index = std::find(all.frames.begin(), all.frames.end(), region_.frames[i]);
      region_.samples[i].start_variance_px2 =
          evidence_.blur.variances_px2[static_cast<Eigen::Index>(index - all.frames.begin())];
    }
    return region_.frames.size() >= kMinAxialFrames && !region_.modes.empty();
  }

  void MeasureLeakage() {
    double least = std::numeric_limits<double>::infinity(), most = -least;
    for (const SpectrumSample& sample : region_.samples) {
      least = std::min(least, sample.start_variance_px2);
      most = std::max(most, sample.start_variance_px2);
    }
    // Along one axis the blur may have twice the variance of the mean of both.
    leakage_ = MeasureAxisLeakage(evidence_.spectral, region_, 2 * (most - least));
  }

  const FocusSweep& sweep_;
  const BlurEvidence& evidence_;
  EstimatorRegion region_;
  AxisLeakage leakage_;
  AxialBlur blur_;
  std::vector<std::size_t> thinned_out_;
};

// Whether both foci differ beyond doubt, and by enough to move one focus for both by its own error.
bool MovesTheFocus(const AxialFocus& focus) {
  return std::abs(focus.difference_mm.value) >
         std::max(kBeyondDoubt * focus.difference_mm.sigma,
                  kMovesOfFocus *
                      std::min(focus.focus_depth_mm[0].sigma, focus.focus_depth_mm[1].sigma));
}

Eigen::Vector2d From0(double a, double b) { return {std::min({0.0, a, b}), std::max({0.0, a, b})}; }

// Without the mean of both variances, the interval of zf includes the middle between both foci, and
// that of kappa both ratios. With it, zf is the mean of both foci in 1/z, the interval includes
// their mean in z, and both ratios only where they differ beyond their errors.
void Widen(const FocusSweep& sweep, const BlurEvidence& evidence, const BlurFitResult& fit,
           Calibration* calibration) {
  const FieldMap& map = calibration->diagnostics.field;
  const AxisFocus& x = *map.along_x;
  const AxisFocus& y = *map.along_y;
  const double middle_mm = 0.5 * (x.focus_depth_mm.value + y.focus_depth_mm.value);
  const double zf = fit.values[kFocusDepth], kappa = fit.values[kBlurRatio];
  double focus_move_mm = middle_mm - zf;
  Eigen::Vector2d ratio_moves = From0(x.blur_ratio.value - kappa, y.blur_ratio.value - kappa);
  if (evidence.axial) {
    // Both are without the error of the fitted zf, which the statistical sigma contains.
    focus_move_mm = middle_mm - 2 / (1 / x.focus_depth_mm.value + 1 / y.focus_depth_mm.value);
    if (std::abs(x.blur_ratio.value - y.blur_ratio.value) <
        kRatiosDiffer * std::hypot(x.blur_ratio.sigma, y.blur_ratio.sigma))
      ratio_moves.setZero();
  }
  WidenFocusAndRatio("astigmatism", From0(focus_move_mm, 0), ratio_moves,
                     "focus is at two depths: restrict roi_px to the middle of the field, or use a "
                     "smaller aperture or another lens",
                     sweep.camera.lens, calibration);
}

}  // namespace

FittedAxes FitRegionAlongAxes(EstimatorRegion region, const AxisLeakage& leakage,
                              const RelativeBlurOptions& options) {
  FittedAxes fitted{std::move(region), {}};
  while (fitted.region.frames.size() >= kMinAxialFrames) {
    const EstimatorRegion& now = fitted.region;
    fitted.blur = FitAxialBlur(now.samples, now.reference, now.window, now.modes, leakage, options);
    if (!fitted.blur.done) return fitted;
    const Eigen::VectorXd& noise = fitted.blur.noise_ratio;
    const double typical = Median(std::vector<double>(noise.begin(), noise.end()));
    std::vector<std::size_t> kept;
    for (std::size_t i = 0; i < now.frames.size(); ++i) {
      const auto index = static_cast<Eigen::Index>(i);
      const bool fits = !IsDamage(noise[index] / typical, fitted.blur.misfit[index]);
      if (i == now.reference || (fits && fitted.blur.modes_used[i] >= kMinAxialModes))
        kept.push_back(now.frames[i]);
    }
    if (kept.size() == now.frames.size()) return fitted;
    fitted.region = WithFrames(now, kept);
  }
  fitted.blur.done = false;
  fitted.blur.message = "the texture along x and along y is lost in blur or noise";
  return fitted;
}

bool TakeMeanOfAxes(const FocusSweep& sweep, BlurEvidence* evidence) {
  // Edges are measured in their own directions.
  if (evidence->spectrum < 0 || evidence->edges >= 0 ||
      !(evidence->blur.chi2_per_dof > kMisfitOfOneVariance))
    return false;
  AxialMeasurement axial(sweep, *evidence);
  if (!axial.Run()) return false;
  const std::optional<RelativeBlur> free_gains = axial.HoldGainsOfOtherShapes();
  const std::optional<AxialFocus> focus = axial.Focus(evidence->assumed_floor_px2);
  if (!focus || !MovesTheFocus(*focus)) return false;
  evidence->setup.half_astigmatism_per_mm =
      0.5 * (1 / focus->focus_depth_mm[0].value - 1 / focus->focus_depth_mm[1].value);
  evidence->axial = AxialEvidence{std::move(axial.leakage()), std::move(axial.blur()),
                                  axial.thinned_out(), free_gains.has_value(), std::nullopt};
  if (free_gains) evidence->axial->free_gains = FitSamples(*evidence, *free_gains, axial.region());
  const AxialBlur& blur = evidence->axial->blur;
  NoteScatter(axial.region(), blur.noise_ratio, blur.misfit, evidence);
  ReplaceSpectralBlur(std::move(axial.region()), MeanOfAxes(blur), evidence);
  return true;
}

void MeasureAstigmatism(const FocusSweep& sweep, const BlurEvidence& evidence,
                        const BlurFitResult& fit, Calibration* calibration) {
  std::optional<AxialFocus> focus;
  const double floor_px2 = fit.values[kFloorVariance];
  if (evidence.axial) {
    focus = AxialMeasurement::FocusAlongAxes(evidence, evidence.region.frames, evidence.axial->blur,
                                             floor_px2);
  } else {
    AxialMeasurement axial(sweep, evidence);
    if (axial.Run()) focus = axial.Focus(floor_px2);
  }
  if (!focus) return;
  FieldMap& map = calibration->diagnostics.field;
  map.astigmatism_mm = focus->difference_mm;
  map.along_x = AxisFocus{focus->focus_depth_mm[0], focus->blur_ratio[0]};
  map.along_y = AxisFocus{focus->focus_depth_mm[1], focus->blur_ratio[1]};
  const std::string warning = AstigmatismInWords(*calibration);
  if (warning.empty()) return;
  calibration->summary.warnings.push_back(warning);
  Widen(sweep, evidence, fit, calibration);
}

}  // namespace thicklens::calib

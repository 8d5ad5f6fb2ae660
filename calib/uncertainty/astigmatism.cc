#include "calib/uncertainty/astigmatism.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "calib/fit/axial_focus.h"
#include "calib/fit/misfit_causes.h"
#include "calib/uncertainty/evenly_spread.h"
#include "calib/uncertainty/systematic_advice.h"
#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinAxialFrames = 5;
constexpr std::size_t kMaxAxialFrames = 128;  // the time grows with their square
constexpr int kMinAxialModes = 16;            // of a frame
constexpr double kAxialScatterOfDamage = 30;  // times the typical scatter, in power

class Astigmatism {
 public:
  Astigmatism(const FocusSweep& sweep, const BlurEvidence& evidence, const BlurFitResult& fit,
              Calibration* calibration)
      : sweep_(sweep), evidence_(evidence), fit_(fit), result_(*calibration) {}

  void Run() {
    if (evidence_.spectrum < 0 || !ChooseFrames()) return;
    MeasureLeakage();
    AxialBlur blur;
    if (!FitBlurAlongAxes(&blur) || !KeepSamplesOnLaw(&blur)) return;
    BlurFitSetup setup = evidence_.setup;
    setup.estimators.clear();
    setup.floor_variance_px2 = model::Estimate{fit_.values[kFloorVariance], 0};
    const AxialFocus focus = FitAxialFocus(setup, FramesOfFit(), blur);
    if (!focus.done) return;
    FieldMap& map = result_.diagnostics.field;
    map.astigmatism_mm = focus.difference_mm;
    map.along_x = AxisFocus{focus.focus_depth_mm[0], focus.blur_ratio[0]};
    map.along_y = AxisFocus{focus.focus_depth_mm[1], focus.blur_ratio[1]};
    const std::string warning = AstigmatismInWords(result_);
    if (warning.empty()) return;
    result_.summary.warnings.push_back(warning);
    Widen();
  }

 private:
  // Evenly spread frames of a long sweep, with the fitted blur as the start along both axes.
  bool ChooseFrames() {
    const EstimatorRegion& all = evidence_.region;
    std::vector<std::size_t> chosen;
    for (const std::size_t i : EvenlySpread(all.frames.size(), all.reference, kMaxAxialFrames))
      chosen.push_back(all.frames[i]);
    region_ = PartOf(
        all, [&](std::size_t f) { return std::binary_search(chosen.begin(), chosen.end(), f); },
        [](const Mode&) { return true; });
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

  // Leaves out the frames that have almost no mode in the band or do not show what the others show.
  bool FitBlurAlongAxes(AxialBlur* blur) {
    const RelativeBlurOptions options =
        SpectralOptions(sweep_.camera.psf, evidence_.assumed_floor_px2, 1);
    while (region_.frames.size() >= kMinAxialFrames) {
      *blur = FitAxialBlur(region_.samples, region_.reference, region_.window, region_.modes,
                           leakage_, options);
      if (!blur->done) return false;
      const double typical =
          Median(std::vector<double>(blur->noise_ratio.begin(), blur->noise_ratio.end()));
      std::vector<std::size_t> kept;
      for (std::size_t i = 0; i < region_.frames.size(); ++i) {
        const bool fits =
            blur->noise_ratio[static_cast<Eigen::Index>(i)] <= kAxialScatterOfDamage * typical;
        if (i == region_.reference || (fits && blur->modes_used[i] >= kMinAxialModes))
          kept.push_back(region_.frames[i]);
      }
      if (kept.size() == region_.frames.size()) return true;
      region_ = PartOf(
          region_, [&](std::size_t f) { return std::binary_search(kept.begin(), kept.end(), f); },
          [](const Mode&) { return true; });
    }
    return false;
  }

  std::vector<std::size_t> FramesOfFit() const {
    std::vector<std::size_t> frames;
    for (const std::size_t f : region_.frames) frames.push_back(evidence_.fit_index[f]);
    return frames;
  }

  bool KeepSamplesOnLaw(AxialBlur* blur) {
    const std::vector<std::size_t> kept = SamplesOnParabolas(evidence_.setup, FramesOfFit(), *blur);
    std::vector<Eigen::Index> columns, rows;
    std::vector<std::size_t> frames;
    for (const std::size_t i : kept) {
      const auto index = static_cast<Eigen::Index>(i);
      frames.push_back(region_.frames[i]);
      columns.push_back(index);
      rows.push_back(2 * index);
      rows.push_back(2 * index + 1);
    }
    region_.frames = std::move(frames);
    blur->variances_px2 = Eigen::Matrix2Xd(blur->variances_px2(Eigen::all, columns));
    blur->covariance = Eigen::MatrixXd(blur->covariance(rows, rows));
    return kept.size() >= kMinAxialFrames;
  }

  // The interval of zf includes the middle between both foci, and that of kappa both ratios.
  void Widen() {
    const FieldMap& map = result_.diagnostics.field;
    const double middle_mm =
        0.5 * (map.along_x->focus_depth_mm.value + map.along_y->focus_depth_mm.value);
    const double zf = fit_.values[kFocusDepth], kappa = fit_.values[kBlurRatio];
    const auto from_0 = [](double a, double b) {
      return Eigen::Vector2d(std::min({0.0, a, b}), std::max({0.0, a, b}));
    };
    WidenFocusAndRatio(
        "astigmatism", from_0(middle_mm - zf, 0),
        from_0(map.along_x->blur_ratio.value - kappa, map.along_y->blur_ratio.value - kappa),
        "focus is at two depths: restrict roi_px to the middle of the field, or use a "
        "smaller aperture or another lens",
        sweep_.camera.lens, &result_);
  }

  const FocusSweep& sweep_;
  const BlurEvidence& evidence_;
  const BlurFitResult& fit_;
  Calibration& result_;
  EstimatorRegion region_;
  AxisLeakage leakage_;
};

}  // namespace

void MeasureAstigmatism(const FocusSweep& sweep, const BlurEvidence& evidence,
                        const BlurFitResult& fit, Calibration* calibration) {
  Astigmatism(sweep, evidence, fit, calibration).Run();
}

}  // namespace thicklens::calib

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "calib/calibrate/plan_texture.h"
#include "calib/fit/blur_fit.h"
#include "calib/fit/blur_measurement.h"
#include "calib/registration/expected_scale.h"
#include "calib/spectrum/expected_blur.h"
#include "calib/spectrum/spectral_estimator.h"
#include "calib/spectrum/spectral_options.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/validity.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::calib {
namespace {

// Interval of a floor that is not known, px: as ChooseFloor takes it for a target that shows none.
constexpr double kUnknownFloorToPx = 1.0;

// The mean of w^2 over the square of the mean of w, for a Hann window on both axes.
constexpr double kHannPower = 2.25;

class Expectation {
 public:
  Expectation(const PlanConditions& conditions, const SweepDesign& design,
              const TextureSpectrum& texture)
      : conditions_(conditions), design_(design), texture_(texture) {
    result_.design = design;
    const model::Sensor& sensor = conditions.camera.sensor;
    size_px_ = {static_cast<double>(sensor.width_px), static_cast<double>(sensor.height_px)};
    setup_.lens = conditions.camera.lens;
    setup_.pixel_pitch_mm = sensor.pixel_pitch_mm;
    setup_.reading_sigma_mm = conditions.reading_sigma_mm;
    floor_px2_ = conditions.blur_floor_px * conditions.blur_floor_px;
    Place();
  }

  ExpectedSweep Run(bool with_parts) {
    if (!ExpectSpectra()) return std::move(result_);
    ExpectOffset();
    const auto all = Fitted(setup_);
    if (!all) return std::move(result_);
    result_.sigma = ErrorsOf(*all);
    result_.scatter = result_.sigma;
    if (with_parts && offset_scatter_mm_ < result_.offset_sigma_mm) {
      BlurFitSetup repeated = setup_;
      repeated.offset_mm.sigma = offset_scatter_mm_;
      if (const auto fit = Fitted(repeated)) result_.scatter = ErrorsOf(*fit);
    }
    result_.done = true;
    result_.message = "done";
    if (with_parts) FillParts(*all);
    return std::move(result_);
  }

 private:
  bool Fail(const std::string& message) {
    result_.message = message;
    return false;
  }

  double DefocusPx2(double depth_mm) const {
    return std::pow(conditions_.blur_ratio, 2) *
           DefocusVariance(setup_, conditions_.focus_depth_mm, depth_mm);
  }

  double LightAt(double depth_mm) const {
    const double falls =
        conditions_.lamp_falloff ? std::pow(conditions_.focus_depth_mm / depth_mm, 2) : 1;
    return conditions_.light_level * falls;
  }

  // Variance of a pixel at a level of linear light: shot noise L/n, read noise, and the steps of
  // the encoded values [D54].
  double PixelVariance(double light) const {
    const model::TransferCurve& curve = conditions_.camera.sensor.transfer;
    const double encoded = curve.Encode(light);
    const double step = 1 / (std::pow(2.0, conditions_.bits) - 1);
    const double slope = (curve.Decode(encoded + step) - curve.Decode(encoded - step)) / (2 * step);
    const double rounding = std::pow(slope * step, 2) / 12;
    if (conditions_.noise_sigma) return std::pow(*conditions_.noise_sigma, 2) + rounding;
    if (!(conditions_.full_well_electrons > 0)) return rounding;
    const double full = conditions_.full_well_electrons;
    return light / full + std::pow(conditions_.read_noise_electrons / full, 2) + rounding;
  }

  // The frames, and the sharpest of them as the reference.
  void Place() {
    const double zf = conditions_.focus_depth_mm;
    double least = std::numeric_limits<double>::infinity();
    for (int i = 0; i < design_.frames; ++i) {
      PlannedFrame frame;
      frame.depth_mm = design_.nearest_mm + i * design_.step_mm;
      const double variance = floor_px2_ + DefocusPx2(frame.depth_mm);
      frame.blur_sigma_px = std::sqrt(variance);
      if (variance < least) {
        least = variance;
        reference_ = static_cast<std::size_t>(i);
      }
      result_.frames.push_back(frame);
    }
    const double reference_mm = result_.frames[reference_].depth_mm;
    for (PlannedFrame& frame : result_.frames) {
      frame.image_scale = reference_mm / frame.depth_mm;
      const double light = LightAt(frame.depth_mm);
      ExpectedFrame expected;
      expected.reading_mm = frame.depth_mm;
      expected.scale = frame.image_scale;
      expected.variance_px2 = frame.blur_sigma_px * frame.blur_sigma_px;
      expected.relative_noise = std::sqrt(PixelVariance(light)) / light;
      registered_.push_back(expected);
    }
    const model::ThickLens& lens = conditions_.camera.lens;
    px_mm_ = conditions_.camera.sensor.pixel_pitch_mm /
             std::abs(model::ChiefRayMagnification(lens, model::ImageDistanceMm(lens, zf),
                                                   reference_mm));
  }

  // Power density of the texture in px^2 of the reference.
  double TexturePx2(double cycles_per_px) const {
    return texture_.DensityMm2(cycles_per_px / px_mm_) / (px_mm_ * px_mm_);
  }

  bool ExpectSpectra() {
    ExpectedField field;
    field.size_px = size_px_;
    field.centre_px = conditions_.camera.sensor.principal_point_px;
    field.texture_px2 = [this](double frequency) { return TexturePx2(frequency); };
    corner_px_ = CornerRadiusPx(field);
    scales_ = ExpectScales(registered_, reference_, field);
    if (scales_.samples.size() < kMinFramesOfFit)
      return Fail(fmt::format("only {} frames could be registered to the sharpest one",
                              scales_.samples.size()));
    SpectralEstimatorSetup spectral;
    spectral.origin_px = field.centre_px;
    spectral.size_px = size_px_;
    spectral.psf = conditions_.camera.psf;
    spectral.modes_per_ring = ModesPerRing(registered_.size());
    for (const ScaleSample& sample : scales_.samples) {
      const ExpectedFrame& frame = registered_[sample.frame];
      EstimatorFrame entry;
      entry.frame = sample.frame;
      entry.place.scale = frame.scale;
      entry.expected_variance_px2 = frame.variance_px2 / (frame.scale * frame.scale);
      if (sample.frame == reference_) spectral.reference = spectral.frames.size();
      spectral.frames.push_back(entry);
    }
    auto region = PlanRegion(spectral, kWholeField, Eigen::Vector2d::Zero());
    if (!region) return Fail("too few frames would show enough of the same target");
    ChooseModes(spectral, &*region);
    if (region->modes.size() < kMinModesOfFit)
      return Fail("the target would show too little texture above the noise");
    return ExpectBlurOf(spectral, std::move(*region));
  }

  // Variance of a value of the spectrum, before the pixel box is divided: a frame pixel has
  // 1/scale^2 of the area of the reference's.
  double SpectrumNoise(const EstimatorFrame& frame, const TargetWindow& window) const {
    const double relative = registered_[frame.frame].relative_noise;
    return kHannPower * relative * relative /
           (window.size_px.prod() * frame.place.scale * frame.place.scale);
  }

  // The power that each mode of a random texture has: that of the density times an exponential
  // variate, here its quantiles in a fixed sequence that fills the interval evenly, which also
  // makes the strongest modes those that a measurement would choose.
  void ChooseModes(const SpectralEstimatorSetup& spectral, EstimatorRegion* region) {
    constexpr double kGolden = 0.6180339887498949;
    const std::vector<Mode> all = CandidateModes(region->window);
    const auto count = static_cast<Eigen::Index>(all.size());
    Eigen::ArrayXd texture(count), shown = Eigen::ArrayXd::Zero(count);
    double noise = 0;
    const double window_px2 = region->window.size_px.prod();
    for (Eigen::Index k = 0; k < count; ++k) {
      const double nu = ModeFrequency(all[static_cast<std::size_t>(k)], region->window).norm();
      const double part = std::fmod((static_cast<double>(k) + 0.5) * kGolden, 1.0);
      texture[k] = -std::log1p(-part) * TexturePx2(nu) * kHannPower / window_px2;
    }
    const RelativeBlurOptions options = Options();
    for (const std::size_t f : FramesThatShowModes(spectral, *region)) {
      const EstimatorFrame& frame = spectral.frames[f];
      const double own = SpectrumNoise(frame, region->window);
      noise += own;
      for (Eigen::Index k = 0; k < count; ++k) {
        const Mode& mode = all[static_cast<std::size_t>(k)];
        const double h = BlurTransfer(options, frame.expected_variance_px2, frame.place.scale,
                                      ModeFrequency(mode, region->window).norm());
        const double box = BoxTransfer(mode, region->window, frame.place.scale);
        shown[k] += texture[k] * h * h + own / (box * box);
      }
    }
    region->modes =
        StrongestModes(all, shown, region->window, kSignalToNoise * noise, spectral.modes_per_ring);
    power_.resize(static_cast<Eigen::Index>(region->modes.size()));
    Eigen::Index at = 0;
    std::size_t next = 0;
    for (const Mode& mode : region->modes) {  // in the order of the candidates
      while (all[next].jx != mode.jx || all[next].jy != mode.jy) ++next;
      power_[at++] = texture[static_cast<Eigen::Index>(next)];
    }
  }

  RelativeBlurOptions Options() const {
    return SpectralOptions(conditions_.camera.psf, floor_px2_, 1);
  }

  // As FitRegion: frames with almost no mode left give no information and are left out.
  bool ExpectBlurOf(const SpectralEstimatorSetup& spectral, EstimatorRegion region) {
    double least = std::numeric_limits<double>::infinity();
    for (const EstimatorFrame& frame : spectral.frames)
      least = std::min(least, frame.expected_variance_px2);
    while (true) {
      ThrowIfCancelled();
      std::vector<ExpectedSpectrum> spectra;
      for (const std::size_t f : region.frames) {
        const EstimatorFrame& frame = spectral.frames[f];
        ExpectedSpectrum spectrum;
        spectrum.scale = frame.place.scale;
        spectrum.variance_px2 = frame.expected_variance_px2;
        spectrum.noise = SpectrumNoise(frame, region.window);
        spectrum.modes = f == spectral.reference
                             ? region.modes.size()
                             : ModesInBand(region.modes, region.window, frame.place.scale,
                                           frame.expected_variance_px2 - least);
        spectra.push_back(spectrum);
      }
      const ExpectedBlur blur =
          ExpectBlur(spectra, region.reference, region.window, region.modes, power_, Options());
      std::vector<std::size_t> kept;
      for (std::size_t i = 0; i < region.frames.size(); ++i) {
        if (i == region.reference || blur.modes_used[i] >= kMinModesOfFrame)
          kept.push_back(region.frames[i]);
      }
      if (kept.size() < region.frames.size()) {
        if (kept.size() < kMinFramesOfFit)
          return Fail(fmt::format("the texture of {} frames would be lost in blur or noise",
                                  region.frames.size() - kept.size()));
        const auto at = std::find(kept.begin(), kept.end(), spectral.reference);
        region.reference = static_cast<std::size_t>(at - kept.begin());
        region.frames = std::move(kept);
        continue;
      }
      if (!blur.done) return Fail(blur.message);
      TakeSamples(spectral, region, blur);
      return true;
    }
  }

  void TakeSamples(const SpectralEstimatorSetup& spectral, const EstimatorRegion& region,
                   const ExpectedBlur& blur) {
    BlurSamples samples;
    samples.covariance = blur.covariance;
    samples.variances_px2.resize(static_cast<Eigen::Index>(region.frames.size()));
    for (std::size_t i = 0; i < region.frames.size(); ++i) {
      const EstimatorFrame& entry = spectral.frames[region.frames[i]];
      const auto row = static_cast<Eigen::Index>(i);
      samples.frames.push_back(entry.frame);
      samples.variances_px2[row] = entry.expected_variance_px2;
      PlannedFrame& frame = result_.frames[entry.frame];
      frame.modes = blur.modes_used[i];
      const double error_px2 =
          std::sqrt(blur.covariance(row, row)) * frame.image_scale * frame.image_scale;
      frame.blur_sigma_error_px = error_px2 / (2 * std::max(frame.blur_sigma_px, 1e-9));
      ++result_.frames_in_fit;
    }
    setup_.estimators = {std::move(samples)};
    for (const ExpectedFrame& frame : registered_)
      setup_.frames.push_back({frame.reading_mm, frame.scale, std::nullopt});
    setup_.floor_variance_px2 = model::Estimate{floor_px2_, 0};
    if (conditions_.blur_floor_sigma_px) {
      const double sigma_px = *conditions_.blur_floor_sigma_px;  // as ChooseFloor takes it [D82]
      setup_.floor_variance_px2->sigma = std::hypot(2 * conditions_.blur_floor_px * sigma_px,
                                                    std::sqrt(2.0) * sigma_px * sigma_px);
    }
  }

  // The bench offset, stated or from the scales, and the scales as they constrain the readings.
  void ExpectOffset() {
    const ScaleModel law =
        FitScaleModel(scales_.samples, static_cast<int>(reference_), conditions_.reading_sigma_mm,
                      model::BenchDirection::kAway, corner_px_);
    if (law.done) {
      for (const ScaleSample& sample : scales_.samples) {
        if (sample.frame != reference_)
          setup_.frames[sample.frame].scale_sigma = sample.registration.scale_sigma;
      }
    }
    const double from_scale_mm =
        law.done ? law.offset_mm.sigma : std::numeric_limits<double>::infinity();
    constexpr double kFarBetter = 3;  // by which the scale's takes the place of a stated one
    result_.offset_from_scale =
        !conditions_.offset_sigma_mm || kFarBetter * from_scale_mm < *conditions_.offset_sigma_mm;
    result_.offset_sigma_mm =
        result_.offset_from_scale ? from_scale_mm : *conditions_.offset_sigma_mm;
    setup_.offset_mm = {0, result_.offset_sigma_mm};
    offset_scatter_mm_ = result_.offset_from_scale
                             ? scales_.OffsetScatterMm(conditions_.reading_sigma_mm)
                             : result_.offset_sigma_mm;
  }

  std::optional<BlurFitResult> Fitted(const BlurFitSetup& setup) {
    if (!std::isfinite(setup.offset_mm.sigma)) {
      Fail(
          "the sweep would be too short for its image scale to determine the bench offset: state "
          "the offset");
      return std::nullopt;
    }
    BlurFitResult start;
    start.done = true;
    start.values = {conditions_.focus_depth_mm, conditions_.blur_ratio, floor_px2_, 0};
    start.softness_px2 = {0};
    const BlurFitResult fit = FitBlur(setup, &start);
    if (!fit.done) {
      Fail(fit.message);
      return std::nullopt;
    }
    return fit;
  }

  PlannedErrors ErrorsOf(const BlurFitResult& fit) const {
    PlannedErrors errors;
    errors.focus_depth_mm = std::sqrt(fit.covariance(kFocusDepth, kFocusDepth));
    errors.image_distance_mm =
        errors.focus_depth_mm *
        std::abs(model::ImageDistanceSlope(setup_.lens, conditions_.focus_depth_mm));
    errors.blur_ratio = std::sqrt(fit.covariance(kBlurRatio, kBlurRatio));
    return errors;
  }

  static PlannedErrors Without(const PlannedErrors& whole, const PlannedErrors& rest) {
    const auto root = [](double a, double b) { return std::sqrt(std::max(0.0, a * a - b * b)); };
    return {root(whole.focus_depth_mm, rest.focus_depth_mm),
            root(whole.image_distance_mm, rest.image_distance_mm),
            root(whole.blur_ratio, rest.blur_ratio)};
  }

  // The sources are switched off one after the other; what is left last is the noise.
  void FillParts(const BlurFitResult& all) {
    PlannedErrors before = ErrorsOf(all);
    BlurFitSetup setup = setup_;
    const auto take = [&](const char* name) {
      const auto fit = Fitted(setup);
      if (!fit) return;
      const PlannedErrors rest = ErrorsOf(*fit);
      result_.parts.push_back({name, Without(before, rest)});
      before = rest;
    };
    setup.offset_mm.sigma = 0;
    take("bench offset");
    if (setup.floor_variance_px2->sigma > 0) {
      setup.floor_variance_px2->sigma = 0;
      take("blur floor");
    }
    if (setup.reading_sigma_mm > 0) {
      setup.reading_sigma_mm = 0;
      take("readings");
    }
    result_.parts.push_back({"noise", before});
    if (!conditions_.blur_floor_sigma_px) FillFloorInterval();
  }

  // dzf = zf dS0/(A uf^2), dkappa/kappa = dS0/(2 A uf^2) [D73] for half of the interval of S0, with
  // A uf^2 = (kappa r f1/(p (zf - f1)))^2.
  void FillFloorInterval() {
    const double zf = conditions_.focus_depth_mm, f1 = setup_.lens.front_focal_length_mm;
    const double slope_px = conditions_.blur_ratio * setup_.lens.aperture_radius_mm * f1 /
                            (setup_.pixel_pitch_mm * (zf - f1));
    const double part = 0.5 * kUnknownFloorToPx * kUnknownFloorToPx / (slope_px * slope_px);
    result_.floor_interval.focus_depth_mm = zf * part;
    result_.floor_interval.image_distance_mm =
        zf * part * std::abs(model::ImageDistanceSlope(setup_.lens, zf));
    result_.floor_interval.blur_ratio = 0.5 * conditions_.blur_ratio * part;
  }

  const PlanConditions& conditions_;
  const SweepDesign& design_;
  const TextureSpectrum& texture_;
  ExpectedSweep result_;
  Eigen::Vector2d size_px_{0, 0};
  double floor_px2_ = 0;
  double px_mm_ = 0;  // width of a px of the reference on the target
  std::size_t reference_ = 0;
  std::vector<ExpectedFrame> registered_;  // of every frame
  ExpectedScales scales_;
  double corner_px_ = 0;
  double offset_scatter_mm_ = 0;
  Eigen::ArrayXd power_;  // |T|^2 of the region's modes
  BlurFitSetup setup_;
};

}  // namespace

Texture TextureOf(const PlanConditions& conditions, double feature_size_mm) {
  const model::Sensor& sensor = conditions.camera.sensor;
  Texture texture;
  texture.kind = conditions.texture;
  texture.contrast = conditions.contrast;
  texture.feature_size_mm = feature_size_mm;
  texture.field_mm = std::min(sensor.width_px, sensor.height_px) * PixelAtFocusMm(conditions);
  return texture;
}

double PixelAtFocusMm(const PlanConditions& conditions) {
  const double f1 = conditions.camera.lens.front_focal_length_mm;
  return conditions.camera.sensor.pixel_pitch_mm * (conditions.focus_depth_mm - f1) / f1;
}

ExpectedSweep ExpectSweepOf(const PlanConditions& conditions, const SweepDesign& design,
                            const TextureSpectrum& texture, bool with_parts) {
  return Expectation(conditions, design, texture).Run(with_parts);
}

ExpectedSweep ExpectSweep(const PlanConditions& conditions, const SweepDesign& design) {
  std::string why;
  if (!conditions.IsValid(&why)) throw Error("plan: " + why);
  if (!(design.nearest_mm > conditions.camera.lens.front_focal_length_mm) ||
      !(design.step_mm > 0) || design.frames < 5 || !(design.feature_size_mm > 0)) {
    throw Error(fmt::format(
        "plan: at least 5 frames in steps > 0 from a depth beyond the focal length ({:.4g} mm) and "
        "a texture of a size > 0 are expected, found {} frames in steps of {} mm from {} mm and {} "
        "mm",
        conditions.camera.lens.front_focal_length_mm, design.frames, design.step_mm,
        design.nearest_mm, design.feature_size_mm));
  }
  const TextureSpectrum texture(TextureOf(conditions, design.feature_size_mm));
  return ExpectSweepOf(conditions, design, texture, true);
}

}  // namespace thicklens::calib

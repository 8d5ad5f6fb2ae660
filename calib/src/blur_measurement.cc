#include "blur_measurement.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "edge_pixels.h"
#include "thicklens/calib/edge_spread.h"
#include "thicklens/model/parallel.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kFewestFrames = 5;
constexpr double kUsualRatio = 0.45;  // kappa to start with
constexpr double kUsualFloor = 0.25;  // S0 to start with, px^2
constexpr double kGaussianBand = 2;
constexpr double kDiscBand = 1;  // the first zero is at 1.84
constexpr double kWholeField = 0.98;
constexpr std::size_t kFramesForBound = 9;
constexpr double kModesOfAll = 30000;  // per ring, times frames
constexpr int kPasses = 3;
constexpr double kExpectedWell = 1.3;  // a pass whose expectation was this good is the last

double FloorToStartWith(const model::FloorKnowledge& floor) {
  if (floor.given_px) return floor.given_px->value * floor.given_px->value;
  if (floor.from_px) return 0.5 * (*floor.from_px * *floor.from_px + *floor.to_px * *floor.to_px);
  return kUsualFloor;
}

class Measurement {
 public:
  explicit Measurement(const BlurTask& task) : task_(task) {
    BlurFitSetup& setup = evidence_.setup;
    setup.lens = task.sweep.camera.lens;
    setup.pixel_pitch_mm = task.sweep.camera.sensor.pixel_pitch_mm;
    setup.law = task.law;
    setup.offset_mm = task.offset_mm;
    setup.direction = task.sweep.direction;
    setup.reading_sigma_mm = task.reading_sigma_mm;
    setup.reading_sigma_is_known = task.reading_sigma_is_known;
    floor_px2_ = FloorToStartWith(task.sweep.floor);
    focus_mm_ = task.start_focus_depth_mm;
    for (const std::size_t frame : task.frames) {
      evidence_.frames.push_back(frame);
      setup.frames.push_back(PlaceOf(frame));
    }
  }

  BlurEvidence Run() {
    MeasureSpectra();
    MeasureEdges();
    evidence_.region = std::move(region_);
    if (evidence_.setup.meters.empty() && evidence_.message.empty())
      evidence_.message = "neither edges nor texture could be measured";
    return std::move(evidence_);
  }

 private:
  const ScaleSample* Registered(std::size_t frame) const {
    for (const ScaleSample& sample : task_.scales) {
      if (sample.frame == frame) return &sample;
    }
    return nullptr;
  }

  double DepthMm(std::size_t frame) const {
    return task_.offset_mm.value +
           model::DirectionSign(task_.sweep.direction) * task_.sweep.frames[frame].reading_mm;
  }

  FitFrame PlaceOf(std::size_t frame) const {
    FitFrame place;
    place.reading_mm = task_.sweep.frames[frame].reading_mm;
    place.scale =
        task_.law == BlurLaw::kPerspective ? DepthMm(task_.reference) / DepthMm(frame) : 1.0;
    if (const ScaleSample* sample = Registered(frame)) {
      // A lone edge registers badly along itself; then the readings know the scale better.
      if (std::abs(sample->scale / place.scale - 1) < 0.05) place.scale = sample->scale;
      if (task_.scale_follows_readings && frame != task_.reference)
        place.scale_sigma = sample->registration.scale_sigma;
    }
    return place;
  }

  // ---- edges ----
  // Edges that nobody stated may be a texture's own, and a printed edge says nothing that the
  // relative spectra do not say better, but for what the floor cannot exceed: where there are
  // spectra, the frames about focus are enough for that.
  void MeasureEdges() {
    if (task_.sweep.target == model::SweepTarget::kTexture) return;
    const bool is_sharp = task_.sweep.target == model::SweepTarget::kKnifeEdge;
    const bool for_bound_alone = evidence_.spectrum >= 0 && !is_sharp;
    const model::Psf psf = task_.sweep.camera.psf;
    const double floor_px = std::sqrt(floor_px2_);
    if (!MeasureEdgeSpread(task_.store.Grey(task_.reference), psf, floor_px)) return;
    std::vector<std::size_t> chosen(task_.frames.size());
    std::iota(chosen.begin(), chosen.end(), std::size_t{0});
    if (for_bound_alone) {
      const auto blur = [&](std::size_t i) {
        return DefocusVariance(evidence_.setup, focus_mm_, DepthMm(task_.frames[i]));
      };
      std::stable_sort(chosen.begin(), chosen.end(),
                       [&](std::size_t a, std::size_t b) { return blur(a) < blur(b); });
      chosen.resize(std::min(chosen.size(), kFramesForBound));
    }
    std::vector<std::optional<FrameEdgeSpread>> found(task_.frames.size());
    model::ParallelFor(static_cast<int>(chosen.size()), task_.threads, [&](int i) {
      const std::size_t index = chosen[static_cast<std::size_t>(i)];
      found[index] = MeasureEdgeSpread(task_.store.Grey(task_.frames[index]), psf, floor_px);
      if (task_.tick) task_.tick();
    });
    BlurSamples samples;
    std::vector<double> variances, errors;
    for (std::size_t i = 0; i < found.size(); ++i) {
      if (!found[i]) continue;
      const double s2 = std::pow(evidence_.setup.frames[i].scale, 2);
      const BlurSigma& both = found[i]->both;
      samples.frames.push_back(i);
      variances.push_back(both.sigma_px * both.sigma_px / s2);
      errors.push_back(std::max(2 * both.sigma_px * both.error_px, both.error_px * both.error_px) /
                       s2);
    }
    if (samples.frames.size() < kFewestFrames) return;
    const auto n = static_cast<Eigen::Index>(variances.size());
    samples.variances_px2 = Eigen::Map<Eigen::VectorXd>(variances.data(), n);
    samples.covariance =
        Eigen::Map<Eigen::VectorXd>(errors.data(), n).array().square().matrix().asDiagonal();
    if (for_bound_alone) {
      evidence_.unstated_edges = std::move(samples);
      return;
    }
    if (is_sharp) samples.held_softness_px2 = 0;
    evidence_.edges = static_cast<int>(evidence_.setup.meters.size());
    evidence_.setup.meters.push_back(std::move(samples));
  }

  // ---- relative spectra ----
  void MeasureSpectra() {
    double ratio = kUsualRatio;
    for (int pass = 0; pass < kPasses; ++pass) {
      SetUp(ratio);
      std::optional<MeterRegion> region =
          PlanRegion(evidence_.spectral, kWholeField, Eigen::Vector2d::Zero());
      if (!region) {
        NoteNoSpectrum("too few frames see enough of the same target");
        return;
      }
      std::vector<MeterRegion> regions = {std::move(*region)};
      MeasureRegions(evidence_.spectral, &regions);
      region_ = std::move(regions.front());
      if (region_.frames.size() < kFewestFrames || region_.modes.size() < 12) {
        NoteNoSpectrum("the target shows too little texture above the noise");
        return;
      }
      const RelativeBlur blur = Fit(task_.sweep.camera.psf, 1);
      if (!blur.done) {
        NoteNoSpectrum(blur.message);
        return;
      }
      if (pass + 1 == kPasses || !ExpectationWasFarOff(blur, &ratio)) {
        Keep(blur);
        return;
      }
    }
  }

  void NoteNoSpectrum(const std::string& why) { evidence_.message = why; }

  void SetUp(double ratio) {
    SpectralMeterSetup& meter = evidence_.spectral;
    meter = {};
    const model::Sensor& sensor = task_.sweep.camera.sensor;
    const model::RegionOfInterest& roi = task_.sweep.roi;
    meter.origin_px = sensor.principal_point_px - Eigen::Vector2d(roi.x, roi.y);
    meter.size_px = roi.width > 0 ? Eigen::Vector2d(roi.width, roi.height)
                                  : Eigen::Vector2d(sensor.width_px, sensor.height_px);
    meter.psf = task_.sweep.camera.psf;
    meter.threads = task_.threads;
    // The fit takes time with the square of the frames: of many, each needs fewer modes.
    meter.modes_per_ring = std::clamp(
        static_cast<int>(kModesOfAll / static_cast<double>(task_.frames.size())), 24, 200);
    meter.tick = task_.tick;
    meter.read_grey = [this](std::size_t frame) { return task_.store.Grey(frame); };
    fit_index_.clear();
    for (std::size_t i = 0; i < task_.frames.size(); ++i) {
      const std::size_t frame = task_.frames[i];
      const ScaleSample* sample = Registered(frame);
      if (sample == nullptr) continue;
      MeterFrame entry;
      entry.frame = frame;
      entry.place.scale = sample->scale;
      entry.place.shift_px = sample->registration.shift_px;
      entry.rotation_rad = sample->registration.rotation_rad;
      entry.expected_variance_px2 =
          (floor_px2_ +
           ratio * ratio * DefocusVariance(evidence_.setup, focus_mm_, DepthMm(frame))) /
          (sample->scale * sample->scale);
      entry.pixel_noise = std::max(task_.pixel_noise, 1e-5);
      if (frame == task_.reference) meter.reference = meter.frames.size();
      meter.frames.push_back(entry);
      fit_index_.push_back(i);
    }
  }

  RelativeBlur Fit(model::Psf psf, double part) const {
    return FitRelativeBlur(region_.samples, region_.reference, region_.window, region_.modes,
                           region_.leakage, SpectralOptions(psf, floor_px2_, part));
  }

  BlurSamples Samples(const RelativeBlur& blur) const {
    BlurSamples samples = AsSamples(blur, region_);
    for (std::size_t& f : samples.frames) f = fit_index_[f];
    return samples;
  }

  // Whether the blur came out so different from what the windows and bands were laid out for that
  // they must be laid out again; then with what was found.
  bool ExpectationWasFarOff(const RelativeBlur& blur, double* ratio) {
    BlurFitSetup setup = evidence_.setup;
    setup.meters = {Samples(blur)};
    setup.floor_variance_px2 = model::Estimate{floor_px2_, 0};
    const BlurFitResult fit = FitBlur(setup);
    if (!fit.done) return false;
    const auto range = [&](double focus_mm, double kappa) {
      double largest = 0;
      for (const std::size_t frame : task_.frames) {
        largest =
            std::max(largest, kappa * kappa * DefocusVariance(setup, focus_mm, DepthMm(frame)));
      }
      return largest;
    };
    const double before = range(focus_mm_, *ratio), after = range(fit.values[0], fit.values[1]);
    const bool far_off = after > kExpectedWell * before || before > kExpectedWell * after;
    focus_mm_ = fit.values[kFocusDepth];
    *ratio = fit.values[kBlurRatio];
    return far_off;
  }

  void Keep(const RelativeBlur& blur) {
    evidence_.spectrum = static_cast<int>(evidence_.setup.meters.size());
    evidence_.setup.meters.push_back(Samples(blur));
    evidence_.frame_noise_ratios.assign(evidence_.setup.frames.size(), 0);
    for (std::size_t i = 0; i < region_.frames.size(); ++i)
      evidence_.frame_noise_ratios[fit_index_[region_.frames[i]]] =
          blur.noise_ratio[static_cast<Eigen::Index>(i)];
    if (const RelativeBlur narrow = Fit(task_.sweep.camera.psf, 0.5); narrow.done)
      evidence_.narrow_band = Samples(narrow);
    CompareShapes(blur);
  }

  // Both shapes over the same band, each with its own leakage.
  void CompareShapes(const RelativeBlur& blur) {
    const model::Psf stated = task_.sweep.camera.psf;
    const bool is_gaussian = stated == model::Psf::kGaussian;
    const model::Psf other = is_gaussian ? model::Psf::kDisc : model::Psf::kGaussian;
    const double part = is_gaussian ? kDiscBand / kGaussianBand : 1;
    const RelativeBlur as_stated = Fit(stated, part);
    double largest = 0;
    for (const std::size_t f : region_.frames) {
      largest = std::max(largest, evidence_.spectral.frames[f].expected_variance_px2);
    }
    const WindowLeakage stated_leakage = region_.leakage;
    region_.leakage =
        WindowLeakage(task_.store.Grey(task_.reference), evidence_.spectral.origin_px,
                      region_.window, region_.modes, region_.samples[region_.reference].spectrum,
                      other, 1.4 * std::sqrt(largest) + 0.5, task_.threads);
    const RelativeBlur as_other = Fit(other, is_gaussian ? 1 : kDiscBand / kGaussianBand);
    region_.leakage = stated_leakage;
    if (as_stated.done && as_other.done) {
      evidence_.other_psf = Samples(as_other);
      evidence_.gaussian_misfit = (is_gaussian ? as_stated : as_other).chi2_per_dof;
      evidence_.disc_misfit = (is_gaussian ? as_other : as_stated).chi2_per_dof;
      evidence_.better_psf = *evidence_.gaussian_misfit <= *evidence_.disc_misfit
                                 ? model::Psf::kGaussian
                                 : model::Psf::kDisc;
    }
    AddExamples(blur, as_other);
  }

  // The nearest, the sharpest and the farthest frame of the meter.
  void AddExamples(const RelativeBlur& blur, const RelativeBlur& other) {
    const auto depth = [&](std::size_t i) {
      return DepthMm(evidence_.spectral.frames[region_.frames[i]].frame);
    };
    std::size_t nearest = 0, farthest = 0;
    for (std::size_t i = 0; i < region_.frames.size(); ++i) {
      if (depth(i) < depth(nearest)) nearest = i;
      if (depth(i) > depth(farthest)) farthest = i;
    }
    const auto reference = static_cast<Eigen::Index>(region_.reference);
    const model::Psf stated = task_.sweep.camera.psf;
    for (const std::size_t i : {nearest, region_.reference, farthest}) {
      BlurExample example;
      example.frame = static_cast<int>(evidence_.spectral.frames[region_.frames[i]].frame);
      const auto at = [&](const RelativeBlur& fit, model::Psf psf, double nu) {
        const RelativeBlurOptions options = SpectralOptions(psf, floor_px2_, 1);
        const double scale = region_.samples[i].scale;
        const auto k = static_cast<Eigen::Index>(i);
        return BlurTransfer(options, fit.variances_px2[k], scale, nu) /
               BlurTransfer(options, fit.variances_px2[reference], 1, nu);
      };
      for (const TransferRing& ring :
           MeasuredTransfer(region_.samples[i], blur, i, blur.variances_px2[reference],
                            region_.window, region_.modes, region_.leakage)) {
        const RelativeBlurOptions options = SpectralOptions(stated, floor_px2_, 1);
        example.x.push_back(ring.nu / region_.samples[i].scale);
        example.measured.push_back(
            ring.measured / BlurTransfer(options, blur.variances_px2[reference], 1, ring.nu));
        const double by_stated = at(blur, stated, ring.nu);
        const double by_other =
            other.done
                ? at(other,
                     stated == model::Psf::kGaussian ? model::Psf::kDisc : model::Psf::kGaussian,
                     ring.nu)
                : by_stated;
        const bool is_gaussian = stated == model::Psf::kGaussian;
        example.gaussian.push_back(is_gaussian ? by_stated : by_other);
        if (other.done || !is_gaussian) example.disc.push_back(is_gaussian ? by_other : by_stated);
      }
      evidence_.examples.push_back(std::move(example));
    }
  }

  const BlurTask& task_;
  BlurEvidence evidence_;
  double floor_px2_ = 0;
  double focus_mm_ = 0;
  std::vector<std::size_t> fit_index_;  // of the spectral meter's frames in setup.frames
  MeterRegion region_;
};

}  // namespace

RelativeBlurOptions SpectralOptions(model::Psf psf, double floor_variance_px2, double part) {
  RelativeBlurOptions options;
  options.psf = psf;
  options.band = part * (psf == model::Psf::kGaussian ? kGaussianBand : kDiscBand);
  options.floor_variance_px2 = floor_variance_px2;
  return options;
}

BlurSamples AsSamples(const RelativeBlur& blur, const MeterRegion& region) {
  BlurSamples samples;
  samples.frames = region.frames;
  samples.variances_px2 = blur.variances_px2;
  samples.covariance = blur.covariance;
  return samples;
}

BlurEvidence MeasureBlur(const BlurTask& task) { return Measurement(task).Run(); }

}  // namespace thicklens::calib

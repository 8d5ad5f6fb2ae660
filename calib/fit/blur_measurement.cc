#include "calib/fit/blur_measurement.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "calib/edges/edge_spread.h"
#include "calib/fit/blur_examples.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinFrames = kMinFramesOfFit;
constexpr double kDefaultFloor = 0.25;  // S0 at the start, px^2
constexpr std::size_t kFramesForBound = 9;
constexpr int kPasses = 3;
// No further pass follows if every frame's blur was predicted to within this part of the largest.
constexpr double kExpectedWell = 0.3;

constexpr double kVisibleBlurPx2 = 2;  // added variance that stands out in a registration
constexpr double kUnusualRatio = 0.2;  // |ln| of the measured over the usual blur ratio

double FloorToStartWith(const model::FloorKnowledge& floor) {
  if (floor.given_px) return floor.given_px->value * floor.given_px->value;
  if (floor.from_px) return 0.5 * (*floor.from_px * *floor.from_px + *floor.to_px * *floor.to_px);
  return kDefaultFloor;
}

class Measurement {
 public:
  explicit Measurement(const BlurTask& task) : task_(task) {
    BlurFitSetup& setup = evidence_.setup;
    setup.lens = task.sweep.camera.lens;
    setup.pixel_pitch_mm = task.sweep.camera.sensor.pixel_pitch_mm;
    setup.law = task.law;
    setup.offset_mm = task.offset_mm;
    evidence_.known_focus = task.known_focus;
    evidence_.zero_is_open = task.zero_is_open;
    setup.direction = task.sweep.direction;
    setup.reading_sigma_mm = task.reading_sigma_mm;
    setup.reading_sigma_is_known = task.reading_sigma_is_known;
    evidence_.assumed_floor_px2 = FloorToStartWith(task.sweep.floor);
    focus_mm_ = task.start_focus_depth_mm;
    for (const std::size_t frame : task.frames) {
      evidence_.frames.push_back(frame);
      setup.frames.push_back(PlaceOf(frame));
    }
  }

  BlurEvidence Run() {
    if (task_.sweep.target == model::SweepTarget::kPoints) {
      MeasurePoints();
    } else {
      MeasureSpectra();
      MeasureEdges();
    }
    evidence_.region = std::move(region_);
    if (evidence_.setup.estimators.empty() && evidence_.message.empty())
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

  // Returns the depth from the zero of the image scale.
  double FromCentreMm(std::size_t frame) const { return DepthMm(frame) - task_.scale_centre_mm; }

  FitFrame PlaceOf(std::size_t frame) const {
    FitFrame place;
    place.reading_mm = task_.sweep.frames[frame].reading_mm;
    place.scale = task_.law == BlurModel::kPerspective
                      ? FromCentreMm(task_.reference) / FromCentreMm(frame)
                      : 1.0;
    if (const ScaleSample* sample = Registered(frame)) {
      // A lone edge registers poorly along itself; the readings then give a better scale.
      if (std::abs(sample->scale / place.scale - 1) < 0.05) place.scale = sample->scale;
      if (task_.scale_follows_readings && frame != task_.reference)
        place.scale_sigma = sample->registration.scale_sigma;
    }
    return place;
  }

  // ---- points ----
  void MeasurePoints() {
    const SpotTracks tracks = FollowSpots(
        task_.sweep, [this](std::size_t frame) { return task_.store.Grey(frame); }, task_.frames,
        task_.reference, task_.tick);
    evidence_.spots = tracks.finding;
    if (!tracks.finding.done) {
      evidence_.message = tracks.finding.message;
      return;
    }
    BlurSamples samples;
    std::vector<double> variances, errors;
    for (const std::size_t frame : task_.frames)
      evidence_.without_points[frame] = "too few of its points were found";
    for (const SpotFrame& frame : tracks.frames) {
      const auto at = std::find(task_.frames.begin(), task_.frames.end(), frame.frame);
      if (at == task_.frames.end()) continue;
      evidence_.without_points[frame.frame] = frame.without_variance;
      if (!frame.variance_px2) continue;
      const auto index = static_cast<std::size_t>(at - task_.frames.begin());
      const double s2 = std::pow(evidence_.setup.frames[index].scale, 2);
      samples.frames.push_back(index);
      variances.push_back(frame.variance_px2->value / s2);
      errors.push_back(frame.variance_px2->sigma / s2);
    }
    const auto n = static_cast<Eigen::Index>(variances.size());
    samples.variances_px2 = Eigen::Map<Eigen::VectorXd>(variances.data(), n);
    samples.covariance =
        Eigen::Map<Eigen::VectorXd>(errors.data(), n).array().square().matrix().asDiagonal();
    evidence_.by_points = true;
    evidence_.edges = static_cast<int>(evidence_.setup.estimators.size());
    evidence_.setup.estimators.push_back(std::move(samples));
  }

  // ---- edges ----
  // Unstated edges may belong to a texture, and the relative spectra measure a printed edge's blur
  // better. Such edges only limit the floor: where there are spectra, the frames around focus
  // suffice for that.
  void MeasureEdges() {
    if (task_.sweep.target == model::SweepTarget::kTexture) return;
    const bool is_sharp = task_.sweep.target == model::SweepTarget::kKnifeEdge;
    const bool for_bound_alone = evidence_.spectrum >= 0 && !is_sharp;
    const model::Psf psf = task_.sweep.camera.psf;
    const double floor_px = std::sqrt(evidence_.assumed_floor_px2);
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
    std::optional<BlurSamples> samples = EdgeSamples(chosen, psf);
    if (!samples) return;
    if (for_bound_alone) {
      evidence_.unstated_edges = std::move(samples);
      return;
    }
    if (is_sharp) samples->held_softness_px2 = 0;
    AddEdgeExamples(samples->frames);
    if (evidence_.disc_misfit && evidence_.better_psf != psf) {
      evidence_.other_psf = EdgeSamples(chosen, evidence_.better_psf);
      if (evidence_.other_psf) evidence_.other_psf->held_softness_px2 = samples->held_softness_px2;
    }
    evidence_.edges = static_cast<int>(evidence_.setup.estimators.size());
    evidence_.setup.estimators.push_back(std::move(*samples));
  }

  // Measures the edges of the chosen frames of the task, with one shape of the blur.
  std::optional<BlurSamples> EdgeSamples(const std::vector<std::size_t>& chosen, model::Psf psf) {
    const double floor_px = std::sqrt(evidence_.assumed_floor_px2);
    std::vector<std::optional<FrameEdgeSpread>> found(task_.frames.size());
    ParallelFor(static_cast<int>(chosen.size()), task_.threads, [&](int i) {
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
    if (samples.frames.size() < kMinFrames) return std::nullopt;
    const auto n = static_cast<Eigen::Index>(variances.size());
    samples.variances_px2 = Eigen::Map<Eigen::VectorXd>(variances.data(), n);
    samples.covariance =
        Eigen::Map<Eigen::VectorXd>(errors.data(), n).array().square().matrix().asDiagonal();
    return samples;
  }

  // Adds the nearest, the sharpest and the farthest of the measured frames, and compares both
  // shapes of the blur on them.
  void AddEdgeExamples(const std::vector<std::size_t>& measured) {
    const auto depth_mm = [this](std::size_t i) { return DepthMm(task_.frames[i]); };
    const auto [nearest, farthest] = std::minmax_element(
        measured.begin(), measured.end(),
        [&](std::size_t a, std::size_t b) { return depth_mm(a) < depth_mm(b); });
    double as_gaussian = 0, as_disc = 0;
    int compared = 0;
    for (const std::size_t frame :
         {task_.frames[*nearest], task_.reference, task_.frames[*farthest]}) {
      const auto example = EdgeExample(task_.store.Grey(frame), frame, task_.sweep.camera.psf,
                                       std::sqrt(evidence_.assumed_floor_px2));
      if (!example) continue;
      evidence_.examples.push_back(example->curves);
      if (!example->gaussian_chi2 || !example->disc_chi2) continue;
      as_gaussian += *example->gaussian_chi2;
      as_disc += *example->disc_chi2;
      ++compared;
    }
    if (compared == 0) return;
    evidence_.gaussian_misfit = as_gaussian / compared;
    evidence_.disc_misfit = as_disc / compared;
    evidence_.better_psf = as_gaussian <= as_disc ? model::Psf::kGaussian : model::Psf::kDisc;
  }

  // ---- relative spectra ----
  void MeasureSpectra() {
    double ratio = RatioToStartWith();
    for (int pass = 0; pass < kPasses; ++pass) {
      SetUp(ratio);
      std::optional<EstimatorRegion> region =
          PlanRegion(evidence_.spectral, kWholeField, Eigen::Vector2d::Zero());
      if (!region) {
        NoteNoSpectrum("too few frames show enough of the same target");
        return;
      }
      std::vector<EstimatorRegion> regions = {std::move(*region)};
      MeasureRegions(evidence_.spectral, &regions);
      region_ = std::move(regions.front());
      if (region_.frames.size() < kMinFrames || region_.modes.size() < kMinModesOfFit) {
        NoteNoSpectrum("the target shows too little texture above the noise");
        return;
      }
      FittedRegion fitted =
          FitRegion(std::move(region_),
                    SpectralOptions(task_.sweep.camera.psf, evidence_.assumed_floor_px2, 1));
      region_ = std::move(fitted.region);
      const RelativeBlur& blur = fitted.blur;
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

  // The blur that the registrations show over the one expected for a ratio of 1. A bench offset
  // that is far off, or wrong data of the lens, make the usual ratio a bad start.
  double RatioToStartWith() const {
    std::vector<double> ratios;
    for (const ScaleSample& sample : task_.scales) {
      const std::optional<double>& added_px2 = sample.registration.added_variance_px2;
      if (!added_px2 || !(*added_px2 > kVisibleBlurPx2)) continue;
      const double expected_px2 =
          DefocusVariance(evidence_.setup, focus_mm_, DepthMm(sample.frame));
      if (expected_px2 > 0) ratios.push_back(std::sqrt(*added_px2 / expected_px2));
    }
    if (ratios.size() < kMinFrames) return kDefaultRatio;
    const double found = Median(ratios);
    return std::abs(std::log(found / kDefaultRatio)) > kUnusualRatio ? found : kDefaultRatio;
  }

  void NoteNoSpectrum(const std::string& why) { evidence_.message = why; }

  void SetUp(double ratio) {
    SpectralEstimatorSetup& estimator = evidence_.spectral;
    estimator = {};
    const model::Sensor& sensor = task_.sweep.camera.sensor;
    const model::RegionOfInterest& roi = task_.sweep.roi;
    estimator.origin_px = sensor.principal_point_px - Eigen::Vector2d(roi.x, roi.y);
    estimator.size_px = roi.width > 0 ? Eigen::Vector2d(roi.width, roi.height)
                                      : Eigen::Vector2d(sensor.width_px, sensor.height_px);
    estimator.psf = task_.sweep.camera.psf;
    estimator.threads = task_.threads;
    estimator.modes_per_ring = ModesPerRing(task_.frames.size());
    estimator.without_row_modes = task_.rows_had_bands;
    estimator.without_column_modes = task_.columns_had_bands;
    estimator.tick = task_.tick;
    estimator.read_grey = [&store = task_.store](std::size_t frame) { return store.Grey(frame); };
    evidence_.fit_index.clear();
    for (std::size_t i = 0; i < task_.frames.size(); ++i) {
      const std::size_t frame = task_.frames[i];
      const ScaleSample* sample = Registered(frame);
      if (sample == nullptr) continue;
      EstimatorFrame entry;
      entry.frame = frame;
      entry.place.scale = sample->scale;
      entry.place.shift_px = sample->registration.shift_px;
      entry.rotation_rad = sample->registration.rotation_rad;
      entry.expected_variance_px2 =
          (evidence_.assumed_floor_px2 +
           ratio * ratio * DefocusVariance(evidence_.setup, focus_mm_, DepthMm(frame))) /
          (sample->scale * sample->scale);
      entry.pixel_noise = std::max(task_.pixel_noise, 1e-5);
      if (frame == task_.reference) estimator.reference = estimator.frames.size();
      estimator.frames.push_back(entry);
      evidence_.fit_index.push_back(i);
    }
  }

  // Whether the blur differs so much from the prediction for which the windows and bands were
  // chosen that they must be chosen again, with the measured blur.
  bool ExpectationWasFarOff(const RelativeBlur& blur, double* ratio) {
    BlurFitSetup setup = evidence_.setup;
    setup.estimators = {FitSamples(evidence_, blur, region_)};
    setup.floor_variance_px2 = model::Estimate{evidence_.assumed_floor_px2, 0};
    const BlurFitResult fit = FitBlur(setup);
    if (!fit.done) return false;
    double largest_px2 = 0, farthest_off_px2 = 0;
    for (const std::size_t frame : task_.frames) {
      const auto defocus_px2 = [&](double focus_mm, double kappa) {
        return kappa * kappa * DefocusVariance(setup, focus_mm, DepthMm(frame));
      };
      const double found = defocus_px2(fit.values[kFocusDepth], fit.values[kBlurRatio]);
      largest_px2 = std::max(largest_px2, found);
      farthest_off_px2 =
          std::max(farthest_off_px2, std::abs(found - defocus_px2(focus_mm_, *ratio)));
    }
    const bool far_off = farthest_off_px2 > kExpectedWell * largest_px2;
    focus_mm_ = fit.values[kFocusDepth];
    *ratio = fit.values[kBlurRatio];
    return far_off;
  }

  void Keep(const RelativeBlur& blur) {
    evidence_.spectrum = static_cast<int>(evidence_.setup.estimators.size());
    evidence_.setup.estimators.push_back(FitSamples(evidence_, blur, region_));
    evidence_.frame_noise_ratios.assign(evidence_.setup.frames.size(), 0);
    evidence_.frame_misfits.assign(evidence_.setup.frames.size(), 0);
    NoteScatter(region_, blur.noise_ratio, blur.misfit, &evidence_);
    evidence_.blur = blur;
  }

  const BlurTask& task_;
  BlurEvidence evidence_;
  double focus_mm_ = 0;
  EstimatorRegion region_;
};

}  // namespace

ReadingEvidence EvidenceOfBlur(const BlurEvidence& evidence) {
  ReadingEvidence of_readings;
  of_readings.is_parabola_in_reading = true;
  const BlurSamples* most = nullptr;
  for (const BlurSamples& estimator : evidence.setup.estimators) {
    if (most == nullptr || estimator.frames.size() > most->frames.size()) most = &estimator;
  }
  if (most == nullptr) return of_readings;
  for (const std::size_t f : most->frames) of_readings.frames.push_back(evidence.frames[f]);
  of_readings.values = most->variances_px2;
  of_readings.sigmas = most->covariance.diagonal().cwiseMax(0).cwiseSqrt();
  return of_readings;
}

void NoteScatter(const EstimatorRegion& region, const Eigen::VectorXd& noise_ratio,
                 const Eigen::VectorXd& misfit, BlurEvidence* evidence) {
  for (std::size_t i = 0; i < region.frames.size(); ++i) {
    const std::size_t frame = evidence->fit_index[region.frames[i]];
    evidence->frame_noise_ratios[frame] = noise_ratio[static_cast<Eigen::Index>(i)];
    evidence->frame_misfits[frame] = misfit[static_cast<Eigen::Index>(i)];
  }
}

int ModesPerRing(std::size_t frames) {
  constexpr double kModesOfAll = 30000;  // per ring, times frames
  return std::clamp(static_cast<int>(kModesOfAll / static_cast<double>(frames)), 24, 200);
}

void ReplaceSpectralBlur(EstimatorRegion region, RelativeBlur blur, BlurEvidence* evidence) {
  const Eigen::VectorXd& by_tails = evidence->blur.variance_by_tails;
  if (blur.variance_by_tails.size() == 0 && by_tails.size() > 0) {
    blur.variance_by_tails = Eigen::VectorXd::Zero(blur.variances_px2.size());
    for (std::size_t i = 0; i < region.frames.size(); ++i) {
      const std::vector<std::size_t>& before = evidence->region.frames;
      const auto at = std::find(before.begin(), before.end(), region.frames[i]);
      if (at != before.end())
        blur.variance_by_tails[static_cast<Eigen::Index>(i)] = by_tails[at - before.begin()];
    }
  }
  evidence->region = std::move(region);
  evidence->blur = std::move(blur);
  evidence->setup.estimators[static_cast<std::size_t>(evidence->spectrum)] =
      FitSamples(*evidence, evidence->blur, evidence->region);
}

BlurSamples AsSamples(const RelativeBlur& blur, const EstimatorRegion& region) {
  BlurSamples samples;
  samples.frames = region.frames;
  samples.variances_px2 = blur.variances_px2;
  samples.covariance = blur.covariance;
  return samples;
}

BlurSamples FitSamples(const BlurEvidence& evidence, const RelativeBlur& blur,
                       const EstimatorRegion& region) {
  BlurSamples samples = AsSamples(blur, region);
  for (std::size_t& f : samples.frames) f = evidence.fit_index[f];
  return samples;
}

FittedRegion FitRegion(EstimatorRegion region, const RelativeBlurOptions& options) {
  while (true) {
    RelativeBlur blur = FitRelativeBlur(region.samples, region.reference, region.window,
                                        region.modes, region.leakage, options);
    if (!blur.done) return {std::move(region), std::move(blur)};
    std::set<std::size_t> empty;
    for (std::size_t i = 0; i < region.frames.size(); ++i) {
      if (i != region.reference && blur.modes_used[i] < kMinModesOfFrame)
        empty.insert(region.frames[i]);
    }
    if (empty.empty()) return {std::move(region), std::move(blur)};
    if (region.frames.size() - empty.size() < kMinFrames) {
      blur.done = false;
      blur.message =
          fmt::format("the texture of {} frames is lost in blur or noise; only {} frames are left",
                      empty.size(), region.frames.size() - empty.size());
      return {std::move(region), std::move(blur)};
    }
    region = PartOf(
        region, [&empty](std::size_t f) { return empty.count(f) == 0; },
        [](const Mode&) { return true; });
  }
}

BlurEvidence MeasureBlur(const BlurTask& task) { return Measurement(task).Run(); }

}  // namespace thicklens::calib

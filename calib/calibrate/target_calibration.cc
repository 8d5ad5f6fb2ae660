#include "calib/calibrate/target_calibration.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <mutex>
#include <utility>

#include "calib/calibrate/clipped_frames.h"
#include "calib/calibrate/fixed_pattern.h"
#include "calib/calibrate/focus_motion.h"
#include "calib/calibrate/focus_solution.h"
#include "calib/calibrate/light_changes.h"
#include "calib/calibrate/recognised_target.h"
#include "calib/calibrate/response_effects.h"
#include "calib/calibrate/size_statements.h"
#include "calib/calibrate/zero_choice.h"
#include "calib/edges/edge_blur.h"
#include "calib/fit/blur_measurement.h"
#include "calib/fit/known_focus.h"
#include "calib/fit/source_recipe.h"
#include "calib/grid/sheet_marks.h"
#include "calib/registration/axis_contrast.h"
#include "calib/registration/change_of_reference.h"
#include "calib/registration/frame_bands.h"
#include "calib/registration/frame_structure.h"
#include "calib/registration/radial_causes.h"
#include "calib/registration/reading_checks.h"
#include "calib/registration/scale_causes.h"
#include "calib/registration/scale_tracking.h"
#include "calib/registration/spot_tracking.h"
#include "calib/registration/stage_comparison.h"
#include "calib/sharpness/gradient_energy.h"
#include "calib/sharpness/sharpest_reading.h"
#include "calib/sharpness/sharpness.h"
#include "calib/sharpness/sharpness_peak.h"
#include "calib/sweep/frame_selection.h"
#include "calib/sweep/frame_store.h"
#include "calib/uncertainty/calibration_checks.h"
#include "calib/uncertainty/field_map.h"
#include "calib/uncertainty/systematic_advice.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/parallel.h"
#include "thicklens/calib/error_budget.h"
#include "thicklens/calib/frame_correction.h"
#include "thicklens/model/pupil_law.h"

namespace thicklens::calib {
namespace {

constexpr double kZeroReach = 2;        // sigmas by which one zero contradicts another
constexpr double kZeroMoves = 0.1;      // share of the zero's sigma above which a shift matters
constexpr double kFarBetter = 3;        // ratio of errors
constexpr double kSigmasOfChange = 2;   // by which StageComparison changes its amplitudes
constexpr double kPartOfStep = 0.2;     // of the readings, by which known depths may be off
constexpr double kFewRegistered = 0.8;  // share of the used frames; below it the light is checked
// Rounds of finding structure fixed to the frame: the later ones, with better scales, find the
// remainder.
constexpr int kPatternRounds = 3;
// Registered frames that the removal of a true shading may cost.
constexpr std::size_t kFramesByChance = 1;
// Rounds of measuring bands: the second one has better registrations.
constexpr int kBandPasses = 2;
constexpr char kNoOffset[] = "nothing determines the bench offset";

class Calibrator {
 public:
  // With `motion`, the sweep is the equivalent one of a lens or a sensor that moves.
  Calibrator(const FocusSweep& sweep, const CalibrationOptions& options,
             const FocusMotion* motion = nullptr)
      : sweep_(sweep), options_(options), motion_(motion), store_(sweep_), result_(Begun(sweep)) {
    profiles_.resize(sweep_.frames.size());
    energies_.resize(sweep_.frames.size(), 0);
    total_steps_ = kStagesOfProgress * static_cast<int>(sweep.frames.size());
  }

  Calibration Run() {
    const auto begin = std::chrono::steady_clock::now();
    std::string why;
    if (!HasEnoughFrames(sweep_, &why)) {
      Refuse(why);
    } else if (RegionSidePx(sweep_) < kSmallestRegionPx) {
      Refuse(RegionAdvice(sweep_));
    } else {
      Measure();
    }
    CountFrames(&result_);
    result_.summary.chi2_per_dof = result_.diagnostics.blur.chi2_per_dof;
    result_.summary.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    return std::move(result_);
  }

  SweepPreview Preview() {
    SweepPreview preview;
    std::string why;
    if (!HasEnoughFrames(sweep_, &why)) {
      Refuse(why);
    } else if (RegionSidePx(sweep_) < kSmallestRegionPx) {
      Refuse(RegionAdvice(sweep_));
    } else if (MeasureAndCheck() && MeasureSharpness() && RemoveBands({})) {
      preview.samples = Track(std::nullopt);
      preview.passed = RemoveFixedPattern(std::nullopt, &preview.samples);
      preview.reference = reference_;
    }
    FindSharpest();
    preview.found = std::move(result_);
    return preview;
  }

 private:
  static Calibration Begun(const FocusSweep& sweep) {
    Calibration result;
    for (const model::SweepFrame& frame : sweep.frames) {
      FrameMeasurement measurement;
      measurement.image = frame.Name();
      measurement.reading_mm = frame.reading_mm;
      result.frames.push_back(measurement);
    }
    return result;
  }

  bool Refuse(const std::string& reason) {
    result_.summary.outcome = Outcome::kRefused;
    result_.summary.reason = reason;
    return false;
  }
  // Returns whether a quality check let enough frames pass.
  bool Passed(const std::optional<std::string>& refusal) { return !refusal || Refuse(*refusal); }

  void Measure() {
    const bool needs_scale = options_.fit_blur || !sweep_.offset_mm;
    if (MeasureAndCheck() && MeasureSharpness() && RemoveBands({}) &&
        (needs_scale ? FindDepths() : UseGivenOffset())) {
      result_.diagnostics.paper_recipe = RunSourceRecipe(sweep_.camera, result_.frames, used());
      FitPeak();
      if (options_.fit_blur) {
        MeasureAndSolve();
      } else {
        EndBeforeFit();
      }
    }
    FindSharpest();
    const CameraResponse& response = result_.diagnostics.response;
    MeasureLightChanges(sweep_, scales_, result_.frames, !zero_is_open_ && motion_ == nullptr,
                        response.ContradictsTransfer() ? response.light_exponent->value : 1,
                        &store_, &result_.diagnostics.light);
    for (const std::string& text : result_.diagnostics.light.InWords())
      result_.summary.warnings.push_back(text);
    ReportRootCause();
    if (zero_is_open_) ForgetOffset();
    RestoreReadings();
  }

  // Runs also for a sweep that is refused, on the frames that passed the quality checks of the
  // light.
  void FindSharpest() {
    const SharpestReading found = FindSharpestReading(result_.frames, used());
    if (found.done || !result_.diagnostics.sharpest.done) result_.diagnostics.sharpest = found;
  }

  void LookForStructure(const std::vector<ScaleSample>& samples) {
    if (result_.diagnostics.structure.measured) return;
    result_.diagnostics.structure =
        MeasureStructure({sweep_, [this](std::size_t frame) { return Grey(frame); }, used(),
                          samples, RegionCentre(sweep_), [this] { Tick(); }});
  }

  // Asked only where the registrations show a distortion, for which astigmatism may pass.
  bool SeesAstigmatism() {
    return ShowsDistortion(result_) &&
           ShowsAstigmatism(
               ChangeOfAxisContrast(scales_, [this](std::size_t frame) { return Grey(frame); }));
  }

  void EndBeforeFit() {
    result_.summary.outcome = Outcome::kPartial;
    result_.summary.reason = "the fit of the blur was not requested";
  }

  // The reason of a refusal is often only the consequence of a simpler cause.
  void ReportRootCause() {
    const std::string exposure =
        ExposureAdvice(result_.frames, [this] { return store_.Stored(0).depth() == CV_16U; });
    if (result_.summary.outcome != Outcome::kRefused) {
      if (!exposure.empty())
        result_.summary.warnings.insert(
            result_.summary.warnings.begin(),
            exposure + "; the results come from the other frames alone");
      return;
    }
    for (const std::string& cause :
         {exposure, RegionAdvice(sweep_),
          UnitAdvice(sweep_, result_.frames, result_.diagnostics.scale, causes_),
          RegistrationAdvice(sweep_, result_.frames, used(), result_.diagnostics.scale,
                             result_.diagnostics.structure)}) {
      if (cause.empty()) continue;
      // No advice is given on what is missing because of the light.
      result_.summary.reason = cause == exposure
                                   ? cause
                                   : cause + "; the immediate reason is: " + result_.summary.reason;
      return;
    }
  }

  const std::vector<std::size_t>& used() const { return selection_.used(); }

  void Tick() {
    if (options_.progress) {
      const std::lock_guard<std::mutex> lock(progress_mutex_);
      options_.progress(std::min(++steps_done_, total_steps_), total_steps_);
    }
    ThrowIfCancelled();
  }

  template <typename Work>
  void ForEachUsed(const Work& work) {
    ParallelFor(static_cast<int>(used().size()), options_.threads, [&](int i) {
      work(used()[static_cast<std::size_t>(i)]);
      Tick();
    });
  }

  cv::Mat Grey(std::size_t frame) { return store_.Grey(frame); }

  // Applies the absolute checks to every frame, then the blank quality check against the median of
  // the frames that passed them.
  bool MeasureAndCheck() {
    ParallelFor(static_cast<int>(sweep_.frames.size()), options_.threads, [&](int i) {
      MeasureStatistics(static_cast<std::size_t>(i));
      Tick();
    });
    RecogniseTarget([this](std::size_t frame) { return Grey(frame); }, &sweep_, &result_);
    return Passed(selection_.KeepMeasurable(ChecksFor(sweep_.target, options_.checks)));
  }

  void MeasureStatistics(std::size_t frame) {
    const cv::Mat grey = store_.Grey(frame);
    result_.frames[frame].statistics =
        MeasureFrame(RegionOf(store_.Stored(frame), sweep_, frame), grey);
    profiles_[frame] = ProfilesOf(grey);
  }

  // Finds the bands of a lamp that flickers under a rolling shutter and divides them out, and
  // measures sharpness again. `samples` are the registrations, if there are any yet. Without them
  // the frames are registered with their lines made even, which bands have no effect on. Returns
  // false after a refusal.
  bool RemoveBands(const std::vector<ScaleSample>& samples) {
    FrameLight& light = result_.diagnostics.light;
    if (light.bands_removed || IsSparse(sweep_.target)) return true;
    // Undistorted frames show the rows of the sensor as curves, whose light has no one factor.
    if (sweep_.camera.distortion) return true;
    const std::optional<BandAxis> axis = AxisOfBands(samples);
    if (!axis) return true;
    const std::optional<double> known_mm =
        sweep_.offset_mm ? std::optional(sweep_.offset_mm->value) : std::nullopt;
    std::vector<ScaleSample> places = samples;
    std::vector<std::vector<double>> log_gain;
    FrameBands bands;
    for (int pass = 0; pass < kBandPasses; ++pass) {
      if (pass == 0 && samples.empty()) {
        places = TrackScale(
            sweep_, [&](std::size_t frame) { return WithEvenLines(Grey(frame), *axis); }, used(),
            reference_, known_mm, options_.threads, [] { ThrowIfCancelled(); });
      } else if (pass > 0) {
        places = Track(known_mm);
      }
      FrameBands more = MeasureBands(PlacesOf(places), *axis, options_.threads);
      if (!more.done) break;
      if (pass == 0) {
        if (!more.is_significant) return true;
        bands = more;
        log_gain = more.log_gain;
      } else {
        for (std::size_t i = 0; i < log_gain.size(); ++i) {
          for (std::size_t k = 0; k < log_gain[i].size() && !more.log_gain[i].empty(); ++k)
            log_gain[i][k] += more.log_gain[i][k];
        }
      }
      store_.SetLineGains(log_gain, *axis == BandAxis::kColumns);
    }
    if (log_gain.empty()) return true;
    light.bands = bands.deviation;
    light.bands_are_columns = *axis == BandAxis::kColumns;
    light.band_period_px = bands.period_px;
    light.bands_removed = true;
    ForEachUsed([&](std::size_t frame) { MeasureStatistics(frame); });
    return MeasureSharpness();
  }

  // Compares the light of the lines of all used frames.
  std::optional<BandAxis> AxisOfBands(const std::vector<ScaleSample>& samples) const {
    std::vector<std::size_t> order = used();
    std::stable_sort(order.begin(), order.end(), [this](std::size_t a, std::size_t b) {
      return sweep_.frames[a].reading_mm < sweep_.frames[b].reading_mm;
    });
    std::vector<const LightProfiles*> profiles;
    std::vector<const ScaleSample*> places;
    for (const std::size_t frame : order) {
      profiles.push_back(&profiles_[frame]);
      if (samples.empty()) continue;
      const auto found =
          std::find_if(samples.begin(), samples.end(), [&](const ScaleSample& sample) {
            return sample.frame == frame && !sample.scale_is_from_reading;
          });
      places.push_back(found == samples.end() ? nullptr : &*found);
    }
    return SuspectedBands(profiles, places, RegionCentre(sweep_));
  }

  bool MeasureSharpness() {
    double steepest = 0, steepest_relative = 0;
    for (const std::size_t i : used()) {
      const FrameStatistics& s = result_.frames[i].statistics;
      steepest = std::max(steepest, s.top_gradient);
      steepest_relative = std::max(steepest_relative, s.top_gradient / s.mean_linear);
    }
    ForEachUsed([&](std::size_t i) {
      FrameMeasurement& frame = result_.frames[i];
      const cv::Mat grey = Grey(i);
      const double mean = frame.statistics.mean_linear;
      const std::vector<SharpnessIndex> indices = MeanEdgeSlopes(
          grey, {}, {kEdgeThreshold * steepest, kEdgeThreshold * steepest_relative * mean});
      frame.mean_edge_slope = indices[0].mean_edge_slope;
      frame.normalised_edge_slope = indices[1].mean_edge_slope / mean;
      frame.edge_count = indices[1].edge_count;
      energies_[i] = GradientEnergy(grey, frame.statistics.noise_sigma);
      if (const auto blur = MeasureSourceEdgeBlur(grey))
        frame.source_blur_sigma_px = blur->sigma_px;
    });
    reference_ = SharpestUsed();
    if (sweep_.target != model::SweepTarget::kPoints && !Passed(selection_.KeepThoseWithEdges()))
      return false;
    FindSharpest();
    return true;
  }

  // The share of the pixels that the frame correction replaces.
  double ReplacedShare() const {
    if (sweep_.correction == nullptr) return 0;
    const cv::Mat& defects = sweep_.correction->defects();
    return defects.empty() ? 0
                           : static_cast<double>(sweep_.correction->defect_count()) /
                                 static_cast<double>(defects.total());
  }

  std::size_t SharpestUsed() const { return SharpestAmong(used()); }

  std::size_t SharpestAmong(const std::vector<std::size_t>& frames) const {
    std::vector<double> slopes;
    for (const FrameMeasurement& frame : result_.frames)
      slopes.push_back(frame.normalised_edge_slope);
    return SharpestFrame(frames, slopes, IsSparse(sweep_.target) ? slopes : energies_);
  }

  // Determines the bench offset (given, or from the image scale), then every frame's depth.
  bool FindDepths() {
    CollectStatements();
    std::optional<double> known_mm;
    if (sweep_.offset_mm) {
      known_mm = sweep_.offset_mm->value;
    } else if (best_statement_) {
      known_mm = OffsetOfFocusAt(model::FocusDepthOf(sweep_.camera.lens, *best_statement_).value);
    }
    std::vector<ScaleSample> samples = Track(known_mm);
    // Registered frames show weaker bands.
    if (!result_.diagnostics.light.bands_removed) {
      if (!RemoveBands(samples)) return false;
      if (result_.diagnostics.light.bands_removed) samples = Track(known_mm);
    }
    result_.diagnostics.scale = LawOf(samples);
    if (!RemoveFixedPattern(known_mm, &samples)) return false;
    if (TakeStageErrors(EvidenceOfScales(samples), &samples))
      result_.diagnostics.scale = LawWithShading(samples);
    CorrectForFalloff(kDefaultRatio, result_.diagnostics.scale.reference_depth_mm,
                      &result_.diagnostics.scale);
    const bool is_lone_edge =
        IsLoneEdge(sweep_, used().size(), samples.size(), result_.diagnostics.scale);
    if (is_lone_edge) ForgetScales(sweep_, &samples, &result_.diagnostics.scale);
    for (const ScaleSample& sample : samples) {
      if (sample.scale_is_from_reading) continue;
      result_.frames[sample.frame].image_scale = sample.scale;
      result_.frames[sample.frame].image_scale_sigma = sample.registration.scale_sigma;
    }
    if (!is_lone_edge && !ScalesAllowAResult(samples)) return false;
    if (const auto reason = ReasonAgainstScales(result_.frames, used(), result_.diagnostics.scale))
      return Refuse(*reason);
    RejectUnregistered(samples, used(), reference_, result_.diagnostics.scale,
                       result_.diagnostics.structure, &result_.frames);
    WarnOfBands(samples.size());
    RejectWrongReadings(sweep_, samples, result_.diagnostics.scale, &result_.frames);
    if (!Passed(selection_.KeepUnrejected())) return false;
    for (const ScaleSample& sample : samples) {
      if (!result_.frames[sample.frame].rejection.empty()) continue;
      scales_.push_back(sample);
      result_.frames[sample.frame].in_scale_fit = result_.diagnostics.scale.done;
    }
    ReplaceReference();
    if (sweep_.offset_mm && !IsKnownBetterThanOffset()) {
      TakeGivenOffset();
      // The zero of an equivalent target is exact by its construction.
      if (!is_lone_edge && motion_ == nullptr) {
        const OffsetCheck check = CheckGivenOffset(sweep_, UnitThatFits(sweep_, causes_), &result_);
        if (check.refusal) return Refuse(*check.refusal);
        conflicting_offset_mm_ = check.conflicting_mm;
      }
    } else if (!ChooseOffset()) {
      return false;
    }
    if (ShowsDistortion(result_) ||
        FindScaleNonlinearity(scales_, result_.diagnostics.scale, sweep_))
      LookForStructure(scales_);
    if (const auto refusal =
            CheckDistortion(&result_, SeesAstigmatism(), sweep_.camera.distortion.has_value()))
      return Refuse(*refusal);
    if (!stage_.errors.compared || stage_.may_be_jump)
      slip_ = FindReadingStep(scales_, result_.diagnostics.scale);
    if (!stage_.open.empty()) slip_.reset();
    if (slip_) WarnOfReadingStep(sweep_, *slip_, &result_);
    // The scale of an equivalent target is that of a lens that moves to second order only.
    if (motion_ == nullptr || sweep_.moves != model::SweepMotion::kLens)
      bend_ = CheckScaleNonlinearity(sweep_, scales_, &result_);
    return PlacedWithinReach();
  }

  // Finds systematic errors of the stage in the readings as they were written, corrects those of
  // sweep, frames and samples for them, and says so. Returns whether the readings were changed.
  bool TakeStageErrors(const ReadingEvidence& evidence, std::vector<ScaleSample>* samples) {
    // The distance of a lens or sensor that moves was found from the readings as they are written.
    if (motion_ != nullptr) return false;
    FocusSweep written = sweep_;
    for (std::size_t i = 0; i < written.frames.size(); ++i)
      written.frames[i].reading_mm += result_.frames[i].stage_error_mm;
    const StageComparison found = CompareStageErrors(evidence, written);
    // A finding of one kind of evidence stays where another kind shows nothing.
    const bool is_open = !found.open.empty() && !stage_.errors.Corrected();
    if (stage_.errors.compared && IsContradicted(found, written)) return false;
    if (stage_.errors.compared && !found.errors.Corrected() && !is_open) return false;
    auto& warnings = result_.summary.warnings;
    warnings.erase(std::remove(warnings.begin(), warnings.end(), stage_.errors.InWords()),
                   warnings.end());
    stage_ = found;
    result_.diagnostics.stage = found.errors;
    const std::string words = found.errors.InWords();
    if (!words.empty()) warnings.push_back(words);
    if (!found.errors.Corrected()) return false;
    for (std::size_t i = 0; i < sweep_.frames.size(); ++i) {
      const double error_mm = found.error_mm[static_cast<Eigen::Index>(i)];
      sweep_.frames[i].reading_mm = written.frames[i].reading_mm - error_mm;
      result_.frames[i].reading_mm = sweep_.frames[i].reading_mm;
      result_.frames[i].stage_error_mm = error_mm;
    }
    for (ScaleSample& sample : *samples) sample.reading_mm = sweep_.frames[sample.frame].reading_mm;
    return true;
  }

  // Whether the image scale, which was compared before, contradicts a finding of the blur.
  bool IsContradicted(const StageComparison& found, const FocusSweep& written) const {
    const auto n = static_cast<Eigen::Index>(written.frames.size());
    Eigen::VectorXd now_mm(n), written_mm(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      now_mm[i] = sweep_.frames[static_cast<std::size_t>(i)].reading_mm;
      written_mm[i] = written.frames[static_cast<std::size_t>(i)].reading_mm;
    }
    if (found.errors.Corrected()) {
      return ScalesContradict(scales_, now_mm, written_mm - found.error_mm);
    }
    return std::any_of(found.open.begin(), found.open.end(), [&](const auto& cause) {
      return ScalesContradict(scales_, now_mm, written_mm - cause.error_mm);
    });
  }

  // The frames of the result have the readings as they were written.
  void RestoreReadings() {
    for (FrameMeasurement& frame : result_.frames) {
      frame.reading_mm += frame.stage_error_mm;
      if (frame.in_blur_fit || frame.reading_error_mm != 0)
        frame.reading_error_mm += frame.stage_error_mm;
    }
    // An error of the correction moves about half of the frames against the others.
    auto& reading_mm = result_.diagnostics.focus_reading_mm;
    if (!reading_mm) return;
    for (const Eigen::VectorXd& changed_mm : stage_.changed_mm) {
      const Eigen::ArrayXd change_mm = (changed_mm - stage_.error_mm).array() / kSigmasOfChange;
      const double spread_mm = std::sqrt((change_mm - change_mm.mean()).square().mean());
      // Each amplitude was changed in both directions.
      reading_mm->sigma = std::hypot(reading_mm->sigma, spread_mm / std::sqrt(2.0));
    }
  }

  // Looks for errors of the stage in the blur where it shows readings better than the scale does:
  // in a macro sweep the scale hardly changes. Returns whether the readings were corrected.
  bool TakeStageErrorsOfBlur(const BlurEvidence& evidence) {
    if (blur_was_compared_) return false;
    blur_was_compared_ = true;
    const ReadingEvidence blur = EvidenceOfBlur(evidence);
    if (!(ReadingErrorOf(blur, sweep_) < ReadingErrorOf(EvidenceOfScales(scales_), sweep_)) ||
        !TakeStageErrors(blur, &scales_))
      return false;
    ScaleModel& law = result_.diagnostics.scale;
    if (law.done) {
      const ScaleModel before = law;
      law = LawWithShading(scales_);
      if (!law.done) law = before;
      CorrectForFalloff(kDefaultRatio, law.reference_depth_mm, &law);
      if (result_.diagnostics.bench_offset_from == kFromScale)
        result_.summary.bench_offset_mm = law.offset_mm;
    }
    PlaceFrames();
    FitPeak();
    return true;
  }

  std::vector<ScaleSample> Track(const std::optional<double>& known_offset_mm) {
    if (sweep_.target == model::SweepTarget::kPoints) {
      return ScalesOfSpots(sweep_, FollowSpots(
                                       sweep_, [this](std::size_t frame) { return Grey(frame); },
                                       used(), reference_, [this] { Tick(); }));
    }
    return TrackScale(
        sweep_, [this](std::size_t frame) { return Grey(frame); }, used(), reference_,
        known_offset_mm, options_.threads, [this] { Tick(); });
  }

  ScaleModel LawOf(const std::vector<ScaleSample>& samples) const {
    return FitScaleModel(samples, static_cast<int>(reference_), sweep_.reading_sigma_mm,
                         sweep_.direction, RegionCornerRadiusPx(sweep_));
  }

  // Finds structure that is fixed to the frame, removes it from the light of all frames, and
  // measures sharpness and scale again. Returns false after a refusal.
  bool RemoveFixedPattern(const std::optional<double>& known_offset_mm,
                          std::vector<ScaleSample>* samples) {
    FixedPattern& pattern = result_.diagnostics.fixed_pattern;
    if (IsSparse(sweep_.target)) {
      pattern.message = "an edge or points do not show what is fixed to the frame";
      return true;
    }
    const ScaleModel before = result_.diagnostics.scale;
    RemovedDefects defects;
    bool is_first = true, with_shading = true;
    for (int round = 0; round < kPatternRounds; ++round) {
      const FramePlaces places = PlacesOf(*samples);
      std::optional<FixedPatternRemoval> removed_before;
      if (store_.correction() != nullptr) removed_before = *store_.correction();
      const FixedPattern pattern_before = pattern;
      const RemovedDefects defects_before = defects;
      const std::size_t registered = samples->size();
      const RemovedPattern removed = (is_first ? FindFixedPattern : FindRemainingPattern)(
          places, reference_, energies_, with_shading, options_.threads, &store_, &pattern,
          &defects);
      if (!removed.Any()) break;
      if (!MeasureCorrected(known_offset_mm, samples)) return false;
      if (removed.shading && samples->size() + kFramesByChance < registered) {
        // A shading that is there hides the target; without it, more frames are recognised.
        store_.SetCorrection(removed_before);
        pattern = pattern_before;
        pattern.message = "fewer frames can be registered once the fitted shading is divided out";
        defects = defects_before;
        with_shading = false;
        if (!MeasureCorrected(known_offset_mm, samples)) return false;
        continue;
      }
      is_first = false;
    }
    ScaleModel& law = result_.diagnostics.scale;
    const double without_mm = law.offset_mm.sigma;
    AddErrorOfShading(pattern, before, &law);
    AddErrorOfDefects(defects, before, &law);
    shading_sigma_mm_ = std::sqrt(
        std::max(0.0, law.offset_mm.sigma * law.offset_mm.sigma - without_mm * without_mm));
    return true;
  }

  // Measures all that depends on the light of the frames, after its correction has changed. Returns
  // false after a refusal.
  bool MeasureCorrected(const std::optional<double>& known_offset_mm,
                        std::vector<ScaleSample>* samples) {
    ForEachUsed([&](std::size_t frame) { MeasureStatistics(frame); });
    if (!MeasureSharpness()) return false;
    *samples = Track(known_offset_mm);
    result_.diagnostics.scale = LawOf(*samples);
    return true;
  }

  // The law of other readings, with the error that a removed shading leaves in its offset.
  ScaleModel LawWithShading(const std::vector<ScaleSample>& samples) const {
    ScaleModel law = LawOf(samples);
    law.offset_mm.sigma = std::hypot(law.offset_mm.sigma, shading_sigma_mm_);
    return law;
  }

  FramePlaces PlacesOf(const std::vector<ScaleSample>& samples) {
    return {sweep_,
            [this](std::size_t frame) { return Grey(frame); },
            used(),
            samples,
            RegionCentre(sweep_),
            [] { ThrowIfCancelled(); }};
  }

  // Compares the possible causes of the measured scales.
  bool ScalesAllowAResult(const std::vector<ScaleSample>& samples) {
    const ScaleKind kind = result_.diagnostics.scale.kind;
    if (static_cast<double>(samples.size()) < kFewRegistered * static_cast<double>(used().size()))
      LookForStructure(samples);
    if (kind == ScaleKind::kConstant) {
      const std::string warning = ConstantScaleWarning(sweep_, samples);
      if (!warning.empty()) result_.diagnostics.scale.message = warning;
    }
    if (motion_ != nullptr || (kind != ScaleKind::kInverseDepth && kind != ScaleKind::kReversed))
      return true;
    causes_ = CompareScaleCauses(samples, sweep_);
    result_.diagnostics.diagnoses.push_back(causes_.diagnosis);
    const auto reason = ReasonOfScaleCauses(sweep_, result_.diagnostics.scale, causes_);
    return !reason || Refuse(*reason);
  }

  void WarnOfBands(std::size_t registered) {
    if (!result_.diagnostics.structure.HasBands() || !result_.diagnostics.scale.done) return;
    const std::size_t frames = used().size();
    result_.summary.warnings.push_back(
        fmt::format("only {} of {} frames could be registered: {}{}", registered, frames,
                    BandsInWords(result_.diagnostics.structure),
                    BandsExplain(result_.diagnostics.structure, frames - registered, frames)
                        ? ""
                        : "; this does not explain so many missing frames: some may show another "
                          "part of the target"));
  }

  // Depth of reading 0 if the sharpest reading lies at that depth.
  double OffsetOfFocusAt(double focus_depth_mm) const {
    return focus_depth_mm - model::DirectionSign(sweep_.direction) * SharpestReadingMm();
  }
  double SharpestReadingMm() const {
    const SharpestReading& sharpest = result_.diagnostics.sharpest;
    return sharpest.done ? sharpest.reading_mm.value : result_.frames[reference_].reading_mm;
  }

  // Finds what is stated of the plane of focus, the period of the target included.
  void CollectStatements() {
    statements_ = sweep_.stated_focus;
    if (sweep_.target_period_mm) {
      const double beyond_mm = model::DirectionSign(sweep_.direction) *
                               (result_.frames[reference_].reading_mm - SharpestReadingMm());
      if (const auto measured = MagnificationOfPeriod(sweep_, Grey(reference_), beyond_mm))
        statements_.push_back(*measured);
    }
    if (motion_ == nullptr) {
      result_.diagnostics.marks = FindSheetMarks(sweep_, SharpestFrames());
      const SizeStatements sizes =
          StatementsOfSizes(sweep_, result_.diagnostics.marks, SharpestReadingMm());
      statements_.insert(statements_.end(), sizes.found.begin(), sizes.found.end());
      result_.summary.warnings.insert(result_.summary.warnings.end(), sizes.warnings.begin(),
                                      sizes.warnings.end());
    }
    best_statement_ = MostPrecise(sweep_.camera, statements_);
  }

  // Frames that show marks best.
  std::vector<MarkedFrame> SharpestFrames() {
    constexpr std::size_t kCount = 3;
    std::vector<std::size_t> order = used();
    std::stable_sort(order.begin(), order.end(), [this](std::size_t a, std::size_t b) {
      return result_.frames[a].normalised_edge_slope > result_.frames[b].normalised_edge_slope;
    });
    order.resize(std::min(order.size(), kCount));
    std::vector<MarkedFrame> frames;
    for (const std::size_t i : order) frames.push_back({sweep_.frames[i].reading_mm, Grey(i)});
    return frames;
  }

  // Whether a statement of the plane of focus, or the image scale by far, is more precise than the
  // stated offset. A rough offset then only has to agree. Pupil laws move the zero of the scale.
  bool IsKnownBetterThanOffset() const {
    const double sigma_mm = sweep_.offset_mm->sigma;
    if (best_statement_ &&
        FocusDepthWithTolerance(sweep_.camera, *best_statement_).sigma < sigma_mm)
      return true;
    const ScaleModel& law = result_.diagnostics.scale;
    if (!law.done || sweep_.camera.objective || !ScaleDeterminesDepth(law)) return false;
    const Eigen::Vector2d& laws_mm = law.offset_of_pupil_laws_mm;
    return kFarBetter * std::hypot(law.offset_mm.sigma, 0.5 * (laws_mm.y() - laws_mm.x())) <
           sigma_mm;
  }

  // Takes the bench offset from the image scale or from what is stated of the plane of focus,
  // whichever is more precise. Where neither exists, the offset stays open: the reading at focus is
  // found without it.
  bool ChooseOffset() {
    const ScaleModel& law = result_.diagnostics.scale;
    if (best_statement_) {
      const model::Estimate focus_mm = FocusDepthWithTolerance(sweep_.camera, *best_statement_);
      if (!law.done || sweep_.camera.objective || !ScaleDeterminesDepth(law) ||
          focus_mm.sigma < law.offset_mm.sigma) {
        known_focus_ = best_statement_;
        result_.diagnostics.bench_offset_from = known_focus_->name;
        result_.summary.bench_offset_mm =
            Result{OffsetOfFocusAt(focus_mm.value), focus_mm.sigma, std::nullopt};
        return true;
      }
    }
    if (law.done && ScaleDeterminesDepth(law)) {
      result_.summary.bench_offset_mm = law.offset_mm;
      result_.diagnostics.bench_offset_from = kFromScale;
      return true;
    }
    if (!law.done && !law.changes_too_little) return Refuse(ReasonOfUnknownOffset(law));
    zero_is_open_ = true;
    if (sweep_.target_period_mm) {
      result_.summary.warnings.emplace_back(
          "target_period_mm is stated, but the sharpest frame shows no periodic texture");
    }
    result_.summary.bench_offset_mm =
        Result{OffsetOfFocusAt(UsualFocusDepth(sweep_.camera, scales_, SharpestReadingMm())), 0,
               std::nullopt};
    return true;
  }

  // Whether the image scale shows on which side of the focal point, where d1 and kappa become
  // infinite, the target is. A target that is clearly nearer is a contradiction, which is found
  // later.
  bool ScaleDeterminesDepth(const ScaleModel& law) const {
    const double depth_mm =
        law.offset_mm.value + model::DirectionSign(sweep_.direction) * SharpestReadingMm();
    return std::abs(depth_mm - sweep_.camera.lens.front_focal_length_mm) >
           kKnownSigmas * law.offset_mm.sigma;
  }

  // Removes what depends on an offset that nothing determines.
  void ForgetOffset() {
    result_.summary.bench_offset_mm.reset();
    result_.diagnostics.paper_recipe = {};
    result_.diagnostics.paper_recipe.message = kNoOffset;
    result_.diagnostics.sharpness = {};
    result_.diagnostics.sharpness.message = kNoOffset;
    for (FrameMeasurement& frame : result_.frames) frame.depth_mm = 0;
  }

  double ReadingRangeMm() const {
    const auto [low, high] =
        std::minmax_element(used().begin(), used().end(), [&](std::size_t a, std::size_t b) {
          return result_.frames[a].reading_mm < result_.frames[b].reading_mm;
        });
    return result_.frames[*high].reading_mm - result_.frames[*low].reading_mm;
  }

  // Takes the given bench offset and the readings as they are.
  bool UseGivenOffset() {
    TakeGivenOffset();
    return PlacedWithinReach();
  }

  void TakeGivenOffset() {
    result_.summary.bench_offset_mm =
        Result{sweep_.offset_mm->value, sweep_.offset_mm->sigma, std::nullopt};
    result_.diagnostics.bench_offset_from = kFromOffset;
  }

  bool PlacedWithinReach() {
    PlaceFrames();
    // These depths are only where the search starts.
    if (zero_is_open_ || known_focus_) return true;
    return Passed(selection_.KeepPossibleDepths(result_.summary.bench_offset_mm->value,
                                                sweep_.camera.lens.front_focal_length_mm));
  }

  void PlaceFrames() {
    const double sign = model::DirectionSign(sweep_.direction);
    for (FrameMeasurement& frame : result_.frames)
      frame.depth_mm = result_.summary.bench_offset_mm->value + sign * frame.reading_mm;
  }

  // The image scale's zero is the centre of perspective. Its distance from the aperture depends on
  // the blur and on how the light spreads over the pupil, which is unknown for a real lens: the
  // paper's law gives the value, and the other laws give an interval around it.
  void CorrectForFalloff(double blur_ratio, double focus_depth_mm, ScaleModel* law) const {
    const model::Camera& camera = sweep_.camera;
    law->offset_of_pupil_laws_mm.setConstant(law->offset_mm.value);
    if (!law->done || !(focus_depth_mm > camera.lens.front_focal_length_mm)) return;
    const double line_zero_mm = law->line_zero_mm();
    const auto centre_mm = [&](model::PupilLaw pupil) {
      if (motion_ != nullptr) {
        return motion_->EquivalentCentreMm(model::CentreOfPerspectiveMm(
            motion_->lens(), camera.psf, pupil, blur_ratio, motion_->FocusDepthMm()));
      }
      return model::CentreOfPerspectiveMm(camera.lens, camera.psf, pupil, blur_ratio,
                                          focus_depth_mm);
    };
    law->centre_mm = centre_mm(model::PupilLaw::kPaper);
    law->offset_mm.value = line_zero_mm + law->centre_mm;
    law->offset_of_pupil_laws_mm.setConstant(law->offset_mm.value);
    for (const model::PupilLaw pupil : model::AllPupilLaws()) {
      const double offset_mm = line_zero_mm + centre_mm(pupil);
      law->offset_of_pupil_laws_mm = {std::min(law->offset_of_pupil_laws_mm.x(), offset_mm),
                                      std::max(law->offset_of_pupil_laws_mm.y(), offset_mm)};
    }
  }

  // The sharpest frame may be the one with the wrong reading. Then the next sharpest takes its
  // place, and the registrations to the old reference are converted to the new one.
  void ReplaceReference() {
    if (result_.frames[reference_].rejection.empty()) return;
    std::vector<std::size_t> registered;
    for (const ScaleSample& sample : scales_) registered.push_back(sample.frame);
    reference_ = registered.empty() ? SharpestUsed() : SharpestAmong(registered);
    const auto next =
        std::find_if(scales_.begin(), scales_.end(),
                     [this](const ScaleSample& sample) { return sample.frame == reference_; });
    if (next != scales_.end()) ReferTo(next->registration, &scales_);
  }

  void FitPeak() {
    std::vector<SharpnessSample> samples;
    for (const std::size_t i : used()) {
      samples.push_back({result_.frames[i].depth_mm, result_.frames[i].normalised_edge_slope});
    }
    result_.diagnostics.sharpness = FitSharpnessPeak(samples);
  }

  // Flat and defocused frames show the noise alone, but a fine texture in focus resembles noise: a
  // low quantile of the frames is taken.
  double SweepNoise() const {
    std::vector<double> noises;
    for (const std::size_t i : used()) noises.push_back(result_.frames[i].statistics.noise_sigma);
    std::sort(noises.begin(), noises.end());
    return noises[noises.size() / 10];
  }

  void MeasureAndSolve() {
    const double start_mm = result_.diagnostics.sharpness.done
                                ? result_.diagnostics.sharpness.focus_depth_mm
                                : result_.frames[reference_].depth_mm;
    ClippedFrames clipped =
        IsSparse(sweep_.target)
            ? ClippedFrames()
            : ChooseClippedFrames(result_.frames, used(), start_mm, ReplacedShare());
    BlurTask task(sweep_, store_);
    task.frames = LeaveOutClipped(
        &clipped, used(),
        [this](const std::vector<std::size_t>& some) { return SharpestAmong(some); }, &reference_,
        &scales_, &result_);
    task.reference = reference_;
    task.scales = scales_;
    task.scale_centre_mm = result_.diagnostics.scale.centre_mm;
    task.law = zero_is_open_ || result_.diagnostics.scale.kind == ScaleKind::kConstant
                   ? BlurModel::kTelecentric
                   : BlurModel::kPerspective;
    task.known_focus = known_focus_;
    task.zero_is_open = zero_is_open_;
    task.scale_follows_readings = result_.diagnostics.scale.done;
    task.offset_mm = {result_.summary.bench_offset_mm->value,
                      result_.summary.bench_offset_mm->sigma};
    task.reading_sigma_mm = sweep_.reading_sigma_mm;
    task.reading_sigma_is_known = sweep_.reading_sigma_mm > 0;
    if (!task.reading_sigma_is_known && result_.diagnostics.scale.done) {
      // No sigma was stated, but the scale law has measured it.
      task.reading_sigma_mm = result_.diagnostics.scale.reading_rms_mm;
    }
    const auto [nearest, farthest] = DepthRange();
    task.start_focus_depth_mm = std::clamp(start_mm, nearest, farthest);
    task.pixel_noise = SweepNoise();
    const FrameLight& light = result_.diagnostics.light;
    task.rows_had_bands = light.bands_removed && !light.bands_are_columns;
    task.columns_had_bands = light.bands_removed && light.bands_are_columns;
    task.threads = options_.threads;
    task.tick = [this] { Tick(); };
    BlurEvidence evidence = MeasureBlur(task);
    if (TakeStageErrorsOfBlur(evidence)) return MeasureAndSolve();
    BlurFitResult fit;
    const Calibration before = result_;
    SolveFocus(sweep_, &evidence, &fit, &result_, motion_);
    if (ReplaceRejectedReference(before) || RefineOffsetWithFittedBlur(before) ||
        RefineOffsetOfKnownFocus(before, fit))
      return MeasureAndSolve();
    if (!result_.frames[reference_].rejection.empty()) return;
    if (known_focus_) {
      // These use the depths, which the fit has moved.
      result_.diagnostics.paper_recipe = RunSourceRecipe(sweep_.camera, result_.frames, used());
      FitPeak();
    }
    if (sweep_.target_period_mm && result_.diagnostics.bench_offset_from != kFromPeriod)
      CheckMagnification(sweep_, reference_, Grey(reference_), &result_);
    if (result_.summary.outcome == Outcome::kRefused) return NameContradictions(fit);
    WidenByContradictions(evidence, fit);
    WidenByClipping(clipped, &result_);
    if (motion_ == nullptr)
      CompareWithStatements(sweep_, statements_, evidence.setup, fit, &result_);
    task.scales = scales_;
    task.offset_mm = evidence.setup.offset_mm;
    task.tick = [] { ThrowIfCancelled(); };
    CheckCameraResponse(task, evidence, fit, &result_);
    (options_.map_field ? MapField : CompareZones)(sweep_, evidence, fit, &store_, &result_);
  }

  // A statement that is grossly wrong makes the blur impossible. The contradiction is the reason.
  void NameContradictions(const BlurFitResult& fit) {
    if (!fit.done || zero_is_open_) return;
    const model::Estimate found_mm{fit.values[kFocusDepth],
                                   std::sqrt(fit.covariance(kFocusDepth, kFocusDepth))};
    std::string& reason = result_.summary.reason;
    for (const FocusComparison& other : CompareFocus(sweep_, statements_, found_mm, result_))
      if (!other.source.agrees) reason = other.text + "; the immediate reason is: " + reason;
  }

  // Adds the remaining error of the stage: that of the corrections or, where the cause is open,
  // each cause. It is not known which run has the readings of a stated zero.
  void WidenByStage(const BlurEvidence& evidence, const BlurFitResult& fit) {
    const BlurFitSetup& setup = evidence.setup;
    std::vector<BlurFitSetup> setups;
    const auto add = [&](const Eigen::VectorXd& shift_mm) {
      setups.push_back(WithShiftedReadings(sweep_, setup, evidence.frames, shift_mm, scales_,
                                           reference_, result_));
    };
    if (stage_.errors.Corrected()) {
      for (const Eigen::VectorXd& changed_mm : stage_.changed_mm) add(changed_mm - stage_.error_mm);
    }
    for (const ReadingPattern& pattern : stage_.open) add(pattern.error_mm - stage_.error_mm);
    if (result_.diagnostics.bench_offset_from == kFromOffset && motion_ == nullptr) {
      const double sign = model::DirectionSign(sweep_.direction);
      for (const auto& step_mm : {stage_.errors.backlash_mm, stage_.errors.slip_mm}) {
        if (!step_mm) continue;
        for (const BlurFitSetup& other :
             WithOffsets(setup, {setup.offset_mm.value + sign * step_mm->value}))
          setups.push_back(other);
      }
    }
    if (setups.empty()) return;
    WidenByTrials("errors of the stage",
                  "approach every position from the same side, and repeat the sweep with another "
                  "step",
                  setups, fit, &result_, known_focus_);
  }

  // A lens with the distortion d at the corner magnifies a place by 1 + 3 d rho^2 along the radius
  // and by 1 + d rho^2 along the tangent, and the blur there alike. The mean over a rectangle, on
  // which rho^2 has the mean 1/3, is 1 + 2 d/3 [D155]. The blur that was measured is between that
  // of the axis, to which kappa refers, and this mean.
  void WidenByDistortion() {
    if (!ShowsDistortion(result_) || !result_.summary.blur_ratio) return;
    const model::Estimate& corner = *result_.diagnostics.scale.distortion_at_corner;
    const double most = corner.value + std::copysign(kZeroReach * corner.sigma, corner.value);
    const double move = result_.summary.blur_ratio->value * (1 / (1 + 2 * most / 3) - 1);
    WidenRatio("distortion of the lens", {std::min(0.0, move), std::max(0.0, move)},
               sweep_.camera.distortion
                   ? "measure the distortion at the focus of the sweep: what is left was found in "
                     "undistorted frames"
                   : "state the distortion of the lens by --distortion FILE",
               &result_);
  }

  // Widens the systematic intervals by the findings of the checks, as far as they move the results.
  void WidenByContradictions(const BlurEvidence& evidence, const BlurFitResult& fit) {
    const BlurFitSetup& setup = evidence.setup;
    WidenByStage(evidence, fit);
    WidenByDistortion();
    if (result_.diagnostics.bench_offset_from == kFromScale) {
      const Eigen::Vector2d& offsets_mm = result_.diagnostics.scale.offset_of_pupil_laws_mm;
      WidenByTrials(
          "light distribution over the pupil",
          "measure offset_mm: a bench offset from the image scale depends on how the light "
          "is distributed over the pupil",
          WithOffsets(setup, {offsets_mm.x(), offsets_mm.y()}), fit, &result_);
    }
    if (conflicting_offset_mm_) {
      // If the other zero is assumed, its error must be assumed too.
      const model::Estimate& zero = *conflicting_offset_mm_;
      const double reach_mm = kZeroReach * zero.sigma;
      const Eigen::Vector2d& laws_mm = result_.diagnostics.scale.offset_of_pupil_laws_mm;
      WidenByTrials("given offset_mm", "measure offset_mm again: the image scale contradicts it",
                    WithOffsets(setup, {laws_mm.x() - reach_mm, laws_mm.y() + reach_mm}), fit,
                    &result_);
    }
    if (slip_) {
      WidenByTrials("jump of the readings", "find the part that slipped, or take the sweep again",
                    WithoutReadingStep(sweep_, setup, *slip_, scales_, reference_, result_), fit,
                    &result_, known_focus_);
    }
    if (bend_ && result_.diagnostics.bench_offset_from == kFromScale) {
      const double half_mm = 0.5 * std::abs(bend_->zero_spread_mm);
      const double zero_mm = setup.offset_mm.value;
      WidenByTrials("nonlinearity of the image scale",
                    NonlinearityRemedy(result_.diagnostics.structure),
                    WithOffsets(setup, {zero_mm - half_mm, zero_mm + half_mm}), fit, &result_);
    }
  }

  // Everything was measured relative to the reference. If its blur does not follow the others', the
  // next sharpest frame takes its place.
  bool ReplaceRejectedReference(const Calibration& before) {
    if (result_.frames[reference_].rejection.empty()) return false;
    std::vector<std::pair<std::string, double>> rejections;
    for (const FrameMeasurement& frame : result_.frames)
      rejections.emplace_back(frame.rejection, frame.reading_error_mm);
    result_ = before;
    for (std::size_t i = 0; i < rejections.size(); ++i) {
      result_.frames[i].rejection = rejections[i].first;
      result_.frames[i].reading_error_mm = rejections[i].second;
    }
    const auto is_rejected = [this](const ScaleSample& sample) {
      return !result_.frames[sample.frame].rejection.empty();
    };
    scales_.erase(std::remove_if(scales_.begin(), scales_.end(), is_rejected), scales_.end());
    if (!Passed(selection_.KeepUnrejected())) return false;
    ReplaceReference();
    return true;
  }

  // The bench offset of the image scale was found with a usual blur ratio. It is found once more if
  // the fitted ratio moves it by more than a part of its error.
  bool RefineOffsetWithFittedBlur(const Calibration& before) {
    if (result_.diagnostics.bench_offset_from != kFromScale || zero_is_settled_ ||
        !result_.summary.blur_ratio)
      return false;
    zero_is_settled_ = true;
    Calibration again = before;
    CorrectForFalloff(result_.summary.blur_ratio->value, result_.summary.focus_depth_mm->value,
                      &again.diagnostics.scale);
    const Result& zero_mm = again.diagnostics.scale.offset_mm;
    if (!(std::abs(zero_mm.value - before.diagnostics.scale.offset_mm.value) >
          kZeroMoves * zero_mm.sigma))
      return false;
    result_ = std::move(again);
    result_.summary.bench_offset_mm = result_.diagnostics.scale.offset_mm;
    PlaceFrames();
    return true;
  }

  // The blur was measured for the depths that the sharpest reading gives. It is measured once more
  // if the fit moves them by more than a part of a step.
  bool RefineOffsetOfKnownFocus(const Calibration& before, const BlurFitResult& fit) {
    if (!known_focus_ || zero_is_settled_ || !result_.summary.blur_ratio) return false;
    zero_is_settled_ = true;
    const double moved_mm =
        std::abs(fit.values[kBenchOffset] - before.summary.bench_offset_mm->value);
    const double step_mm = ReadingRangeMm() / static_cast<double>(used().size());
    if (!(moved_mm > kPartOfStep * step_mm)) return false;
    result_ = before;
    result_.summary.bench_offset_mm->value = fit.values[kBenchOffset];
    PlaceFrames();
    return true;
  }

  std::pair<double, double> DepthRange() const {
    const auto [low, high] =
        std::minmax_element(used().begin(), used().end(), [&](std::size_t a, std::size_t b) {
          return result_.frames[a].depth_mm < result_.frames[b].depth_mm;
        });
    return {result_.frames[*low].depth_mm, result_.frames[*high].depth_mm};
  }

  FocusSweep sweep_;  // its readings are corrected for errors of the stage
  const CalibrationOptions& options_;
  const FocusMotion* motion_;
  FrameStore store_;
  Calibration result_;
  FrameSelection selection_{&result_.frames};  // frames that passed the quality checks
  std::size_t reference_ = 0;                  // the sharpest of them, normalised
  std::vector<LightProfiles> profiles_;        // by the index in the sweep
  std::vector<double> energies_;               // GradientEnergy, by the index in the sweep
  std::vector<ScaleSample> scales_;            // registered frames
  ScaleCauses causes_;                         // possible causes of the scales
  std::optional<ReadingStep> slip_;
  std::optional<ScaleNonlinearity> bend_;
  StageComparison stage_;
  bool blur_was_compared_ = false;
  bool zero_is_settled_ = false;
  double shading_sigma_mm_ = 0;  // error of the scale's offset by the error of a removed shading
  std::vector<model::StatedConjugate> statements_;  // what is stated of the plane of focus
  std::optional<model::StatedConjugate> best_statement_, known_focus_;
  bool zero_is_open_ = false;  // nothing determines the bench offset
  // The zero from the image scale where it contradicts the given one.
  std::optional<model::Estimate> conflicting_offset_mm_;
  std::mutex progress_mutex_;
  int steps_done_ = 0;
  int total_steps_ = 0;
};

}  // namespace

Calibration CalibrateTarget(const FocusSweep& sweep, const CalibrationOptions& options,
                            const FocusMotion* motion) {
  return Calibrator(sweep, options, motion).Run();
}

SweepPreview PreviewTarget(const FocusSweep& sweep, const CalibrationOptions& options) {
  return Calibrator(sweep, options).Preview();
}

}  // namespace thicklens::calib

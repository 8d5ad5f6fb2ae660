#include "thicklens/estimate.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <mutex>
#include <utility>

#include "thicklens/base/memory_available.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/stopwatch.h"
#include "thicklens/base/utc_time.h"
#include "thicklens/estimator/estimate_checks.h"
#include "thicklens/estimator/inpaint.h"
#include "thicklens/estimator/ray_confidence.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/version.h"
#include "tools/interface/blur_proposal.h"
#include "tools/interface/contradiction.h"
#include "tools/interface/depth_values_choice.h"
#include "tools/interface/problem.h"
#include "tools/interface/solve.h"
#include "tools/interface/validation.h"

namespace thicklens {
namespace {

constexpr double kEightBitLevels = 255;

void RequireValidEstimate(const DepthMap& depth, const std::optional<Camera>& camera,
                          const EstimateOptions& options, const RunControl& run) {
  checks::RequireValid(run);
  checks::RequireValid(options);
  std::string why;
  if (!depth.IsValid(&why))
    throw OptionError("depth." + why.substr(0, why.find(':')), "depth." + why);
  if (camera) {
    checks::RequireValidCamera(*camera);
    return;
  }
  if (options.lens_position) throw OptionError("lens_position", "lens_position: needs a camera");
  if (options.sensor_origin) throw OptionError("sensor_origin", "sensor_origin: needs a camera");
  if (options.st_depth_mm) throw OptionError("st_depth_mm", "st_depth_mm: needs a camera");
  if (options.exif == ExifCheck::kIgnore) {
    throw OptionError("exif", "exif: needs a camera, which the EXIF may contradict");
  }
}

// The confidence of an estimate whose solver does not report it; it depends on the depth alone.
template <typename Take>
void FindConfidence(const estimator::EstimateInput& input, int threads, const Take& take) {
  const std::vector<estimator::Confidence> of_points = estimator::PointConfidence(input, threads);
  const estimator::DisparityRenderer renderer(input.disparity);
  const auto u_count = static_cast<int>(input.weights.cols());
  const auto v_count = static_cast<int>(input.weights.rows());
  ParallelFor(u_count * v_count, threads, [&](int i) {
    ThrowIfCancelled();
    const int k = i % u_count, l = i / u_count;
    const estimator::CompactView view =
        renderer.RenderCompact(k - (u_count - 1) / 2.0, l - (v_count - 1) / 2.0);
    take(k, l, estimator::RayConfidence(of_points, view));
  });
}

// Counts confidences, and the time that a program's sink takes, on their way to it.
class CountingSink : public ViewSink {
 public:
  explicit CountingSink(ViewSink* sink) : sink_(sink) {}
  void TakeView(int k, int l, const model::LinearImage& view) override {
    const auto start = Clock::now();
    sink_->TakeView(k, l, view);
    AddSecondsSince(start);
  }
  void TakeConfidence(int k, int l, const std::vector<std::uint8_t>& confidence,
                      int width_px) override {
    const auto start = Clock::now();
    sink_->TakeConfidence(k, l, confidence, width_px);
    AddSecondsSince(start);
    Count(confidence.begin(), confidence.end());
  }
  double BytesForView(double values) const override { return sink_->BytesForView(values); }
  template <typename Iterator>
  void Count(Iterator begin, Iterator end) {
    std::array<std::size_t, 256> counts{};
    for (; begin != end; ++begin) ++counts[*begin];
    const std::lock_guard<std::mutex> lock(mutex_);
    for (std::size_t i = 0; i < counts.size(); ++i) counts_[i] += counts[i];
  }
  const std::array<std::size_t, 256>& counts() const { return counts_; }
  double seconds() const { return seconds_; }  // in the program's sink, summed over the threads

 private:
  void AddSecondsSince(Clock::time_point start) {
    const double seconds = SecondsSince(start);
    const std::lock_guard<std::mutex> lock(mutex_);
    seconds_ += seconds;
  }

  ViewSink* sink_;
  std::mutex mutex_;
  double seconds_ = 0;
  std::array<std::size_t, 256> counts_{};
};

void Inpaint(const estimator::EstimateInput& input, RunScope* run, LightFieldEstimate* estimate) {
  estimator::InpaintOptions settings;
  settings.threads = run->threads();
  settings.progress = run->ProgressOf("inpainting");
  estimator::InpaintSummary& summary = estimate->diagnostics.inpainting.emplace();
  estimator::InpaintOccludedRays(input.disparity, settings, &estimate->light_field, &summary);
  estimate->light_field.origin.method += "+telea";
  estimate->summary.seconds.views += summary.seconds;
}

void CheckResult(const PreparedProblem& prepared, const Solved& solved,
                 LightFieldEstimate* estimate) {
  const estimator::DisparityMap& disparity = prepared.input->disparity;
  EstimateDiagnostics& found = estimate->diagnostics;
  const estimator::StepCheck steps =
      estimator::CheckSteps(disparity, estimate->light_field.landing_step_px);
  found.largest_step_px = steps.largest_px;
  found.coarse_share = steps.share;
  if (!solved.maps) return;
  const double noise_sigma = found.DoubtSigmaOfMean().value_or(0);
  for (const estimator::ResidualPatch& patch :
       estimator::ResidualPatches(solved.maps->residual, solved.maps->occluded_fraction,
                                  disparity.width_px, disparity.height_px, noise_sigma)) {
    found.patches.push_back({patch.x, patch.y, patch.width_px, patch.height_px, patch.rms});
  }
  found.unexplained_share =
      estimator::UnexplainedShare(solved.maps->residual, solved.maps->occluded_fraction,
                                  disparity.width_px, disparity.height_px, noise_sigma);
}

// Residual in terms of the noise above which a photograph is in doubt, and above which this is
// reported also where nothing else is.
constexpr double kDoubtful = 1.5, kUnexplainedAnyway = 2;

bool IsInDoubt(const EstimateDiagnostics& found, double limit) {
  const std::optional<double> noise_sigma = found.DoubtSigma();
  return found.residual_rms && noise_sigma && *found.residual_rms > limit * *noise_sigma;
}

// A photograph in doubt may have a map whose rows or columns are stored the other way.
void CheckFlips(const PreparedProblem& prepared, const EstimateOptions& options, RunScope* run,
                LightFieldEstimate* estimate) {
  EstimateDiagnostics& found = estimate->diagnostics;
  if (!std::holds_alternative<SceneSolver>(options.solver) || !IsInDoubt(found, kDoubtful)) return;
  const auto start = Clock::now();
  estimator::DepthFlipOptions check;
  check.falloff = prepared.effects.on.Has(Effect::kFalloff);
  check.compression_sigma = found.compression_sigma.value_or(0);
  check.photo_aperture = found.used_photo_aperture;
  check.threads = run->threads();
  check.memory_limit_mib =
      options.memory_limit_mib ? options.memory_limit_mib : UsualMemoryLimitMib();
  try {
    found.depth_flips = estimator::CheckDepthFlips(*prepared.input, check);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& error) {
    run->Detail(fmt::format("reversed depth maps were not tried: {}", error.what()));
  }
  estimate->summary.seconds.depth_flips = SecondsSince(start);
}

std::string WordsOf(model::DepthFlip flip) {
  switch (flip) {
    case model::DepthFlip::kRows:
      return "upside down";
    case model::DepthFlip::kColumns:
      return "with left and right exchanged";
    default:
      return "turned by 180 degrees";
  }
}

std::string ReversedText(const DepthOrigin& depth, const LightFieldEstimate& estimate,
                         const RunScope& run) {
  const estimator::DepthFlipCheck& flips = *estimate.diagnostics.depth_flips;
  const EstimateSummary& summary = estimate.summary;
  const model::DepthFlip flip = model::Combined(depth.flip, flips.better->flip);
  return fmt::format(
      "{}: {}, the map explains the photograph down to {:.1f} grey levels, as it is only to "
      "{:.1f} (noise: {:.1f}{}): it is probably stored the other way; {} reads it so",
      depth.name, WordsOf(flips.better->flip), kEightBitLevels * flips.better->residual_rms,
      kEightBitLevels * flips.trials.front().residual_rms, kEightBitLevels * flips.noise_sigma,
      summary.width_px >= 256 && summary.height_px >= 256 ? ", at a reduced size" : "",
      flip == model::DepthFlip::kNone
          ? fmt::format("without {} the program", run.Option("depth.flip"))
          : fmt::format("{} {}", run.Option("depth.flip"), model::DepthFlipName(flip)));
}

// Returns which causes do not explain the photograph, and which were not tested, as a part of a
// sentence.
std::string TestedText(const EstimateDiagnostics& found) {
  using estimator::DepthCause;
  const auto is_tried = [&found](DepthCause cause) {
    if (!found.contradiction) return false;
    const auto& trials = found.contradiction->trials;
    return std::any_of(trials.begin(), trials.end(), [cause](const estimator::DepthCauseTrial& of) {
      return of.cause == cause && (of.edges || of.spectra || of.residual);
    });
  };
  std::vector<std::string> tested, untested;
  const auto add = [&](bool is_tested, const char* cause) {
    (is_tested ? tested : untested).emplace_back(cause);
  };
  const bool has_place = is_tried(DepthCause::kNone);  // by edges
  add(is_tried(DepthCause::kRows) || found.depth_flips, "order");
  add(has_place, "place");
  add(has_place, "another image");
  add(is_tried(DepthCause::kSign), "sign");
  add(is_tried(DepthCause::kScale), "scale");
  add(is_tried(DepthCause::kOffset), "offset");
  std::string text;
  if (!tested.empty()) {
    text = fmt::format("none of the causes that were tested ({}) explains it",
                       fmt::join(tested, ", "));
  }
  if (untested.empty()) return text;
  const std::string why =
      found.contradiction ? found.contradiction->values_untested : "the check itself failed";
  return fmt::format("{}{}{} could not be tested{}", text, text.empty() ? "" : ", and ",
                     fmt::join(untested, ", "), why.empty() ? "" : fmt::format(" ({})", why));
}

std::string NoiseText(const EstimateDiagnostics& found) {
  return found.compression_sigma ? "noise and JPEG compression" : "noise";
}

// Returns the causes that the measure of a compression does not know of; empty without compression.
std::string JpegCauseText(const EstimateDiagnostics& found) {
  return found.compression_sigma
             ? "; the photograph is a JPEG file: stronger compression before, halved colours and "
               "sharpening have this effect too"
             : "";
}

std::string UnexplainedText(const DepthOrigin& depth, const EstimateDiagnostics& found,
                            const RunScope& run) {
  const bool is_large =
      found.unexplained_share && *found.unexplained_share > estimator::kMaxUnexplained;
  return fmt::format(
      "{}: {} of the photograph is not explained beyond its {} of {:.1f} grey levels: its residual "
      "of {:.1f} grey levels is {:.1f} times that; {}; check that the map belongs to this "
      "photograph, and {}{}",
      depth.name, is_large ? fmt::format("{:.0f} %", 100 * *found.unexplained_share) : "a part",
      NoiseText(found), kEightBitLevels * *found.DoubtSigma(),
      kEightBitLevels * *found.residual_rms, *found.residual_rms / *found.DoubtSigma(),
      TestedText(found),
      depth.meaning.kind == DepthKind::kDisparity
          ? fmt::format("{} and {}", run.Option("depth.meaning.disparity_scale"),
                        run.Option("depth.meaning.disparity_offset_px"))
          : fmt::format("its unit ({}) and the camera's aperture and focus",
                        run.Option("depth.meaning.unit")),
      JpegCauseText(found));
}

// A photograph that contradicts its depth, or that nothing explains, makes the result partial. The
// residual alone shows reversed orders only if the map has no edges. Returns whether there is such
// a reason.
bool CheckAgreement(const PreparedProblem& prepared, const EstimateOptions& options,
                    const DepthOrigin& depth, RunScope* run, LightFieldEstimate* estimate) {
  if (!std::holds_alternative<SceneSolver>(options.solver)) return false;
  EstimateDiagnostics& found = estimate->diagnostics;
  FindContradiction(prepared, IsInDoubt(found, kDoubtful), run, estimate);
  std::string reason =
      found.contradiction ? ContradictionText(depth, *found.contradiction, *run) : "";
  if (reason.empty()) reason = ValuesReason(depth.name, depth.meaning, found, *run);
  const bool has_edges = found.contradiction && found.contradiction->trials.front().edges;
  if (reason.empty() && !has_edges) CheckFlips(prepared, options, run, estimate);
  const bool is_reversed = found.depth_flips && found.depth_flips->better;
  if (is_reversed) reason = ReversedText(depth, *estimate, *run);
  if (reason.empty() && IsInDoubt(found, kUnexplainedResidual))
    reason = UnexplainedText(depth, found, *run);
  if (reason.empty()) return false;
  std::string& partial = estimate->summary.partial_reason;
  partial += (partial.empty() ? "" : "; ") + reason;
  return true;
}

// Returns what a user should know of the photograph's aperture; empty: nothing beyond the summary.
std::string PhotoWarning(const EstimateDiagnostics& found, const RunScope& run) {
  using Verdict = estimator::PhotoAperture::Verdict;
  if (!found.photo_aperture) return "";
  const estimator::PhotoAperture& photo = *found.photo_aperture;
  const std::string stated = run.Option("solver.photo");
  switch (photo.verdict) {
    case Verdict::kSharp:
      return fmt::format("{}; it is taken as the centre view ({})", photo.message, stated);
    case Verdict::kPartial:
      return fmt::format("{}; it is estimated with that share of the aperture ({})", photo.message,
                         stated);
    case Verdict::kContradicted:
      return fmt::format("{}; it is taken as captured through the whole aperture ({})",
                         photo.message, stated);
    case Verdict::kUndecided:
      if (!photo.is_narrower()) return "";
      return fmt::format("{}; it is taken as captured through the whole aperture ({})",
                         photo.message, stated);
    default:
      return "";
  }
}

// Returns the warnings about the result, one line each, with their numbers. `is_disagreement`: the
// reason of a partial result already states the residual.
std::vector<std::string> WarningsOf(const DepthOrigin& depth, bool has_camera, bool is_disagreement,
                                    const RunScope& run, const LightFieldEstimate& estimate) {
  const EstimateDiagnostics& found = estimate.diagnostics;
  const EstimateSummary& summary = estimate.summary;
  std::vector<std::string> warnings;
  constexpr double kMaxHoles = 0.5;
  if (found.holes_share > kMaxHoles) {
    warnings.push_back(fmt::format(
        "{}: {} of its {} values are not depths: these areas are guessed from the others",
        depth.name, found.holes_filled, estimate.problem->disparity().size()));
  }
  if (found.coarse_share > 0) {
    warnings.push_back(fmt::format(
        "{:.1f} % of the pixels move by more than {:g} px from view to view (up to {:.1f} px): "
        "between such views the blur is sampled too coarsely{}",
        100 * found.coarse_share, estimator::kLargestStepPx, found.largest_step_px,
        has_camera ? fmt::format("; more {} make the steps smaller", run.Option("views")) : ""));
  }
  const std::optional<double> noise_px =
      found.depth_noise_left_px ? found.depth_noise_left_px : found.depth_noise_px;
  if (noise_px && *noise_px > estimator::kLargestDepthNoisePx) {
    warnings.push_back(fmt::format(
        "{}: the depth has a noise of about {:.2f} px of disparity per view step{}; above {:g} px "
        "it costs more than the estimate gains; {}",
        depth.name, *noise_px, found.depth_noise_left_px ? " after smoothing" : "",
        estimator::kLargestDepthNoisePx,
        found.depth_noise_left_px
            ? "better depth is needed"
            : fmt::format("{} decides whether it is smoothed", run.Option("smooth_depth"))));
  }
  if (!summary.partial_reason.empty()) warnings.push_back(summary.partial_reason);
  const double noise_levels = kEightBitLevels * found.DoubtSigma().value_or(0);
  const double noise_of_mean_levels = kEightBitLevels * found.DoubtSigmaOfMean().value_or(0);
  const std::string noise = NoiseText(found);
  // Its measure does not know of every cause. The first warning names them.
  std::string jpeg_cause = is_disagreement ? "" : JpegCauseText(found);
  if (!found.patches.empty()) {
    const UnexplainedPatch& worst = found.patches.front();
    warnings.push_back(fmt::format(
        "{} patch(es) of the photograph are not explained, the worst at x {} .. {}, y {} .. {} px "
        "with a residual of {:.1f} grey levels ({}: {:.1f}): the depth is probably wrong there{}",
        found.patches.size(), worst.x, worst.x + worst.width_px - 1, worst.y,
        worst.y + worst.height_px - 1, kEightBitLevels * worst.residual_rms, noise,
        noise_of_mean_levels, std::exchange(jpeg_cause, "")));
  }
  // One reason is enough, and the others would be false.
  const bool is_reversed = (found.depth_flips && found.depth_flips->better) ||
                           (found.contradiction && found.contradiction->is_contradicted);
  if (found.unexplained_share && *found.unexplained_share > estimator::kMaxUnexplained &&
      !is_disagreement) {
    warnings.push_back(fmt::format(
        "{:.0f} % of the photograph is not explained beyond its {} of {:.1f} grey levels: most "
        "likely it is sharper than depth and aperture predict; {}{}",
        100 * *found.unexplained_share, noise, noise_of_mean_levels,
        depth.meaning.kind == DepthKind::kDisparity
            ? fmt::format("are {} and {} right?", run.Option("depth.meaning.disparity_scale"),
                          run.Option("depth.meaning.disparity_offset_px"))
            : "are the depth's unit, and the camera's aperture and focus, right?",
        std::exchange(jpeg_cause, "")));
  }
  if (IsInDoubt(found, kDoubtful) && !found.unexplained_share && !is_disagreement) {
    warnings.push_back(fmt::format(
        "the photograph has a residual of {:.1f} grey levels ({}: {:.1f}), and nearly "
        "everywhere it receives light from points that the centre view does not show: check the "
        "depth, its unit and the aperture, which may also be too wide for an image of {} x {} px{}",
        kEightBitLevels * *found.residual_rms, noise, noise_levels, summary.width_px,
        summary.height_px, std::exchange(jpeg_cause, "")));
  }
  const bool is_reported = is_disagreement || !found.patches.empty() || !found.unexplained_share ||
                           *found.unexplained_share > estimator::kMaxUnexplained;
  if (IsInDoubt(found, kUnexplainedAnyway) && !is_reported) {
    warnings.push_back(fmt::format(
        "the photograph has a residual of {:.1f} grey levels, {:.1f} times its {}, in parts of "
        "it, most often along edges of the depth; edges of the map that lie some px off, another "
        "alignment or meaning of its values, and compression or sharpening of the photograph have "
        "this effect",
        kEightBitLevels * *found.residual_rms, *found.residual_rms / *found.DoubtSigma(), noise));
  }
  const std::string photo = PhotoWarning(found, run);
  if (!photo.empty() && !is_reversed) warnings.push_back(photo);
  if (found.blur_check) {
    const std::string blur =
        BlurWarning(*found.blur_check, found.blur_proposal, estimate.problem->input(), run);
    if (!blur.empty()) warnings.push_back(blur + jpeg_cause);
  }
  return warnings;
}

// Keeps what a solver found that made no views. Returns the shares of the rays of its views.
estimator::ConfidenceShares KeepScene(const PreparedProblem& prepared, int threads, Solved* solved,
                                      LightFieldEstimate* estimate) {
  SceneForm& scene = estimate->scene.emplace();
  scene.frame = model::DescriptionOf(estimate->light_field);
  scene.radiance = std::exchange(solved->maps->radiance, {});
  scene.disparity = prepared.input->disparity;
  scene.confidence = std::exchange(solved->maps->of_points, {});
  return estimator::RaySharesOf(scene, threads);
}

// Hands on the views and the confidence that the solver did not.
void GiveRemaining(const PreparedProblem& prepared, int threads, CountingSink* sink, Solved* solved,
                   LightFieldEstimate* estimate) {
  LightField& light_field = estimate->light_field;
  const auto give_view = [&](int k, int l) {
    if (light_field.IsPresent(k, l)) sink->TakeView(k, l, model::ViewImage(light_field, k, l));
  };
  if (sink != nullptr && !solved->maps) {  // never the confidence of all rays at once
    FindConfidence(*prepared.input, threads,
                   [&](int k, int l, const std::vector<estimator::Confidence>& confidence) {
                     give_view(k, l);
                     sink->TakeConfidence(k, l, confidence, light_field.s_count);
                   });
    light_field.values = {};
    return;
  }
  const std::size_t view_size = light_field.view_size();
  const auto index = [&](int k, int l) {
    return static_cast<std::ptrdiff_t>(static_cast<std::size_t>(l * light_field.u_count + k) *
                                       view_size);
  };
  if (solved->maps && !solved->views_in_sink) {
    estimate->confidence = std::move(solved->maps->confidence);
  } else if (!solved->maps) {
    estimate->confidence.resize(view_size * static_cast<std::size_t>(light_field.u_count) *
                                static_cast<std::size_t>(light_field.v_count));
    FindConfidence(*prepared.input, threads,
                   [&](int k, int l, const std::vector<estimator::Confidence>& confidence) {
                     std::copy(confidence.begin(), confidence.end(),
                               estimate->confidence.begin() + index(k, l));
                   });
  }
  if (sink == nullptr || solved->views_in_sink) return;
  ParallelFor(light_field.u_count * light_field.v_count, threads, [&](int i) {
    const int k = i % light_field.u_count, l = i / light_field.u_count;
    give_view(k, l);
    const auto first = estimate->confidence.begin() + index(k, l);
    sink->TakeConfidence(k, l, {first, first + static_cast<std::ptrdiff_t>(view_size)},
                         light_field.s_count);
  });
  light_field.values = {};
  estimate->confidence = {};
}

// Hands on what the solver did not, and returns the shares of the rays.
estimator::ConfidenceShares GiveRays(const PreparedProblem& prepared, int threads,
                                     CountingSink* sink, Solved* solved,
                                     LightFieldEstimate* estimate) {
  const auto start = Clock::now();
  GiveRemaining(prepared, threads, sink, solved, estimate);
  if (sink != nullptr) {
    if (!solved->views_in_sink) estimate->summary.seconds.sink = SecondsSince(start);
    return estimator::SharesOf(sink->counts());
  }
  CountingSink own(nullptr);
  own.Count(estimate->confidence.begin(), estimate->confidence.end());
  return estimator::SharesOf(own.counts());
}

void FillSummary(const SolverSummary& solver, const AnySolver& chosen, const RunScope& run,
                 LightFieldEstimate* estimate) {
  const LightField& light_field = estimate->light_field;
  EstimateSummary& summary = estimate->summary;
  summary.message = solver.message;
  summary.solver = SolverName(chosen);
  summary.prior = light_field.origin.prior;
  summary.u_count = light_field.u_count;
  summary.v_count = light_field.v_count;
  summary.width_px = light_field.s_count;
  summary.height_px = light_field.t_count;
  summary.channels = light_field.channels;
  summary.iterations = solver.iterations;
  summary.converged = solver.converged;
  summary.relative_residual = solver.relative_residual;
  summary.rcond_min = solver.rcond_min;
  summary.device = solver.device;
  summary.threads = ResolveThreads(run.threads());
  if (summary.iterations && !summary.converged) {
    summary.partial_reason = fmt::format(
        "not converged: the relative residual is {:.1e} after {} iterations; allow more ({}), or a "
        "larger residual ({})",
        summary.relative_residual.value_or(0), *summary.iterations,
        run.Option("solver.max_iterations"), run.Option("solver.tolerance"));
  }
  summary.seconds.setup = solver.setup_seconds;
  summary.seconds.solve = solver.solve_seconds;
  summary.seconds.views += solver.views_seconds;
}

LightFieldEstimate Estimate(ViewSink* given_sink, Image photo, DepthMap depth,
                            const std::optional<Camera>& camera, const EstimateOptions& given,
                            const RunControl& control) {
  const auto start = Clock::now();
  RequireValidEstimate(depth, camera, given, control);
  RunScope run(control);
  LightFieldEstimate estimate;
  DepthOrigin depth_file{depth.source.empty() ? "depth" : depth.source, depth.meaning, depth.flip};
  PreparedProblem prepared =
      Prepare(std::move(photo), std::move(depth), camera, given, &estimate.diagnostics, &run);
  depth_file.meaning = prepared.depth_meaning;
  ThrowIfCancelled();
  EstimateOptions options = given;
  if (const auto* chooser = std::get_if<SolverChooser>(&given.solver)) {
    Problem problem(prepared.input);
    problem.set_falloff(prepared.effects.on.Has(Effect::kFalloff));
    const SolverChoice choice = (*chooser)(problem, SecondsSince(start));
    std::visit([&](const auto& solver) { options.solver = solver; }, choice.solver);
    options.device = choice.device;
    checks::RequireValid(options);
  }
  estimate.summary.seconds.prepare = SecondsSince(start);
  std::optional<CountingSink> sink;
  if (given_sink != nullptr) sink.emplace(given_sink);
  Solved solved = Solve(prepared, options, sink ? &*sink : nullptr, &estimate.diagnostics, &run);
  estimate.light_field = std::move(solved.light_field);
  estimate.blocks = std::move(solved.blocks);
  if (options.hidden_rays == HiddenRays::kTelea) Inpaint(*prepared.input, &run, &estimate);
  FillSummary(solved.summary, options.solver, run, &estimate);
  model::LightFieldOrigin& origin = estimate.light_field.origin;
  estimate.light_field.colour_profile = std::move(prepared.colour_profile);
  EstimateSeconds& seconds = estimate.summary.seconds;
  if (sink && solved.views_in_sink) {
    seconds.sink = sink->seconds() / ResolveThreads(control.threads);
    seconds.views = std::max(0.0, seconds.views - seconds.sink);
  }
  if (estimate.diagnostics.photo_aperture)
    seconds.photo_aperture = estimate.diagnostics.photo_aperture->seconds;
  if (solved.blur) {
    seconds.blur_check = solved.blur->seconds;
    estimate.diagnostics.blur_proposal =
        ProposalOf(*solved.blur, *prepared.input, depth_file.meaning);
    estimate.diagnostics.blur_check = std::move(solved.blur);
  }
  origin.seconds =
      seconds.prepare + seconds.photo_aperture + seconds.setup + seconds.solve + seconds.views;
  origin.effects = prepared.effects.on.Names();
  origin.version = LibraryVersion();
  origin.date = NowIso8601();
  estimate.summary.effects = origin.effects;
  CheckResult(prepared, solved, &estimate);
  const bool is_disagreement = CheckAgreement(prepared, options, depth_file, &run, &estimate);
  if (options.strict && !estimate.summary.partial_reason.empty())
    throw Error(estimate.summary.partial_reason);
  ThrowIfCancelled();
  const estimator::ConfidenceShares shares =
      solved.is_scene
          ? KeepScene(prepared, control.threads, &solved, &estimate)
          : GiveRays(prepared, control.threads, sink ? &*sink : nullptr, &solved, &estimate);
  estimate.diagnostics.rays_visible = shares.visible;
  estimate.diagnostics.rays_partly_visible = shares.partly_visible;
  estimate.diagnostics.rays_blurred = shares.blurred;
  estimate.diagnostics.rays_filled_in = shares.filled_in;
  estimate.problem.emplace(prepared.input);
  estimate.problem->set_falloff(prepared.effects.on.Has(Effect::kFalloff));
  estimate.was_hole = std::move(prepared.was_hole);
  estimate.maps = std::move(solved.maps);
  estimate.summary.warnings =
      WarningsOf(depth_file, prepared.input->camera.has_value(), is_disagreement, run, estimate);
  for (const std::string& warning : estimate.summary.warnings) run.Warn(warning);
  estimate.diagnostics.notices = run.notices();
  return estimate;
}

}  // namespace

// Rounding is part of the noise that is found, unless it hides it; compression is not.
std::optional<double> EstimateDiagnostics::DoubtSigma() const {
  if (!noise_sigma) return std::nullopt;
  return std::hypot(std::max(*noise_sigma, rounding_sigma), compression_sigma.value_or(0));
}

std::optional<double> EstimateDiagnostics::DoubtSigmaOfMean() const {
  if (!noise_sigma) return std::nullopt;
  return std::hypot(std::max(*noise_sigma, rounding_sigma), compression_sigma_of_mean.value_or(0));
}

ViewSink::~ViewSink() = default;
double ViewSink::BytesForView(double /*values*/) const { return 0; }

LightFieldEstimate EstimateLightField(Image photo, DepthMap depth,
                                      const std::optional<Camera>& camera,
                                      const EstimateOptions& options, const RunControl& run) {
  return Estimate(nullptr, std::move(photo), std::move(depth), camera, options, run);
}

LightFieldEstimate EstimateLightFieldTo(ViewSink* sink, Image photo, DepthMap depth,
                                        const std::optional<Camera>& camera,
                                        const EstimateOptions& options, const RunControl& run) {
  if (sink == nullptr) throw Error("sink: a sink is expected, found null");
  return Estimate(sink, std::move(photo), std::move(depth), camera, options, run);
}

Problem PrepareProblem(Image photo, DepthMap depth, const std::optional<Camera>& camera,
                       const EstimateOptions& options, EstimateDiagnostics* diagnostics,
                       const RunControl& run) {
  RequireValidEstimate(depth, camera, options, run);
  RunScope scope(run);
  EstimateDiagnostics found;
  const PreparedProblem prepared =
      Prepare(std::move(photo), std::move(depth), camera, options, &found, &scope);
  found.notices = scope.notices();
  if (diagnostics != nullptr) *diagnostics = std::move(found);
  Problem problem(prepared.input);
  problem.set_falloff(prepared.effects.on.Has(Effect::kFalloff));
  return problem;
}

std::string EstimateSummary::BriefReport() const {
  if (u_count == 0) return "light field: " + message;
  std::string text = fmt::format("light field: {} x {} views of {} x {} px by {}", u_count, v_count,
                                 width_px, height_px, solver);
  if (!prior.empty()) text += fmt::format(" ({})", prior);
  text += fmt::format(" in {:.2f} s", seconds.total());
  if (iterations) text += fmt::format(", {} iterations", *iterations);
  if (relative_residual) text += fmt::format(", relative residual {:.1e}", *relative_residual);
  if (iterations && !converged) text += ", not converged";
  if (!warnings.empty()) text += fmt::format("; {} warning(s)", warnings.size());
  return text;
}

}  // namespace thicklens

#include "thicklens/estimator/blur_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "estimator/scene/blur_image.h"
#include "estimator/scene/blur_trials.h"
#include "estimator/scene/scene_radiance.h"
#include "estimator/views/input_checks.h"
#include "estimator/views/option_checks.h"
#include "thicklens/base/iteration_progress.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/run_cost.h"
#include "thicklens/estimator/scene_solver.h"

namespace thicklens::estimator {
namespace {

// Minimum share of unexplained blocks; fewer are more probably a fault of the depth.
constexpr double kMinShare = 0.04;
constexpr int kMinBlocks = 4;
// Maximum share of the unexplained misfit that a proposed blur may leave, and the maximum for the
// other of the two proposals.
constexpr double kMaxLeft = 0.25;
double MostLeftBeside(double left) { return std::max(kMaxLeft, 2 * left); }
// Maximum share left by a blur that does about as well as one that leaves `left`.
double AboutAsMuch(double left) { return 1.1 * left + 0.03; }
constexpr double kAboutTheScore = 1.3;

constexpr int kMaxNarrower = 8;  // steps of 2^(-1/4): to a quarter
// A step of the offset changes the standard deviation of the blur by this; the maximum number of
// steps is that on either side.
constexpr double kOffsetSigmaPx = 0.3;
constexpr int kMaxOffsets = 4;
constexpr int kMaxTrials = 1 + kMaxNarrower + 2 * kMaxOffsets;

// Returns the standard deviation of the positions of the views, in view steps, on the wider axis.
double SpreadOf(const Eigen::ArrayXXd& weights) {
  const auto of_axis = [](const Eigen::ArrayXd& axis) {
    const Eigen::ArrayXd places =
        Eigen::ArrayXd::LinSpaced(axis.size(), -static_cast<double>(axis.size() - 1) / 2,
                                  static_cast<double>(axis.size() - 1) / 2);
    return std::sqrt((axis * places.square()).sum());
  };
  return std::max(of_axis(weights.colwise().sum().transpose()), of_axis(weights.rowwise().sum()));
}

// Tries blurs ever farther from the given one until they improve no more. If `must_be_there` is
// set, it does not stop before a sufficient blur was found.
template <typename Next>
void TryOn(int most, bool must_be_there, const Next& next, BlurTrials* trials, BlurCheck* check,
           IterationProgress* progress) {
  constexpr int kPatience = 2;
  double best = 1, best_score = 1;
  int worse = 0;
  for (int i = 1; i <= most && worse < kPatience; ++i) {
    const auto [scale, offset_px] = next(i);
    check->trials.push_back(trials->Try(scale, offset_px));
    progress->Count();
    const double left = check->trials.back().unexplained;
    const double score = check->trials.back().score;
    // Where all is explained, only the score distinguishes the trials.
    const bool better = left < best || (left == best && score < best_score);
    const bool waits = must_be_there && !(std::min(best, left) < kMaxLeft);
    worse = better || waits ? 0 : worse + 1;
    best = std::min(best, left);
    best_score = std::min(best_score, score);
  }
}

// Returns the first of the trials from `first` on that does about as well as the best of them, in
// the share that it explains and then in its score.
std::optional<BlurTrial> BestOf(const std::vector<BlurTrial>& trials, std::size_t first) {
  double left = 1, score = 0;
  for (std::size_t i = first; i < trials.size(); ++i) left = std::min(left, trials[i].unexplained);
  if (!(left < 1)) return std::nullopt;
  const auto explains = [left](const BlurTrial& trial) {
    return trial.unexplained <= AboutAsMuch(left) && std::isfinite(trial.score);
  };
  for (std::size_t i = first; i < trials.size(); ++i) {
    if (explains(trials[i]) && (score == 0 || trials[i].score < score)) score = trials[i].score;
  }
  const auto widest =
      std::find_if(trials.begin() + static_cast<std::ptrdiff_t>(first), trials.end(),
                   [&](const BlurTrial& trial) {
                     return explains(trial) && trial.score <= kAboutTheScore * score;
                   });
  return widest == trials.end() ? std::nullopt : std::optional(*widest);
}

// Keeps those of the two best trials that explain enough.
void KeepProposals(BlurCheck* check) {
  const auto left = [](const std::optional<BlurTrial>& best) {
    return best ? best->unexplained : 1;
  };
  const double least = std::min(left(check->narrower_blur), left(check->other_focus));
  for (std::optional<BlurTrial>* best : {&check->narrower_blur, &check->other_focus}) {
    if (!(least < kMaxLeft) || !(left(*best) < MostLeftBeside(least))) best->reset();
  }
}

// `spread`: of the views, in view steps.
void Search(double spread, BlurTrials* trials, BlurCheck* check, IterationProgress* progress) {
  TryOn(
      kMaxNarrower, true, [](int i) { return std::pair(std::exp2(-0.25 * i), 0.0); }, trials, check,
      progress);
  check->narrower_blur = BestOf(check->trials, 1);
  check->narrower_blur_at_end =
      check->narrower_blur && check->narrower_blur->blur_scale <= std::exp2(-0.25 * kMaxNarrower);
  for (const double step_px : {-kOffsetSigmaPx / spread, kOffsetSigmaPx / spread}) {
    const std::size_t first = check->trials.size();
    TryOn(
        kMaxOffsets, false, [step_px](int i) { return std::pair(1.0, i * step_px); }, trials, check,
        progress);
    const std::optional<BlurTrial> focus = BestOf(check->trials, first);
    if (focus && (!check->other_focus || focus->unexplained < check->other_focus->unexplained)) {
      check->other_focus = focus;
      check->other_focus_at_end =
          std::abs(focus->focus_offset_px) >= (kMaxOffsets - 0.5) * std::abs(step_px);
    }
  }
  KeepProposals(check);
}

// Converts px of the checked image to px of the photograph.
void ToPhotographPx(BlurCheck* check) {
  const double px = std::exp2(check->halvings);
  for (BlurTrial& trial : check->trials) trial.focus_offset_px *= px;
  if (check->other_focus) check->other_focus->focus_offset_px *= px;
}

std::string MessageOf(const BlurCheck& check) {
  if (check.blocks == 0) {
    return "no block provides information about its blur: all blocks are in focus or contain depth "
           "edges";
  }
  const std::string blocks =
      fmt::format("noise does not explain {} of {} blocks", check.unexplained_blocks, check.blocks);
  if (check.trials.size() <= 1) {
    return fmt::format(
        "{}: the photograph does not indicate a narrower blur; a blur that is already too narrow "
        "cannot be detected",
        blocks);
  }
  if (!check.narrower_blur && !check.other_focus) {
    return fmt::format("{}, and neither a narrower blur nor another focus explains them", blocks);
  }
  return blocks;
}

}  // namespace

bool BlurCheckOptions::IsValid(std::string* why) const {
  return IsAtLeast(0, "threads", threads, why) &&
         IsNonNegative("compression_sigma", compression_sigma, why) &&
         IsPositive("memory_limit_mib", memory_limit_mib, why);
}

BlurCheck CheckBlur(const EstimateInput& input, const BlurCheckOptions& options) {
  CheckOptions("blur check", options);
  CheckInput(input);
  const auto start = Clock::now();
  const double spread = SpreadOf(input.weights);
  BlurCheck check;
  if (!(spread > 0)) {
    check.message = "a light field of one view has no blur to check";
    return check;
  }
  const int threads = ResolveThreads(options.threads);
  IterationProgress progress(options.progress, kMaxTrials);
  progress.Report();
  BlurImage looked = BlurImageOf(input, options.falloff, threads);
  check.halvings = looked.halvings;
  const std::optional<double> noise =
      EncodedNoiseSigma(looked.image, input.transfer, looked.clipped);
  // The mean of four pixels has half of an error that is white.
  check.noise_sigma = std::hypot(std::max(noise.value_or(kDefaultNoise), kMinNoise),
                                 std::ldexp(options.compression_sigma, -looked.halvings));
  if (!noise) {
    check.message = "no part of the photograph shows its noise: the blur cannot be checked";
    check.seconds = SecondsSince(start);
    return check;
  }
  ProjectionOptions projection;
  projection.threads = threads;
  projection.progress = [&progress] { progress.Report(); };
  projection.freed = [&options] { ReturnFreedMemory(options.memory_limit_mib); };
  auto given = std::make_optional(
      ProjectionWithin(input.weights, options.memory_limit_mib, projection, &looked));
  check.width_px = looked.image.width_px;
  check.height_px = looked.image.height_px;
  BlurTrials trials({std::move(looked.image), std::move(looked.disparity), input.weights,
                     input.transfer, check.noise_sigma, std::move(looked.clipped)},
                    *given, projection);
  given.reset();
  progress.Count();
  check.blocks = trials.blocks();
  check.unexplained_blocks = trials.unexplained_blocks();
  check.trials.push_back(trials.given());
  if (check.unexplained_blocks >= std::max<double>(kMinBlocks, kMinShare * check.blocks)) {
    Search(spread, &trials, &check, &progress);
  }
  ToPhotographPx(&check);
  progress.SkipTo(kMaxTrials);
  check.iterations = trials.iterations();
  check.message = MessageOf(check);
  check.seconds = SecondsSince(start);
  return check;
}

}  // namespace thicklens::estimator

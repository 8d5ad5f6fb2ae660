#include "estimator/scene/blur_trials.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "estimator/scene/encoding_slope.h"
#include "estimator/scene/scene_data.h"
#include "estimator/scene/scene_priors.h"
#include "estimator/scene/scene_strength.h"
#include "estimator/scene/scene_system.h"

namespace thicklens::estimator {
namespace {

constexpr int kBlockPx = 32;
// A block counts if it has at least this share of its pixels and its trace is not too large: with a
// larger trace the prior replaces so much of the data that the score depends on the trace alone.
constexpr double kMinPixels = kBlockPx * kBlockPx / 4;
constexpr double kMaxTrace = 0.5;
// Maximum misfit of a block that noise explains, in variances. For the right blur it is less than
// 1, and the mean square of 768 or more numbers is uncertain by 5 %.
constexpr double kMaxOfNoise = 1.2;
constexpr float kMaxOccluded = 0.01F;
constexpr double kSlopeSmoothingPx = 2;
// Tolerance of the iterations: the misfit that it leaves is far below the noise.
constexpr double kTolerance = 3e-4;
constexpr int kMaxIterations = 200;

int BlocksAlong(int size_px) { return (size_px + kBlockPx - 1) / kBlockPx; }

template <typename Block>
bool Counts(const Block& block) {
  return block.pixels >= kMinPixels && block.trace <= kMaxTrace;
}

template <typename Block>
bool IsUnexplained(const Block& block) {
  return block.misfit > kMaxOfNoise;
}

}  // namespace

BlurTrials::BlurTrials(Photograph photograph, const SceneProjection<float>& given,
                       ProjectionOptions options)
    : photograph_(std::move(photograph)), options_(std::move(options)) {
  for (const double slope :
       EncodingSlopes(photograph_.image, photograph_.transfer, kSlopeSmoothingPx)) {
    slope_squared_.push_back(static_cast<float>(slope * slope));
  }
  weight_ = DataWeights(slope_squared_, given.occluded_fraction, true);
  for (const float occluded : given.occluded_fraction)
    is_visible_.push_back(occluded <= kMaxOccluded ? 1 : 0);
  radiance_ = Planar<float>(photograph_.image);
  given_ = Solve(given, photograph_.disparity);
  for (const Block& block : given_) {
    if (!Counts(block)) continue;
    ++blocks_;
    if (IsUnexplained(block)) ++unexplained_blocks_;
  }
}

std::size_t BlurTrials::BlockOf(std::size_t pixel) const {
  const auto width = static_cast<std::size_t>(photograph_.image.width_px);
  return pixel / width / kBlockPx *
             static_cast<std::size_t>(BlocksAlong(photograph_.image.width_px)) +
         pixel % width / kBlockPx;
}

std::vector<BlurTrials::Block> BlurTrials::Solve(const SceneProjection<float>& projection,
                                                 const DisparityMap& disparity) {
  DataTerm<float> data = DataTermOf(projection, photograph_.image, options_.threads);
  data.bounds =
      BoundsInPlanes(photograph_.clipped, data.width_px, data.channels, 0, data.height_px);
  data.weight = weight_;
  data.row_norm2 = SquaredRows<float>(disparity, photograph_.weights);
  if (strength_ == 0) {
    strength_ =
        StrengthForNoise(Prior::kTotalVariation, photograph_.noise_sigma, data, slope_squared_);
  }
  SceneSystem<float> system(data);
  RadianceLimits limits{kTolerance, kMaxIterations, options_.progress};
  iterations_ += SolveRadiance(Prior::kTotalVariation, strength_, data, slope_squared_, limits,
                               &system, &radiance_)
                     .iterations;
  const std::vector<float> trace = ProbedTrace(data, limits, &system, &iterations_);
  std::vector<float> shown(radiance_.size());
  projection.Apply(radiance_.data(), data.channels, shown.data());
  for (const std::size_t i : data.bounds) shown[i] = std::min(shown[i], data.photograph[i]);

  std::vector<Block> blocks(static_cast<std::size_t>(BlocksAlong(data.width_px)) *
                            static_cast<std::size_t>(BlocksAlong(data.height_px)));
  const double variance = photograph_.noise_sigma * photograph_.noise_sigma * data.channels;
  for (std::size_t i = 0; i < data.pixels(); ++i) {
    if (is_visible_[i] == 0) continue;
    double squares = 0;
    for (std::size_t at = i; at < shown.size(); at += data.pixels()) {
      const double difference = static_cast<double>(shown[at] - data.photograph[at]);
      squares += difference * difference;
    }
    Block& block = blocks[BlockOf(i)];
    block.pixels += 1;
    block.misfit += static_cast<double>(weight_[i]) * squares / variance;
    block.trace += static_cast<double>(trace[i]);
  }
  for (Block& block : blocks) {
    const double pixels = std::max(1.0, block.pixels);
    block.misfit /= pixels;
    block.trace /= pixels;
  }
  return blocks;
}

BlurTrial BlurTrials::given() const {
  double pixels = 0;
  for (const Block& block : given_) pixels += Counts(block) ? block.pixels : 0;
  BlurTrial trial;
  trial.compared_share = pixels / static_cast<double>(is_visible_.size());
  return trial;
}

BlurTrial BlurTrials::Try(double blur_scale, double focus_offset_px) {
  DisparityMap disparity = photograph_.disparity;
  const bool along_u = std::abs(disparity.step.x()) >= std::abs(disparity.step.y());
  const double offset = focus_offset_px / (along_u ? disparity.step.x() : disparity.step.y());
  for (float& value : disparity.disparity) {
    value = static_cast<float>(blur_scale * static_cast<double>(value) + offset);
  }
  const std::vector<Block> tried =
      Solve(MakeSceneProjection<float>(disparity, photograph_.weights, options_), disparity);
  if (options_.freed) options_.freed();

  BlurTrial trial{blur_scale, focus_offset_px};
  double given_score = 0, score = 0, given_above = 0, above = 0, compared = 0;
  for (std::size_t i = 0; i < tried.size(); ++i) {
    const Block& before = given_[i];
    const Block& now = tried[i];
    if (!Counts(before)) continue;
    const bool counts = Counts(now);
    const double was = ValidationScore(before.misfit, before.trace);
    const double is = counts ? ValidationScore(now.misfit, now.trace) : was;
    given_score += before.pixels * was;
    score += before.pixels * is;
    if (counts) compared += before.pixels;
    if (IsUnexplained(before)) {
      given_above += before.pixels * (was - kMaxOfNoise);
      above += before.pixels * std::max(0.0, is - kMaxOfNoise);
    }
  }
  trial.compared_share = compared / static_cast<double>(is_visible_.size());
  if (given_score > 0) trial.score = score / given_score;
  if (given_above > 0) trial.unexplained = above / given_above;
  return trial;
}

}  // namespace thicklens::estimator

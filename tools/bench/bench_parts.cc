#include "tools/bench/bench_parts.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

#include "thicklens/estimator/render.h"
#include "thicklens/model/stored_values.h"

namespace thicklens::tools {
namespace {

int BlocksOf(const model::LinearPicture& picture) {
  const auto blocks = [](int px) { return (px + kSourceBlockPx - 1) / kSourceBlockPx; };
  return blocks(picture.width_px) * blocks(picture.height_px);
}

}  // namespace

void CutParts(bool full, PartCount count, SampledPicture* picture) {
  constexpr int kPartPx = 4 * kSourceBlockPx;
  const int width_px = picture->whole.input.picture.width_px;
  const int height_px = picture->whole.input.picture.height_px;
  const bool is_small = width_px < 2 * kPartPx || height_px < 2 * kPartPx ||
                        width_px * height_px == 4 * kPartPx * kPartPx;
  if (full || is_small) {
    picture->rects = {{0, 0, width_px, height_px}};
    picture->parts = {picture->whole};
    return;
  }
  BlockSample sample{0, BlocksOf(picture->whole.input.picture)};
  constexpr std::array<std::array<int, 2>, 4> kQuarters = {{{1, 1}, {3, 3}, {3, 1}, {1, 3}}};
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
    const auto [quarter_x, quarter_y] = kQuarters[i];
    picture->rects.push_back({quarter_x * width_px / 4 - kPartPx / 2,
                              quarter_y * height_px / 4 - kPartPx / 2, kPartPx, kPartPx});
    picture->parts.push_back(PartOf(picture->whole, picture->rects.back()));
    sample.solved += BlocksOf(picture->parts.back().input.picture);
  }
  picture->sample = sample;
  picture->pixels_per_part_pixel =
      static_cast<double>(width_px) * height_px / (static_cast<double>(count) * kPartPx * kPartPx);
}

PartsRun RunParts(const SampledPicture& picture, const estimator::EstimatePlan& plan, int threads,
                  kernels::Backend* backend) {
  PartsRun run;
  for (const BenchScene& part : picture.parts) {
    PlanRun of_part = RunPlan(plan, part.input, threads, backend);
    run.estimates.push_back(std::move(of_part.light_field));
    run.setup_seconds = std::max(run.setup_seconds, of_part.setup_seconds);
    run.solve_seconds += of_part.solve_seconds * picture.pixels_per_part_pixel;
    if (of_part.iterations) {
      run.iterations = std::max(run.iterations.value_or(0), *of_part.iterations);
    }
    run.converged = run.converged && of_part.converged;
    run.relative_residual = std::max(run.relative_residual, of_part.relative_residual.value_or(0));
    if (of_part.rcond) run.rcond = std::min(run.rcond.value_or(1), *of_part.rcond);
    run.device = of_part.device;
  }
  return run;
}

void WarmUp(const SampledPicture& picture, const estimator::EstimatePlan& plan,
            kernels::Backend* backend) {
  const BenchScene block = PartOf(picture.parts.front(), {0, 0, kSourceBlockPx, kSourceBlockPx});
  RunPlan(plan, block.input, 1, backend);
}

void WarmUpWhole(const SampledPicture& picture, const WholePictureRun& run) {
  run(picture.parts.front().input);
}

std::vector<model::LightField> PartsOf(const SampledPicture& picture,
                                       const model::LightField& estimate) {
  std::vector<model::LightField> parts;
  for (const model::PixelRect& rect : picture.rects) {
    parts.push_back(model::CropViews(estimate, rect));
  }
  return parts;
}

int BorderPx(const model::LinearPicture& picture) {
  return std::min(20, std::min(picture.width_px, picture.height_px) / 4);
}

ScoredArea ScoredAreaOf(const SampledPicture& picture) {
  const model::LinearPicture& part = picture.parts.front().input.picture;
  const int border_px = BorderPx(part);
  return {static_cast<int>(picture.parts.size()), part.width_px - 2 * border_px,
          part.height_px - 2 * border_px};
}

std::string ScoredAreaText(const ScoredArea& area) {
  return fmt::format("{} area{} of {} x {} px", area.parts, area.parts == 1 ? "" : "s",
                     area.width_px, area.height_px);
}

nlohmann::json ScoredAreaJson(const ScoredArea& area) {
  return {{"parts", area.parts}, {"size_px", {area.width_px, area.height_px}}};
}

PartScores ScoresOfViews(const SampledPicture& picture,
                         const std::vector<model::LightField>& estimates, int threads) {
  PartScores scores;
  const auto count = static_cast<double>(estimates.size());
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    const BenchScene& part = picture.parts[i];
    const estimator::LightFieldScores of_part = estimator::CompareLightFields(
        part.truth, estimates[i], BorderPx(part.input.picture), std::nullopt, threads);
    scores.psnr_mean_db += of_part.mean.psnr_db / count;
    scores.psnr_centre_db += of_part.centre.psnr_db / count;
    scores.psnr_corner_db += of_part.corner.psnr_db / count;
    scores.ssim_mean += of_part.mean.ssim / count;
    scores.ssim_centre += of_part.centre.ssim / count;
    scores.ssim_corner += of_part.corner.ssim / count;
  }
  return scores;
}

FidelityScores ScoresOfPictures(const SampledPicture& picture,
                                const std::vector<model::LightField>& estimates, int threads) {
  FidelityScores scores;
  const auto count = static_cast<double>(estimates.size());
  bool has_edges = true;
  double macade = 0;
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    const estimator::EstimateInput& input = picture.parts[i].input;
    const model::LinearPicture again =
        estimator::Photograph(estimates[i], input.weights, input.camera ? &*input.camera : nullptr,
                              nullptr, nullptr, threads);
    const estimator::PictureScores of_part = estimator::ComparePictures(
        model::StoredValuesOf(input.picture, input.transfer),
        model::StoredValuesOf(again, input.transfer), BorderPx(input.picture));
    scores.psnr_db += of_part.psnr_db / count;
    scores.delta_e94_mean += of_part.delta_e94_mean / count;
    has_edges = has_edges && of_part.macade_standin.has_value();
    macade += of_part.macade_standin.value_or(0) / count;
  }
  if (has_edges) scores.macade_standin = macade;
  return scores;
}

}  // namespace thicklens::tools

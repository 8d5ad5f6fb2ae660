#include "tools/bench/bench_parts.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

#include "thicklens/estimator/render.h"
#include "thicklens/model/encoded_values.h"

namespace thicklens::tools {
namespace {

int BlocksOf(const model::LinearImage& image) {
  const auto blocks = [](int px) { return (px + kSourceBlockPx - 1) / kSourceBlockPx; };
  return blocks(image.width_px) * blocks(image.height_px);
}

}  // namespace

void CutParts(bool full, PartCount count, SampledImage* image) {
  constexpr int kPartPx = 4 * kSourceBlockPx;
  const int width_px = image->whole.input.image.width_px;
  const int height_px = image->whole.input.image.height_px;
  const bool is_small = width_px < 2 * kPartPx || height_px < 2 * kPartPx ||
                        width_px * height_px == 4 * kPartPx * kPartPx;
  if (full || is_small) {
    image->rects = {{0, 0, width_px, height_px}};
    image->parts = {image->whole};
    return;
  }
  BlockSample sample{0, BlocksOf(image->whole.input.image)};
  constexpr std::array<std::array<int, 2>, 4> kQuarters = {{{1, 1}, {3, 3}, {3, 1}, {1, 3}}};
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
    const auto [quarter_x, quarter_y] = kQuarters[i];
    image->rects.push_back({quarter_x * width_px / 4 - kPartPx / 2,
                            quarter_y * height_px / 4 - kPartPx / 2, kPartPx, kPartPx});
    image->parts.push_back(PartOf(image->whole, image->rects.back()));
    sample.solved += BlocksOf(image->parts.back().input.image);
  }
  image->sample = sample;
  image->pixels_per_part_pixel =
      static_cast<double>(width_px) * height_px / (static_cast<double>(count) * kPartPx * kPartPx);
}

PartsRun RunParts(const SampledImage& image, const estimator::EstimatePlan& plan, int threads,
                  kernels::Backend* backend) {
  PartsRun run;
  for (const BenchScene& part : image.parts) {
    PlanRun of_part = RunPlan(plan, part.input, threads, backend);
    run.estimates.push_back(std::move(of_part.light_field));
    run.setup_seconds = std::max(run.setup_seconds, of_part.setup_seconds);
    run.solve_seconds += of_part.solve_seconds * image.pixels_per_part_pixel;
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

void WarmUp(const SampledImage& image, const estimator::EstimatePlan& plan,
            kernels::Backend* backend) {
  const BenchScene block = PartOf(image.parts.front(), {0, 0, kSourceBlockPx, kSourceBlockPx});
  RunPlan(plan, block.input, 1, backend);
}

void WarmUpWhole(const SampledImage& image, const WholeImageRun& run) {
  run(image.parts.front().input);
}

std::vector<model::LightField> PartsOf(const SampledImage& image,
                                       const model::LightField& estimate) {
  std::vector<model::LightField> parts;
  for (const model::PixelRect& rect : image.rects) {
    parts.push_back(model::CropViews(estimate, rect));
  }
  return parts;
}

int BorderPx(const model::LinearImage& image) {
  return std::min(20, std::min(image.width_px, image.height_px) / 4);
}

ScoredArea ScoredAreaOf(const SampledImage& image) {
  const model::LinearImage& part = image.parts.front().input.image;
  const int border_px = BorderPx(part);
  return {static_cast<int>(image.parts.size()), part.width_px - 2 * border_px,
          part.height_px - 2 * border_px};
}

std::string ScoredAreaText(const ScoredArea& area) {
  return fmt::format("{} area{} of {} x {} px", area.parts, area.parts == 1 ? "" : "s",
                     area.width_px, area.height_px);
}

nlohmann::json ScoredAreaJson(const ScoredArea& area) {
  return {{"parts", area.parts}, {"size_px", {area.width_px, area.height_px}}};
}

PartScores ScoresOfViews(const SampledImage& image, const std::vector<model::LightField>& estimates,
                         int threads) {
  PartScores scores;
  const auto count = static_cast<double>(estimates.size());
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    const BenchScene& part = image.parts[i];
    const estimator::LightFieldScores of_part = estimator::CompareLightFields(
        part.truth, estimates[i], BorderPx(part.input.image), std::nullopt, threads);
    scores.psnr_mean_db += of_part.mean.psnr_db / count;
    scores.psnr_centre_db += of_part.centre.psnr_db / count;
    scores.psnr_corner_db += of_part.corner.psnr_db / count;
    scores.ssim_mean += of_part.mean.ssim / count;
    scores.ssim_centre += of_part.centre.ssim / count;
    scores.ssim_corner += of_part.corner.ssim / count;
  }
  return scores;
}

FidelityScores ScoresOfImages(const SampledImage& image,
                              const std::vector<model::LightField>& estimates, int threads) {
  FidelityScores scores;
  const auto count = static_cast<double>(estimates.size());
  bool has_edges = true;
  double macade = 0;
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    const estimator::EstimateInput& input = image.parts[i].input;
    const model::LinearImage again =
        estimator::Photograph(estimates[i], input.weights, input.camera ? &*input.camera : nullptr,
                              nullptr, nullptr, threads);
    const estimator::ImageScores of_part = estimator::CompareImages(
        model::EncodedValuesOf(input.image, input.transfer),
        model::EncodedValuesOf(again, input.transfer), BorderPx(input.image));
    scores.psnr_db += of_part.psnr_db / count;
    scores.delta_e94_mean += of_part.delta_e94_mean / count;
    has_edges = has_edges && of_part.macade_standin.has_value();
    macade += of_part.macade_standin.value_or(0) / count;
  }
  if (has_edges) scores.macade_standin = macade;
  return scores;
}

}  // namespace thicklens::tools

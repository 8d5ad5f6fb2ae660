#include "tools/bench/bench_inpainting.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/stopwatch.h"
#include "thicklens/estimator/compare.h"
#include "thicklens/estimator/inpaint.h"
#include "thicklens/estimator/view_geometry.h"
#include "thicklens/kernels/device.h"
#include "thicklens/model/encoded_values.h"
#include "tools/bench/bench_loop.h"
#include "tools/bench/bench_machine.h"
#include "tools/bench/bench_scene.h"
#include "tools/bench/bench_solvers.h"
#include "tools/options/bench_options.h"
#include "tools/system/progress_line.h"

namespace thicklens::tools {
namespace {

using nlohmann::json;

struct BenchInpaintingOptions {
  CommonOptions common;
  int size_px = 256;
  int views = 5;
  int repeat = 5;
  std::uint64_t seed = 1;
};

// The samples of each view that are judged, without those in the border.
struct Regions {
  std::vector<cv::Mat> occluded, band;  // masks of 0 or 255
};

constexpr int kBorderPx = 20;
constexpr int kBandPx = 4;  // around the occluded samples
constexpr int kWarmPx = 64;

Regions RegionsOf(const BenchScene& scene) {
  const estimator::DisparityMap& map = scene.input.disparity;
  const estimator::DisparityRenderer renderer(map);
  const model::LightField& truth = scene.truth;
  const cv::Rect inner(kBorderPx, kBorderPx, map.width_px - 2 * kBorderPx,
                       map.height_px - 2 * kBorderPx);
  const cv::Mat around =
      cv::getStructuringElement(cv::MORPH_ELLIPSE, cv::Size(2 * kBandPx + 1, 2 * kBandPx + 1));
  Regions regions;
  for (int l = 0; l < truth.v_count; ++l) {
    for (int k = 0; k < truth.u_count; ++k) {
      const estimator::ViewDisparity view = renderer.Render(truth.u_offset(k), truth.v_offset(l));
      cv::Mat occluded = cv::Mat::zeros(map.height_px, map.width_px, CV_8UC1);
      std::transform(view.visibility.begin(), view.visibility.end(), occluded.begin<std::uint8_t>(),
                     [](estimator::Visibility visibility) {
                       return static_cast<std::uint8_t>(
                           visibility == estimator::Visibility::kOccluded ? 255 : 0);
                     });
      cv::Mat inside = cv::Mat::zeros(occluded.size(), CV_8UC1);
      occluded(inner).copyTo(inside(inner));
      cv::Mat wide, band = cv::Mat::zeros(occluded.size(), CV_8UC1);
      cv::dilate(inside, wide, around);
      wide(inner).copyTo(band(inner));
      regions.occluded.push_back(inside);
      regions.band.push_back(band);
    }
  }
  return regions;
}

// Returns the PSNR of encoded values over the samples of all views together.
double PsnrWithin(const std::vector<cv::Mat>& region, const model::LightField& truth,
                  const model::LightField& estimate) {
  double sum = 0, count = 0;
  for (int l = 0; l < truth.v_count; ++l) {
    for (int k = 0; k < truth.u_count; ++k) {
      const auto of = [&](const model::LightField& light_field) {
        return model::EncodedValuesOf(model::ViewImage(light_field, k, l), truth.transfer).values;
      };
      const std::vector<float> a = of(truth), b = of(estimate);
      const cv::Mat& mask = region[static_cast<std::size_t>(l * truth.u_count + k)];
      std::size_t i = 0;
      for (auto judged = mask.begin<std::uint8_t>(); judged != mask.end<std::uint8_t>();
           ++judged, ++i) {
        if (*judged == 0) continue;
        sum += std::pow(static_cast<double>(a[i]) - b[i], 2);
        ++count;
      }
    }
  }
  return -10 * std::log10(sum / count);
}

struct InpaintingRow {
  std::string solver, fill;
  std::vector<double> seconds, fill_seconds;
  double psnr_db = 0, psnr_band_db = 0, psnr_occluded_db = 0;
};

void Judge(const BenchScene& scene, const Regions& regions, const model::LightField& estimate,
           int threads, InpaintingRow* row) {
  row->psnr_db =
      estimator::CompareLightFields(scene.truth, estimate, kBorderPx, std::nullopt, threads)
          .mean.psnr_db;
  row->psnr_band_db = PsnrWithin(regions.band, scene.truth, estimate);
  row->psnr_occluded_db = PsnrWithin(regions.occluded, scene.truth, estimate);
}

// Runs a solver once, and judges its result as it is and with inpainting.
void Run(const LightFieldSolver& solver, const BenchScene& scene, const Regions& regions,
         int threads, InpaintingRow* own, InpaintingRow* telea) {
  const Clock::time_point start = Clock::now();
  model::LightField estimate = solver.estimate(scene.input);
  const double seconds = SecondsSince(start);
  const bool is_first = own->seconds.empty();
  own->seconds.push_back(seconds);
  if (is_first) Judge(scene, regions, estimate, threads, own);
  estimator::InpaintOptions options;
  options.threads = threads;
  options.progress = [](int, int) { ThrowIfCancelled(); };
  estimator::InpaintSummary summary;
  estimator::InpaintOccludedRays(scene.input.disparity, options, &estimate, &summary);
  telea->seconds.push_back(seconds + summary.seconds);
  telea->fill_seconds.push_back(summary.seconds);
  if (is_first) Judge(scene, regions, estimate, threads, telea);
}

json RowJson(const InpaintingRow& row) {
  return {{"solver", row.solver},
          {"fill", row.fill},
          {"seconds", Median(row.seconds)},
          {"seconds_of_runs", row.seconds},
          {"fill_seconds", row.fill_seconds.empty() ? json() : json(Median(row.fill_seconds))},
          {"psnr_true_views_db", row.psnr_db},
          {"psnr_band_db", row.psnr_band_db},
          {"psnr_occluded_db", row.psnr_occluded_db}};
}

CommandResult BenchInpainting(const BenchInpaintingOptions& options) {
  const int threads = ResolveThreads(options.common.threads);
  BenchScene scene;
  {
    ProgressLine progress("simulating", options.common.quiet);
    scene = MakeOccludedScene(options.size_px, options.size_px, options.views, options.views,
                              options.seed, threads, [&](int done, int total) {
                                ThrowIfCancelled();
                                progress.Show(done, total);
                              });
  }
  const Regions regions = RegionsOf(scene);
  const auto backend =
      kernels::OpenBackend(kernels::ParseDeviceRequest("cpu"), nullptr, ThrowIfCancelled);
  std::vector<LightFieldSolver> solvers = {
      SolverByBlocks(estimator::DefaultBlockSolver(), threads, backend.get())};
  for (LightFieldSolver& solver : WholeImageSolvers(threads)) {
    if (solver.prior == "tv" || solver.solver == "dibr") solvers.push_back(std::move(solver));
  }
  std::vector<InpaintingRow> rows;
  for (const LightFieldSolver& solver : solvers) {
    for (const char* fill : {"solver", "telea"})
      rows.push_back({solver.solver, fill, {}, {}, 0, 0, 0});
  }
  {
    ProgressLine progress("measuring", options.common.quiet);
    // Not counted, so that no row has a cold start.
    for (const LightFieldSolver& solver : solvers) {
      solver.estimate(MiddleOf(scene, kWarmPx, kWarmPx).input);
    }
    MeasureInRounds(options.repeat, solvers.size(), &progress, [&](int, std::size_t i) {
      Run(solvers[i], scene, regions, threads, &rows[2 * i], &rows[2 * i + 1]);
    });
  }
  std::string text = fmt::format(
      "{0} x {0} px, {1} x {1} views, {2} thread(s), medians of {3}; PSNR against the true views, "
      "of hidden\nrays only and of a band of {4} px around "
      "them\n\n{5:<9}{6:<8}{7:>9}{8:>14}{9:>9}{10:>9}{11:>9}\n",
      options.size_px, options.views, threads, options.repeat, kBandPx, "solver", "fill", "seconds",
      "filling only", "views", "band", "hidden");
  json json_rows = json::array();
  for (const InpaintingRow& row : rows) {
    text += fmt::format(
        "{:<9}{:<8}{:>9.3g}{:>14}{:>9.2f}{:>9.2f}{:>9.2f}\n", row.solver, row.fill,
        Median(row.seconds),
        row.fill_seconds.empty() ? "-" : fmt::format("{:.3g}", Median(row.fill_seconds)),
        row.psnr_db, row.psnr_band_db, row.psnr_occluded_db);
    json_rows.push_back(RowJson(row));
  }
  PrintResult(options.common, text);
  return {BenchSummary({{"size", {options.size_px, options.size_px}},
                        {"views", {options.views, options.views}},
                        {"threads", threads},
                        {"rows", json_rows}}),
          ""};
}

}  // namespace

void AddBenchInpaintingCommand(CLI::App* bench, CommandAction* action) {
  CLI::App* command = bench->add_subcommand(
      "inpainting", "The paper's inpainting of occluded rays against the solvers' own filling");
  const auto options = std::make_shared<BenchInpaintingOptions>();
  AddSizeOption(command, 96, &options->size_px);
  AddSquareViewsOption(command, &options->views);
  AddRepeatOption(command, &options->repeat);
  AddSeedOption(command, &options->seed);
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] { RunCommand(options->common, [&] { return BenchInpainting(*options); }); };
  });
}

}  // namespace thicklens::tools

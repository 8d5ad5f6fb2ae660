#ifndef THICKLENS_TOOLS_BENCH_BENCH_PARTS_H_
#define THICKLENS_TOOLS_BENCH_BENCH_PARTS_H_

#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/estimator/compare.h"
#include "thicklens/model/light_field.h"
#include "tools/bench/bench_scene.h"
#include "tools/options/estimate_plan.h"

namespace thicklens::tools {

constexpr int kSourceBlockPx = 16;  // the paper's block size

// Number of solved blocks and of all blocks of the image.
struct BlockSample {
  int solved = 0, all = 0;
};

// An image, and the parts that represent it where the whole would take too long.
struct SampledImage {
  BenchScene whole;
  std::vector<model::PixelRect> rects;  // of the parts
  std::vector<BenchScene> parts;
  std::optional<BlockSample> sample;  // absent: the part is the whole image
  double pixels_per_part_pixel = 1;
};

// Quarters of the image to sample: the top left one, this one and the opposite one, or all.
enum class PartCount { kOne = 1, kTwo = 2, kFour = 4 };

// Cuts parts of four by four blocks in the middles of these quarters. If the image is hardly larger
// than four parts, or if `full` is set, the part is the whole image.
void CutParts(bool full, PartCount count, SampledImage* image);

// Estimates of the parts, made one after the other by blocks, and their extrapolation to the whole.
struct PartsRun {
  std::vector<model::LightField> estimates;
  // Times of the whole image; the set-up time is the same for any size.
  double setup_seconds = 0, solve_seconds = 0;
  double seconds() const { return setup_seconds + solve_seconds; }
  std::optional<int> iterations;  // maximum over the parts
  bool converged = true;
  double relative_residual = 0;  // maximum over the parts
  std::optional<double> rcond;   // minimum over the parts
  std::string device;
};
PartsRun RunParts(const SampledImage& image, const estimator::EstimatePlan& plan, int threads,
                  kernels::Backend* backend);
// Solves one block, so that one-time work of a device is done before times are measured.
void WarmUp(const SampledImage& image, const estimator::EstimatePlan& plan,
            kernels::Backend* backend);
// Runs a solver of the whole image on one part, so that it is as warm as the solvers of blocks.
using WholeImageRun = std::function<void(const estimator::EstimateInput&)>;
void WarmUpWhole(const SampledImage& image, const WholeImageRun& run);

// Cuts the parts out of an estimate of the whole.
std::vector<model::LightField> PartsOf(const SampledImage& image,
                                       const model::LightField& estimate);

// Returns the width of the border of such an image that scores leave out.
int BorderPx(const model::LinearImage& image);

// The area that scores are computed on: the middles of `parts` parts, without their borders.
struct ScoredArea {
  int parts = 1;
  int width_px = 0, height_px = 0;  // of each part
};
ScoredArea ScoredAreaOf(const SampledImage& image);
std::string ScoredAreaText(const ScoredArea& area);  // "4 areas of 32 x 32 px"
nlohmann::json ScoredAreaJson(const ScoredArea& area);

// Means over the parts, without their borders.
struct PartScores {
  double psnr_mean_db = 0, psnr_centre_db = 0, psnr_corner_db = 0;
  double ssim_mean = 0, ssim_centre = 0, ssim_corner = 0;
};
// Scores the estimates against the true views, which must be known.
PartScores ScoresOfViews(const SampledImage& image, const std::vector<model::LightField>& estimates,
                         int threads);

// Scores of the photographs formed again from the estimates, against the given one: means over the
// parts.
struct FidelityScores {
  double psnr_db = 0;
  std::optional<double> macade_standin;  // absent: a part has no edges
  double delta_e94_mean = 0;
};
FidelityScores ScoresOfImages(const SampledImage& image,
                              const std::vector<model::LightField>& estimates, int threads);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_BENCH_PARTS_H_

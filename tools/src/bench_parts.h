#ifndef THICKLENS_TOOLS_BENCH_PARTS_H_
#define THICKLENS_TOOLS_BENCH_PARTS_H_

#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "bench_scene.h"
#include "estimate_plan.h"
#include "thicklens/estimator/compare.h"
#include "thicklens/model/light_field.h"

namespace thicklens::tools {

constexpr int kSourceBlockPx = 16;  // the source's

// Blocks that were solved, of all that the picture has.
struct BlockSample {
  int solved = 0, all = 0;
};

// A picture, and the parts of it that stand for it where all would take too long.
struct SampledPicture {
  BenchScene whole;
  std::vector<model::PixelRect> rects;  // of the parts
  std::vector<BenchScene> parts;
  std::optional<BlockSample> sample;  // absent: the part is the whole
  double pixels_per_part_pixel = 1;
};

// Of the picture's quarters: the top left one, it and the opposite one, or all.
enum class PartCount { kOne = 1, kTwo = 2, kFour = 4 };

// Parts of four by four blocks in the middles of these quarters. Of a picture that is hardly larger
// than four parts, or if it is to be `full`, all of it.
void CutParts(bool full, PartCount count, SampledPicture* picture);

// The parts, estimated one after the other by blocks, and what that says of the whole.
struct PartsRun {
  std::vector<model::LightField> estimates;
  // Of the whole picture: set-up is that of any size.
  double setup_seconds = 0, solve_seconds = 0;
  double seconds() const { return setup_seconds + solve_seconds; }
  std::optional<int> iterations;  // the most of a part
  bool converged = true;
  double relative_residual = 0;  // the largest
  std::optional<double> rcond;   // the smallest
  std::string device;
};
PartsRun RunParts(const SampledPicture& picture, const EstimatePlan& plan, int threads,
                  kernels::Backend* backend);
// One block, so that what a device does but once is done.
void WarmUp(const SampledPicture& picture, const EstimatePlan& plan, kernels::Backend* backend);
// A part, by a solver of the whole picture: as warm as those of blocks are.
using WholePictureRun = std::function<void(const estimator::EstimateInput&)>;
void WarmUpWhole(const SampledPicture& picture, const WholePictureRun& run);

// The parts of an estimate of the whole.
std::vector<model::LightField> PartsOf(const SampledPicture& picture,
                                       const model::LightField& estimate);

// Pixels at the border of such a picture that are not judged.
int BorderPx(const model::LinearPicture& picture);

// What scores are of: the middles of so many parts, without their borders.
struct ScoredArea {
  int parts = 1;
  int width_px = 0, height_px = 0;  // of each
};
ScoredArea ScoredAreaOf(const SampledPicture& picture);
std::string ScoredAreaText(const ScoredArea& area);  // "4 areas of 32 x 32 px"
nlohmann::json ScoredAreaJson(const ScoredArea& area);

// Means over the parts, without their borders.
struct PartScores {
  double psnr_mean_db = 0, psnr_centre_db = 0, psnr_corner_db = 0;
  double ssim_mean = 0, ssim_centre = 0, ssim_corner = 0;
};
// Against the true views, which must be known.
PartScores ScoresOfViews(const SampledPicture& picture,
                         const std::vector<model::LightField>& estimates, int threads);

// Of the pictures formed again from the estimates, against the photograph: the mean over the parts.
struct FidelityScores {
  double psnr_db = 0;
  std::optional<double> macade_standin;  // absent: a part has no edges
  double delta_e94_mean = 0;
};
FidelityScores ScoresOfPictures(const SampledPicture& picture,
                                const std::vector<model::LightField>& estimates, int threads);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_PARTS_H_

#include "estimator/scene/scene_memory.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "estimator/projection/angular_bundle.h"
#include "estimator/scene/guided_shading.h"
#include "thicklens/base/run_cost.h"
#include "thicklens/estimator/view_geometry.h"
#include "thicklens/kernels/image_filter.h"

namespace thicklens::estimator {
namespace {

constexpr double kFloat = sizeof(float);

// Memory per pixel of a view in the making: its disparity and confidence, and its occluded samples
// if they are a third.
constexpr double kRenderedBytes = kFloat + 1 + 8;
// Code that is loaded when it runs first, stacks, and all objects smaller than the image.
constexpr double kSmallBytes = 8 << 20;

// Memory of a sample of a view of the bundle: its disparity, and its entry where it is hidden or
// mixed.
constexpr double kVisibleBytes = kFloat, kOccludedBytes = sizeof(CompactView::Occluded),
                 kBoundarySampleBytes = sizeof(CompactView::Boundary);

// Shares that are kept while systems are solved: the hidden share of the rays, and the share that
// sees each point.
constexpr double kSharesBytes = 2 * kFloat;

// Memory of a system. Images: the data, H^T W I, the radiance, and the vectors of CG and H. Planes:
// weights, slopes, diagonals, the prior. Patches need more planes.
constexpr double kSolveImages = 12, kSolvePlanes = 7, kMorePlanes = 6;

// Memory shared by all views in the making: the surfaces of the disparity.
constexpr double kRendererBytes = 3;

}  // namespace

SceneMemory::SceneMemory(const EstimateInput& input, const SceneOptions& options, int threads,
                         const Keeps& keeps, int reach_px)
    : before_(ResidentBytes() + kSmallBytes),
      width_px_(input.image.width_px),
      height_px_(input.image.height_px),
      channels_(input.image.channels),
      u_count_(static_cast<int>(input.weights.cols())),
      v_count_(static_cast<int>(input.weights.rows())),
      visible_views_(static_cast<int>((input.weights > 0).count())),
      threads_(threads),
      reach_px_(reach_px),
      real_(options.double_precision ? sizeof(double) : sizeof(float)),
      patches_(options.prior == Prior::kPatches),
      keeps_(keeps) {}

double SceneMemory::MostBytes(int rows, const ProjectionBytes& projection, double kept_bundle_bytes,
                              Freed freed) const {
  const double all = static_cast<double>(width_px_) * height_px_;
  double kept = all;  // the confidence of its points
  if (keeps_.photograph) kept += kFloat * all * channels_;
  if (keeps_.maps) kept += 3 * kFloat * all;
  // Bands need copies of their part of the input, and the finished rows are kept.
  const double pixels = static_cast<double>(width_px_) * rows;
  double band = kFloat * pixels;
  if (rows < height_px_) {
    kept += kFloat * all * channels_;
    band += kFloat * pixels * channels_;
  }
  return before_ + kept +
         std::max(band + projection.held +
                      std::max(SetupBytes(pixels, projection, freed),
                               kept_bundle_bytes + SolveBytes(pixels)),
                  kept_bundle_bytes + ViewsBytes());
}

double SceneMemory::RowBytes() const {
  // A ray reads two pixels of each of two rows. The pixels that the pixel's rays read in a row of
  // the image are stored in runs.
  constexpr double kRun = kernels::kPixelsOfRun;
  const double around = 2.0 * reach_px_ + 1;
  const double runs = std::min(2.0 * visible_views_, around * std::ceil(around / kRun));
  return runs * (kRun * real_ + sizeof(std::int32_t));
}

ProjectionBytes SceneMemory::LargestPerPixel() const {
  constexpr double kIndexBytes = sizeof(std::int64_t) + sizeof(std::int32_t);
  const double products = std::min(u_count_, v_count_);
  return {RowBytes() + kIndexBytes + products * 2 * real_ * (2.0 * reach_px_ + 3),
          visible_views_ * (kVisibleBytes + kOccludedBytes + kBoundarySampleBytes)};
}

ProjectionBytes SceneMemory::OfRows(int rows, const ProjectionBytes& per_pixel) const {
  const int at_borders = rows < height_px_ ? std::min(2 * reach_px_, rows) : 0;
  constexpr double kOccludedFraction =
      1.0 / 3;  // of views: half of them look away, and not all as far
  const double width = width_px_;
  return {width * (rows * per_pixel.held + at_borders * RowBytes()),
          width * (rows * per_pixel.bundle +
                   kOccludedFraction * at_borders * visible_views_ * kOccludedBytes)};
}

// Memory in addition to H: the bundle of all views; either its axes, or each thread's place where
// rows are gathered and the parts of H that are not joined yet; the sums of each thread; and the
// shares of the aperture that see each point.
double SceneMemory::SetupBytes(double pixels, const ProjectionBytes& projection,
                               Freed freed) const {
  constexpr double kShareBytes = sizeof(double) + kFloat;
  const double axes = kFloat * (u_count_ + v_count_) + 2 + 2 * kFloat + 1;
  const double rows = std::max(1.0, pixels / width_px_);
  const double parts =
      freed == Freed::kStays ? 1 : std::min(1.0, 1.0 / kPartsOfAThread + threads_ / rows);
  return projection.bundle + parts * projection.held +
         pixels * (kShareBytes + kFloat + kRendererBytes + std::max(axes, threads_ * real_));
}

// Memory in addition to H while systems are solved. A device needs the same again, and its
// programs.
double SceneMemory::SolveBytes(double pixels) const {
  if (patches_) return std::max(PatchesBytes(pixels), ShadingGuideBytes(pixels));
  return PlaneBytes(pixels, kSolveImages * channels_ + kSolvePlanes);
}

// The last system needs in addition the target, here and in the system, the shading of the relief,
// and the photograph without it. It also needs the strengths, weights in double, and the part of
// the data that belongs to that photograph.
double SceneMemory::PatchesBytes(double pixels) const {
  return PlaneBytes(pixels, (kSolveImages + 4) * channels_ + kSolvePlanes + kMorePlanes);
}

// The system of the relief's normals has them in place of colours, and as they are. It also has
// photograph and radiance, the smooth pixels, and the prior and weights, which exist twice here.
// Afterwards, without the system, the shading is fitted.
double SceneMemory::ShadingGuideBytes(double pixels) const {
  const double system = PlaneBytes(
      pixels, (kSolveImages + 1) * kNormals + 2 * channels_ + kSolvePlanes + kMorePlanes);
  const double fit =
      pixels * (real_ * (4 * channels_ + 2 * kNormals + kSolvePlanes) + kSharesBytes) +
      ShadingBytes(width_px_, static_cast<int>(pixels / width_px_), channels_, threads_, real_);
  return std::max(system, fit);
}

double SceneMemory::PlaneBytes(double pixels, double planes) const {
  constexpr double kProgramBytes = 16 << 20;
  const double here = pixels * (real_ * planes + kSharesBytes);
  return keeps_.device ? 2 * here + kProgramBytes : here;
}

double SceneMemory::ViewsBytes() const {
  const double all = static_cast<double>(width_px_) * height_px_;
  const double view = kFloat * channels_;
  constexpr double kRanges = 2 * kFloat;
  constexpr int kFour = 4;  // channels that are read together, if there are several
  const int read = channels_ == 1 ? 1 : (channels_ + kFour - 1) / kFour * kFour;
  const double all_views = kFloat * read + kRanges + kRendererBytes;
  const int at_once = std::min(threads_, u_count_ * v_count_);
  double bytes = all * (view + all_views + at_once * (view + kRenderedBytes));
  bytes += at_once * keeps_.sink_bytes;
  // A device holds the image, its disparity and ranges, and for each view in the making the values,
  // the disparity and the occluded samples if they are a third.
  if (keeps_.device) bytes += all * (view + 3 * kFloat + at_once * (view + 3 * kFloat));
  if (keeps_.light_field) {
    const double ray = view + (keeps_.maps ? 1 : 0);
    bytes += all * ray * u_count_ * v_count_;
  }
  return bytes;
}

}  // namespace thicklens::estimator

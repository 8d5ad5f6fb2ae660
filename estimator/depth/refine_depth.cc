#include "thicklens/estimator/refine_depth.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "estimator/depth/edge_labels.h"
#include "estimator/depth/map_faults.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/index.h"
#include "thicklens/base/run_cost.h"

namespace thicklens::estimator {
namespace {

constexpr double kMinJumpPx = 0.25;
constexpr double kJumpOfNoise = 6;
// Edges of a map that is rendered or measured at full size are narrower.
constexpr double kRampPx = 2.2;
constexpr double kMinQuantumPx = 0.02;
constexpr double kManyOutliers = 1e-3;
constexpr double kManyHoles = 1e-3;
// Standard errors of the gain by which a displacement is certain, and probable.
constexpr double kCertain = 3.2, kProbable = 2.5, kNext = 1;
// The gain also has to be this share of the agreement.
constexpr double kMinGain = 0.01;
// The way by which an edge in a filled hole may be wrong, and by which one pass moves it.
constexpr double kHoleSigmaPx = 4, kHoleReachPx = 8;
constexpr int kHolePasses = 2;
constexpr int kAlignments = 4;
constexpr int kMinDilationPx = 2;
constexpr double kMaxShiftPx = 7;

cv::Mat GuideOf(const model::LinearImage& photo, const model::TransferCurve& transfer) {
  const int channels = photo.channels >= 3 ? 3 : 1;
  cv::Mat guide(photo.height_px, photo.width_px, CV_MAKETYPE(CV_32F, channels));
  // A table is as good as the curve.
  constexpr int kCells = 4096;
  std::vector<float> table;
  for (int i = 0; i <= kCells; ++i)
    table.push_back(static_cast<float>(transfer.Encode(std::pow(i / (1.0 * kCells), 2))));
  for (int y = 0; y < photo.height_px; ++y) {
    ThrowIfCancelled();
    float* row = guide.ptr<float>(y);
    for (int x = 0; x < photo.width_px; ++x) {
      for (int c = 0; c < channels; ++c) {
        const float light = std::clamp(photo.at(x, y, c), 0.0F, 1.0F);
        *row++ = table[Index(std::lround(std::sqrt(light) * kCells))];
      }
    }
  }
  return guide;
}

// Whether the map with its rows, its columns or both reversed agrees with the photograph about as
// well as the moved one.
bool AgreesReversed(const cv::Mat& guide, const cv::Mat& map, const cv::Mat& moved,
                    const EdgeLabelOptions& options) {
  constexpr double kAboutAsWell = 0.85;
  const double needed = kAboutAsWell * AlignEdges(guide, moved, options).agreement;
  constexpr int kRows = 0, kColumns = 1, kBoth = -1;  // of cv::flip
  for (const int axes : {kRows, kColumns, kBoth}) {
    cv::Mat reversed;
    cv::flip(map, reversed, axes);
    if (AlignEdges(guide, reversed, options).agreement >= needed) return true;
  }
  return false;
}

// Moves the map to where the photograph has its edges.
void Align(const cv::Mat& guide, const EdgeLabelOptions& labels, bool eager, bool is_coarse,
           cv::Mat* map, DepthRefinement* found) {
  EdgeLabelOptions options = labels;
  options.reach_px = 6;
  options.unsure_px = 2;
  const cv::Mat before = map->clone();
  cv::Mat moved = before;
  EdgeAlignment total;
  for (int i = 0; i < kAlignments; ++i) {
    // A width of 1 px may be that of the blur.
    options.least_dilation_px = total.dilation_px == 0 ? kMinDilationPx : 1;
    const EdgeAlignment step = AlignEdges(guide, moved, options);
    if (step.right_px == 0 && step.down_px == 0 && step.dilation_px == 0) break;
    // A map that is known to be displaced may be so by more, and one that was enlarged is often
    // displaced by a part of its samples.
    const double certain = i > 0 || is_coarse ? kNext : eager ? kProbable : kCertain;
    if (!(step.gain > std::max(certain * step.gain_sigma, kMinGain * step.agreement))) break;
    total.right_px += step.right_px;
    total.down_px += step.down_px;
    total.dilation_px += step.dilation_px;
    moved = Aligned(before, total);
  }
  // So far no map is displaced: the colours repeat.
  const double shift_px = std::hypot(total.right_px, total.down_px);
  if (shift_px > kMaxShiftPx) total = {};
  // A reversed map may look like a displaced one. Then it stays as it is, and the search for
  // contradictions names both.
  if (shift_px > 0 && AgreesReversed(guide, before, moved, options)) total = {};
  found->right_px = total.right_px;
  found->down_px = total.down_px;
  found->dilation_px = total.dilation_px;
  *map = Aligned(before, total);
}

std::string MessageOf(const DepthRefinement& found, bool ramps, bool quanta, bool outliers,
                      bool holes) {
  std::vector<std::string> parts;
  if (found.block_px > 1)
    parts.push_back(fmt::format("blocks of {} px interpolated", found.block_px));
  if (quanta)
    parts.push_back(fmt::format("steps of {:.2g} px per view step smoothed", found.quantum_px));
  if (outliers)
    parts.push_back(fmt::format("{:.2g} % outliers dropped", 100 * found.outlier_share));
  if (ramps) parts.push_back(fmt::format("edges {:.2g} px wide made steps", found.edge_width_px));
  if (found.right_px != 0 || found.down_px != 0) {
    parts.push_back(
        // 0 minus 0 has no sign.
        fmt::format("moved by {:+g} px across and {:+g} px down", 0 - found.right_px,
                    0 - found.down_px));
  }
  if (found.dilation_px != 0) {
    parts.push_back(fmt::format("near surfaces made {} by {:g} px on each side",
                                found.dilation_px > 0 ? "narrower" : "wider",
                                std::abs(found.dilation_px)));
  }
  if (holes) parts.emplace_back("filled holes compared with the photograph");
  if (parts.empty()) return "the map shows no fault: nothing is changed";
  std::string message;
  for (const std::string& part : parts) message += (message.empty() ? "" : ", ") + part;
  return message + fmt::format("; {:.2g} % of the pixels changed", 100 * found.changed_share);
}

}  // namespace

DepthRefinement RefineDepth(const model::LinearImage& photo, const model::TransferCurve& transfer,
                            const std::vector<bool>& was_hole,
                            const DepthRefinementOptions& options, DisparityMap* map) {
  const auto start = Clock::now();
  const std::size_t pixels = Index(map->width_px) * Index(map->height_px);
  if (photo.width_px != map->width_px || photo.height_px != map->height_px ||
      map->disparity.size() != pixels || (!was_hole.empty() && was_hole.size() != pixels)) {
    throw Error(fmt::format(
        "depth refinement: the photograph has {}x{} px, the map {}x{} px with {} values "
        "and {} marks of holes: the sizes must be equal",
        photo.width_px, photo.height_px, map->width_px, map->height_px, map->disparity.size(),
        was_hole.size()));
  }
  // All is done in the unit of the map, so that what does not change keeps its bits.
  const double step = map->step.cwiseAbs().maxCoeff();
  const cv::Mat before =
      cv::Mat(map->height_px, map->width_px, CV_32F, map->disparity.data()).clone();
  cv::Mat now = before.clone();
  DepthRefinement found;
  EdgeLabelOptions labels;
  labels.threads = options.threads;
  labels.jump = std::max(kMinJumpPx, kJumpOfNoise * options.noise_px) / step;

  // The values of the file: filled holes have others.
  cv::Mat unknown(now.size(), CV_8U, cv::Scalar(0));
  for (std::size_t i = 0; i < was_hole.size(); ++i) {
    if (was_hole[i])
      unknown.at<uchar>(static_cast<int>(i / Index(now.cols)),
                        static_cast<int>(i % Index(now.cols))) = 255;
  }
  cv::Mat stored = before.clone();
  stored.setTo(0, unknown);
  const BlockGrid blocks = FindBlocks(stored);
  found.block_px = blocks.size_px();
  if (found.block_px > 1) now = WithoutBlocks(now, blocks);
  const double quantum = QuantumOf(stored, labels.jump);
  found.quantum_px = quantum * step;
  stored.release();
  const bool quanta = found.quantum_px > kMinQuantumPx;
  if (quanta) now = WithoutQuanta(now, quantum, options.threads);
  cv::Mat without_outliers = now.clone();
  found.outlier_share = DropOutliers(labels.jump, &without_outliers);
  const bool outliers = found.outlier_share > kManyOutliers;
  if (outliers) now = without_outliers;
  without_outliers.release();
  found.edge_width_px = EdgeWidthPx(now, 2 * labels.jump);
  const bool ramps = found.edge_width_px > kRampPx;
  if (ramps) SharpenEdges(found.edge_width_px, labels.jump, &now);
  const cv::Mat guide = GuideOf(photo, transfer);
  Align(guide, labels, options.eager, ramps || found.block_px > 1, &now, &found);
  const bool moved = found.right_px != 0 || found.down_px != 0 || found.dilation_px != 0;
  if (ramps || moved || found.block_px > 1) {
    // Sampling places an edge to a part of the distance of the samples, and a blur better.
    labels.edge_sigma_px = moved ? 1 : std::clamp(found.edge_width_px / 8, 0.6, 1.0);
    LabelEdges(guide, labels, &now);
  }
  const bool holes = static_cast<double>(std::count(was_hole.begin(), was_hole.end(), true)) >
                     kManyHoles * static_cast<double>(pixels);
  if (holes) {
    EdgeLabelOptions of_holes = labels;
    of_holes.edge_sigma_px = kHoleSigmaPx;
    of_holes.reach_px = kHoleReachPx;
    for (int pass = 0; pass < kHolePasses; ++pass) LabelUnknown(guide, unknown, of_holes, &now);
  }
  found.applied = ramps || moved || quanta || outliers || holes || found.block_px > 1;
  if (found.applied) {
    std::size_t changed = 0;
    for (std::size_t i = 0; i < pixels; ++i) {
      const int y = static_cast<int>(i / Index(now.cols)),
                x = static_cast<int>(i % Index(now.cols));
      if (x == 0) ThrowIfCancelled();
      const float value = now.at<float>(y, x);
      if (std::abs(value - before.at<float>(y, x)) > static_cast<float>(labels.jump / 2)) ++changed;
      map->disparity[i] = value;
    }
    found.changed_share = static_cast<double>(changed) / static_cast<double>(pixels);
  }
  found.message = MessageOf(found, ramps, quanta, outliers, holes);
  found.seconds = SecondsSince(start);
  return found;
}

}  // namespace thicklens::estimator

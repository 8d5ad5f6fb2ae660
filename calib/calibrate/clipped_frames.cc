#include "calib/calibrate/clipped_frames.h"

#include <fmt/format.h>

#include <algorithm>

#include "calib/registration/change_of_reference.h"
#include "calib/sweep/frame_selection.h"
#include "calib/uncertainty/systematic_advice.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kEnoughFrames = 9, kEnoughOnASide = 3;
// kappa of speckle, of which 2 to 5 % of the pixels were clipped in the sharpest frames, was off by
// up to 0.6 of the largest share in 12 simulated sweeps.
constexpr double kErrorPerShare = 1;
constexpr char kRemedy[] = "lower the exposure until no place of the target is clipped in focus";

double ShareOf(const FrameMeasurement& frame) { return frame.statistics.saturated_fraction; }

bool Contains(const std::vector<std::size_t>& list, std::size_t value) {
  return std::find(list.begin(), list.end(), value) != list.end();
}

}  // namespace

ClippedFrames ChooseClippedFrames(const std::vector<FrameMeasurement>& frames,
                                  const std::vector<std::size_t>& used, double focus_mm,
                                  double replaced_share) {
  ClippedFrames clipped;
  std::size_t nearer = 0, farther = 0;
  for (const std::size_t i : used) {
    ++(frames[i].depth_mm < focus_mm ? nearer : farther);
    if (ShareOf(frames[i]) > replaced_share) clipped.kept.push_back(i);
  }
  std::stable_sort(clipped.kept.begin(), clipped.kept.end(), [&](std::size_t a, std::size_t b) {
    return ShareOf(frames[a]) > ShareOf(frames[b]);
  });
  std::size_t left = used.size();
  while (!clipped.kept.empty()) {
    const std::size_t next = clipped.kept.front();
    std::size_t& side = frames[next].depth_mm < focus_mm ? nearer : farther;
    if (left <= kEnoughFrames || 2 * (left - 1) < used.size() || side <= kEnoughOnASide) break;
    --left;
    --side;
    clipped.left_out.push_back(next);
    clipped.kept.erase(clipped.kept.begin());
  }
  return clipped;
}

std::vector<std::size_t> LeaveOutClipped(ClippedFrames* clipped,
                                         const std::vector<std::size_t>& used,
                                         const SharpestOf& sharpest_of, std::size_t* reference,
                                         std::vector<ScaleSample>* scales,
                                         Calibration* calibration) {
  if (clipped->left_out.empty()) return used;
  std::vector<std::size_t> others;
  for (const std::size_t i : used) {
    if (!Contains(clipped->left_out, i)) others.push_back(i);
  }
  std::vector<std::size_t> registered;
  for (const ScaleSample& sample : *scales) {
    if (Contains(others, sample.frame)) registered.push_back(sample.frame);
  }
  if (registered.empty()) {
    clipped->kept.insert(clipped->kept.begin(), clipped->left_out.begin(), clipped->left_out.end());
    clipped->left_out.clear();
    return used;
  }
  if (Contains(clipped->left_out, *reference)) {
    *reference = sharpest_of(registered);
    const auto next =
        std::find_if(scales->begin(), scales->end(),
                     [reference](const ScaleSample& sample) { return sample.frame == *reference; });
    ReferTo(next->registration, scales);
  }
  double most = 0;
  for (const std::size_t i : clipped->left_out) {
    FrameMeasurement& frame = calibration->frames[i];
    most = std::max(most, ShareOf(frame));
    frame.not_in_fit = fmt::format(
        "{:.2g} % of its pixels are clipped at {:.0f}, which changes its blur, and the other "
        "frames "
        "suffice: lower the exposure",
        100 * ShareOf(frame), frame.statistics.saturation_level);
  }
  const std::string warning = fmt::format(
      "bright places are clipped in {} frames (up to {:.2g} % of the pixels), which are left out "
      "of the fit of the blur because clipping changes it: {}",
      clipped->left_out.size(), 100 * most, kRemedy);
  auto& warnings = calibration->summary.warnings;
  if (std::find(warnings.begin(), warnings.end(), warning) == warnings.end())
    warnings.push_back(warning);
  return others;
}

void WidenByClipping(const ClippedFrames& clipped, Calibration* calibration) {
  if (clipped.kept.empty() || !calibration->summary.blur_ratio) return;
  double most = 0;
  for (const std::size_t i : clipped.kept) {
    if (calibration->frames[i].in_blur_fit) most = std::max(most, ShareOf(calibration->frames[i]));
  }
  if (!(most > 0)) return;
  const double move = kErrorPerShare * most * calibration->summary.blur_ratio->value;
  WidenRatio("clipped bright places", {-move, move}, kRemedy, calibration);
}

}  // namespace thicklens::calib

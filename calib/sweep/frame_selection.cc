#include "calib/sweep/frame_selection.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <numeric>
#include <set>

#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

// The target is not visible in a frame with fewer edges than this and a contrast below this part of
// the median.
constexpr int kMinEdges = 12;
constexpr double kFaintContrast = 0.5;
// A frame of this coarse texture is kept: the target is visible where the noise is averaged out.
constexpr double kClearTexture = 3;
// Frames of a texture cannot be registered in a smaller region.
constexpr int kSmallestTextureRegionPx = 64;
constexpr int kAmpleRegionPx = 128;

}  // namespace

std::string ReadingInWords(const FocusSweep& sweep, double reading_mm, int digits) {
  if (!sweep.shown_reading) return fmt::format("{:.{}f} mm", reading_mm, digits);
  return fmt::format("{:.5g} {}", sweep.shown_reading(reading_mm), sweep.shown_unit);
}

std::string ReadingInWords(const FocusSweep& sweep, double reading_mm) {
  if (!sweep.shown_reading) return fmt::format("{:.6g} mm", reading_mm);
  return fmt::format("{:.5g} {}", sweep.shown_reading(reading_mm), sweep.shown_unit);
}

std::string ReadingErrorInWords(const FocusSweep& sweep, double written_mm, double right_mm,
                                int digits) {
  if (!sweep.shown_reading) return fmt::format("{:.{}f} mm", written_mm - right_mm, digits);
  return fmt::format("{:.2g} {}", sweep.shown_reading(written_mm) - sweep.shown_reading(right_mm),
                     sweep.shown_unit);
}

std::string FileName(const std::string& image) {
  return std::filesystem::path(image).filename().string();
}

FrameSelection::FrameSelection(std::vector<FrameMeasurement>* frames) : frames_(*frames) {
  used_.resize(frames_.size());
  std::iota(used_.begin(), used_.end(), std::size_t{0});
}

std::optional<std::string> FrameSelection::KeepMeasurable(const QualityCheckOptions& checks) {
  std::vector<double> contrasts;
  for (const FrameMeasurement& frame : frames_) {
    if (!RejectionReason(frame.statistics, 0, checks))
      contrasts.push_back(frame.statistics.contrast);
  }
  const double median_contrast = Median(contrasts);
  return KeepOnly([&](const FrameMeasurement& frame) {
    return RejectionReason(frame.statistics, median_contrast, checks);
  });
}

std::optional<std::string> FrameSelection::KeepThoseWithEdges() {
  std::vector<double> contrasts;
  for (const std::size_t i : used_) contrasts.push_back(frames_[i].statistics.contrast);
  const double median_contrast = Median(contrasts);
  return KeepOnly([&](const FrameMeasurement& frame) -> std::optional<std::string> {
    if (frame.edge_count >= kMinEdges ||
        frame.statistics.contrast >= kFaintContrast * median_contrast ||
        frame.statistics.coarse_texture >= kClearTexture)
      return std::nullopt;
    return fmt::format(
        "no edges: only {} edges exceed {:.0f} % of the sweep's steepest edges, and the contrast "
        "is {:.3f} where the median is {:.3f}",
        frame.edge_count, 100 * kEdgeThreshold, frame.statistics.contrast, median_contrast);
  });
}

std::optional<std::string> FrameSelection::KeepPossibleDepths(double bench_offset_mm,
                                                              double front_focal_length_mm) {
  return KeepOnly([&](const FrameMeasurement& frame) -> std::optional<std::string> {
    if (frame.depth_mm > front_focal_length_mm) return std::nullopt;
    return fmt::format(
        "impossible depth: {:.3f} mm with the bench offset at {:.3f} mm is nearer than the front "
        "focal point ({} mm): check offset_mm, direction and units",
        frame.depth_mm, bench_offset_mm, front_focal_length_mm);
  });
}

std::optional<std::string> FrameSelection::KeepUnrejected() {
  return KeepOnly([](const FrameMeasurement& frame) {
    return frame.rejection.empty() ? std::nullopt : std::optional<std::string>(frame.rejection);
  });
}

template <typename Reason>
std::optional<std::string> FrameSelection::KeepOnly(const Reason& reason) {
  std::set<double> distinct;
  std::vector<std::size_t> kept;
  for (const std::size_t i : used_) {
    if (const std::optional<std::string> rejection = reason(frames_[i])) {
      frames_[i].rejection = *rejection;
    } else {
      kept.push_back(i);
      distinct.insert(frames_[i].reading_mm);
    }
  }
  used_ = kept;
  if (distinct.size() >= kMinFrames) return std::nullopt;
  return TooFewUsable(distinct.size());
}

// Returns, for example, "3 of 35 frames can be used, 5 are needed. Rejected: dark (30 frames),
// blank (2 frames), such as frame_000.png: dark: ...".
std::string FrameSelection::TooFewUsable(std::size_t distinct_readings) const {
  struct Kind {
    int frames = 0;
    std::size_t first = 0;
  };
  std::map<std::string, Kind> kinds;
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    if (frames_[i].rejection.empty()) continue;
    Kind& kind = kinds[FailedCheck(frames_[i].rejection)];
    if (kind.frames++ == 0) kind.first = i;
  }
  const std::string counts =
      fmt::format("{} of {} frames can be used{}, but {} are needed", used_.size(), frames_.size(),
                  distinct_readings == used_.size()
                      ? ""
                      : fmt::format(" at {} different readings", distinct_readings),
                  kMinFrames);
  if (kinds.empty()) return counts;
  std::vector<std::pair<std::string, Kind>> sorted(kinds.begin(), kinds.end());
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const auto& a, const auto& b) { return a.second.frames > b.second.frames; });
  std::string reasons;
  for (const auto& [name, kind] : sorted) {
    reasons += fmt::format("{}{} ({} frame{})", reasons.empty() ? "" : ", ", name, kind.frames,
                           kind.frames == 1 ? "" : "s");
  }
  const FrameMeasurement& example = frames_[sorted.front().second.first];
  return fmt::format("{}. Rejected: {}, such as {}: {}", counts, reasons, FileName(example.image),
                     example.rejection);
}

std::string ExposureAdvice(const std::vector<FrameMeasurement>& frames,
                           const std::function<bool()>& have_16_bits) {
  constexpr double kClearGradient = 30;  // in units of the noise's gradient
  std::size_t over = 0, under = 0, clear = 0;
  std::vector<double> means;
  for (const FrameMeasurement& frame : frames) {
    const std::string kind = FailedCheck(frame.rejection);
    if (kind == kKindSaturated) ++over;
    if (kind != kKindDark && kind != kKindBlack) continue;
    ++under;
    means.push_back(frame.statistics.mean_encoded);
    const double noise_gradient = frame.statistics.noise_sigma / std::sqrt(8 * CV_PI);
    if (frame.statistics.top_gradient > kClearGradient * noise_gradient) ++clear;
  }
  const auto advice = [&](std::size_t count, const char* what, const char* remedy) {
    return fmt::format("{} of {} frames are {}: {} and take the sweep again", count, frames.size(),
                       what, remedy);
  };
  if (2 * over > frames.size())
    return advice(over, "over-exposed", "lower the exposure (shorter time, less light or gain)");
  constexpr double kSixteenBits = 65535;
  // The mean alone is more than a hundred steps of 16 bits: 8 bits do not resolve so dark an image
  // so finely.
  if (2 * under > frames.size() && 2 * clear > under && Median(means) * kSixteenBits > 100 &&
      have_16_bits()) {
    return fmt::format(
        "{} of {} frames are dark in their files (on average {:.0f} of 65535), but their texture "
        "is clearly above the noise: values of 10 or 12 bits were stored in 16 bits without "
        "scaling, or the frames are under-exposed; scale the values up, or raise the exposure",
        under, frames.size(), kSixteenBits * Median(means));
  }
  if (2 * under > frames.size())
    return advice(under, "under-exposed", "raise the exposure (longer time, more light)");
  return "";
}

cv::Size RegionSize(const FocusSweep& sweep) {
  if (sweep.roi.width > 0) return {sweep.roi.width, sweep.roi.height};
  return {sweep.camera.sensor.width_px, sweep.camera.sensor.height_px};
}

int RegionSidePx(const FocusSweep& sweep) {
  const cv::Size size = RegionSize(sweep);
  return std::min(size.width, size.height);
}

std::string RegionAdvice(const FocusSweep& sweep) {
  if (RegionSidePx(sweep) >= kSmallestTextureRegionPx) return "";
  const cv::Size size = RegionSize(sweep) * sweep.sensor_px_per_px;
  return fmt::format(
      "the {} has {} x {} px: an edge requires at least {} px on each side, a texture at least {} "
      "px, and {} px or more are better",
      sweep.roi.width > 0 ? "region of interest (roi_px)" : "image", size.width, size.height,
      sweep.sensor_px_per_px * kSmallestRegionPx, sweep.sensor_px_per_px * kSmallestTextureRegionPx,
      sweep.sensor_px_per_px * kAmpleRegionPx);
}

}  // namespace thicklens::calib

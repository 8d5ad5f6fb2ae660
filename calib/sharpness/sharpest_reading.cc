#include "calib/sharpness/sharpest_reading.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "calib/sharpness/log_parabola.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinFrames = 5;
constexpr double kTop = 0.8, kWiderTop = 0.6;  // parts of the largest index

struct Sharpness {
  double reading_mm = 0, index = 0;
  std::size_t frame = 0;
};

struct Peak {
  model::Estimate reading_mm;
  int frames = 0;
};

// Returns the contiguous samples around `top` that reach a part of its index.
std::pair<std::size_t, std::size_t> Around(const std::vector<Sharpness>& samples, std::size_t top,
                                           double part) {
  std::size_t first = top, last = top + 1;
  const double least = part * samples[top].index;
  while (first > 0 && samples[first - 1].index >= least) --first;
  while (last < samples.size() && samples[last].index >= least) ++last;
  // A coarse sweep has few frames that reach this: the nearest ones on both sides are taken.
  while (last - first < kMinFrames && last - first < samples.size()) {
    if (first > 0) --first;
    if (last < samples.size() && last - first < kMinFrames) ++last;
  }
  return {first, last};
}

// Fits the parabola [D70] to samples first to last - 1.
std::optional<Peak> FitPeak(const std::vector<Sharpness>& samples, std::size_t first,
                            std::size_t last) {
  const auto n = static_cast<Eigen::Index>(last - first);
  const double middle_mm = 0.5 * (samples[first].reading_mm + samples[last - 1].reading_mm);
  const double half_mm = 0.5 * (samples[last - 1].reading_mm - samples[first].reading_mm);
  Eigen::VectorXd readings_mm(n), logs(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Sharpness& s = samples[first + static_cast<std::size_t>(i)];
    readings_mm[i] = s.reading_mm;
    logs[i] = std::log(s.index);
  }
  const auto vertex_mm = VertexOfLogs(readings_mm, logs, middle_mm, half_mm);
  if (!vertex_mm) return std::nullopt;
  return Peak{*vertex_mm, static_cast<int>(n)};
}

// Returns the frames with an index above 0, in the order of the readings.
template <typename Index>
std::vector<Sharpness> SamplesOf(const std::vector<FrameMeasurement>& frames,
                                 const std::vector<std::size_t>& used, const Index& index) {
  std::vector<Sharpness> samples;
  for (const std::size_t i : used) {
    if (index(frames[i]) > 0) samples.push_back({frames[i].reading_mm, index(frames[i]), i});
  }
  std::stable_sort(samples.begin(), samples.end(), [](const Sharpness& a, const Sharpness& b) {
    return a.reading_mm < b.reading_mm;
  });
  return samples;
}

std::size_t TopOf(const std::vector<Sharpness>& samples) {
  return static_cast<std::size_t>(
      std::max_element(samples.begin(), samples.end(),
                       [](const Sharpness& a, const Sharpness& b) { return a.index < b.index; }) -
      samples.begin());
}

}  // namespace

SharpestReading FindSharpestReading(const std::vector<FrameMeasurement>& frames,
                                    const std::vector<std::size_t>& used) {
  SharpestReading result;
  const std::vector<Sharpness> samples = SamplesOf(
      frames, used, [](const FrameMeasurement& frame) { return frame.normalised_edge_slope; });
  if (samples.size() < kMinFrames) {
    result.message = used.size() < kMinFrames
                         ? fmt::format("{} of {} frames passed the checks, but {} are needed",
                                       used.size(), frames.size(), kMinFrames)
                     : samples.empty()
                         ? "no edges were measured in the frames"
                         : fmt::format("{} of {} frames have edges, but {} are needed",
                                       samples.size(), used.size(), kMinFrames);
    return result;
  }
  const std::size_t top = TopOf(samples);
  result.sharpest_frame = static_cast<int>(samples[top].frame);
  const auto [first, last] = Around(samples, top, kTop);
  const std::optional<Peak> peak = FitPeak(samples, first, last);
  if (!peak) {
    result.message = top == 0 || top + 1 == samples.size()
                         ? fmt::format("sharpness rises up to the {} reading, {:.6g} mm",
                                       top == 0 ? "smallest" : "largest", samples[top].reading_mm)
                         : "the top of the sharpness curve has no maximum";
    return result;
  }
  result.done = true;
  result.message = "fitted";
  result.reading_mm = peak->reading_mm;
  const auto widen = [&](const std::optional<Peak>& other) {
    if (!other) return;
    const double apart_mm = other->reading_mm.value - peak->reading_mm.value;
    result.reading_mm.sigma = std::hypot(result.reading_mm.sigma, 0.5 * apart_mm);
  };
  const auto [wider_first, wider_last] = Around(samples, top, kWiderTop);
  widen(FitPeak(samples, wider_first, wider_last));
  const std::vector<Sharpness> gradients =
      SamplesOf(frames, used, [](const FrameMeasurement& frame) {
        const FrameStatistics& s = frame.statistics;
        return s.mean_linear > 0 ? s.top_gradient / s.mean_linear : 0;
      });
  if (gradients.size() >= kMinFrames) {
    const auto [from, to] = Around(gradients, TopOf(gradients), kTop);
    widen(FitPeak(gradients, from, to));
  }
  result.frames_used = peak->frames;
  return result;
}

}  // namespace thicklens::calib

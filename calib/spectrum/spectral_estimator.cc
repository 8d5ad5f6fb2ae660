#include "calib/spectrum/spectral_estimator.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "thicklens/base/parallel.h"
#include "thicklens/base/pi.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinFrames = 5;
// Ratio of the window to the largest blur in it: large where enough frames remain, otherwise
// smaller.
constexpr double kWindowOverBlur[] = {35, 25, 16};
constexpr std::size_t kEnoughFrames = 9;
constexpr double kLonelyGain = 1.25;
constexpr double kLowestMode = 2.5;  // cycles per window: the Hann window's own width
// Orders up to which a line is seen: the spectrum of the Hann window is 0 from 2 on.
constexpr int kWidthOfWindow = 2;
constexpr double kHighestFrequency = 0.33;  // cycles per px of the reference
constexpr double kHighestInFrame = 0.38;    // cycles per px of any frame
constexpr double kBandMargin = 3.2;         // 2 pi^2 dV nu^2 up to which modes are measured
constexpr double kLeakageMargin = 1.4;      // relative to the largest expected sigma
// Maximum product of rotation and field for which the rotation is not corrected. It blurs by
// (rotation size)^2/30 px^2, less than resampling the frame would.
constexpr double kSmallRotationPx = 0.17;

// The part of the target that all frames show, as X of its corners.
struct Box {
  Eigen::Vector2d low{-1e9, -1e9}, high{1e9, 1e9};
};

Box SeenByAll(const SpectralEstimatorSetup& setup, const std::vector<std::size_t>& frames) {
  Box box;
  for (const std::size_t f : frames) {
    const FramePlace& place = setup.frames[f].place;
    const Eigen::Vector2d first = (-setup.origin_px - place.shift_px) / place.scale;
    const Eigen::Vector2d last =
        (setup.size_px - Eigen::Vector2d::Ones() - setup.origin_px - place.shift_px) / place.scale;
    box.low = box.low.cwiseMax(first);
    box.high = box.high.cwiseMin(last);
  }
  return box;
}

double LeastVariance(const SpectralEstimatorSetup& setup) {
  double least = std::numeric_limits<double>::infinity();
  for (const EstimatorFrame& frame : setup.frames)
    least = std::min(least, frame.expected_variance_px2);
  return least;
}

// Removes the rotation about the point where the frame shows the origin.
cv::Mat Derotated(const cv::Mat& grey, const SpectralEstimatorSetup& setup,
                  const EstimatorFrame& frame) {
  if (std::abs(frame.rotation_rad) * std::max(grey.cols, grey.rows) < kSmallRotationPx) return grey;
  const double c = std::cos(frame.rotation_rad), s = std::sin(frame.rotation_rad);
  const Eigen::Vector2d middle = setup.origin_px + frame.place.shift_px;
  const cv::Matx23d map(c, -s, middle.x() - c * middle.x() + s * middle.y(), s, c,
                        middle.y() - s * middle.x() - c * middle.y());
  cv::Mat turned;
  cv::warpAffine(grey, turned, map, grey.size(), cv::INTER_LANCZOS4 | cv::WARP_INVERSE_MAP,
                 cv::BORDER_REFLECT_101);
  return turned;
}

// The modes that may be measured in a region.
std::vector<Mode> PossibleModes(const SpectralEstimatorSetup& setup, const TargetWindow& window) {
  std::vector<Mode> modes = CandidateModes(window);
  modes.erase(
      std::remove_if(modes.begin(), modes.end(),
                     [&](const Mode& mode) {
                       return (setup.without_row_modes && std::abs(mode.jx) < kWidthOfWindow) ||
                              (setup.without_column_modes && std::abs(mode.jy) < kWidthOfWindow);
                     }),
      modes.end());
  return modes;
}

// Chooses modes with power in the sharpest frames of each region: the reference and its two
// sharpest companions.
void ChooseModes(const SpectralEstimatorSetup& setup, std::vector<EstimatorRegion>* regions) {
  std::vector<std::vector<std::size_t>> shown_by;  // a frame that stands twice counts twice
  std::vector<std::size_t> frames;
  for (const EstimatorRegion& region : *regions) {
    shown_by.push_back(FramesThatShowModes(setup, region));
    frames.insert(frames.end(), shown_by.back().begin(), shown_by.back().end());
  }
  std::sort(frames.begin(), frames.end());
  frames.erase(std::unique(frames.begin(), frames.end()), frames.end());
  std::vector<std::vector<Mode>> modes;
  std::vector<Eigen::ArrayXd> power;
  for (const EstimatorRegion& region : *regions) {
    modes.push_back(PossibleModes(setup, region.window));
    power.emplace_back(Eigen::ArrayXd::Zero(static_cast<Eigen::Index>(modes.back().size())));
  }
  std::vector<double> noise(regions->size(), 0);
  const auto measure = [&](std::size_t f, const cv::Mat& grey, std::size_t r) {
    const auto times = static_cast<double>(std::count(shown_by[r].begin(), shown_by[r].end(), f));
    if (times == 0) return;
    const EstimatorFrame& frame = setup.frames[f];
    const auto spectrum = MeasureSpectrum(grey, setup.origin_px, frame.place, (*regions)[r].window,
                                          modes[r], modes[r].size());
    if (!spectrum) return;
    power[r] += times * spectrum->values.abs2();
    noise[r] += times * spectrum->noise_gain * frame.pixel_noise * frame.pixel_noise;
  };
  // One frame after the other, so that few are in memory.
  for (const std::size_t f : frames) {
    const cv::Mat grey = Derotated(setup.read_grey(setup.frames[f].frame), setup, setup.frames[f]);
    ParallelFor(static_cast<int>(regions->size()), setup.threads,
                [&](int r) { measure(f, grey, static_cast<std::size_t>(r)); });
  }
  ParallelFor(static_cast<int>(regions->size()), setup.threads, [&](int index) {
    const auto r = static_cast<std::size_t>(index);
    EstimatorRegion& region = (*regions)[r];
    region.modes = StrongestModes(modes[r], power[r], region.window, kSignalToNoise * noise[r],
                                  setup.modes_per_ring);
  });
}

// Removes the frames without which the others would share much more of the target. They were
// shifted far aside.
void DropLonely(const SpectralEstimatorSetup& setup, std::vector<std::size_t>* frames) {
  const auto smaller_side = [&](const std::vector<std::size_t>& chosen) {
    const Box box = SeenByAll(setup, chosen);
    return (box.high - box.low).minCoeff();
  };
  while (frames->size() > kEnoughFrames) {
    const double now = smaller_side(*frames);
    double best = now;
    std::size_t lonely = 0;
    for (std::size_t i = 0; i < frames->size(); ++i) {
      if ((*frames)[i] == setup.reference) continue;
      std::vector<std::size_t> others = *frames;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
      if (const double side = smaller_side(others); side > best) {
        best = side;
        lonely = i;
      }
    }
    if (!(best > kLonelyGain * std::max(now, 1.0))) return;
    frames->erase(frames->begin() + static_cast<std::ptrdiff_t>(lonely));
  }
}

std::optional<EstimatorRegion> PlanRegion(const SpectralEstimatorSetup& setup, double part,
                                          const Eigen::Vector2d& place, double window_over_blur) {
  const double least = LeastVariance(setup);
  EstimatorRegion region;
  for (std::size_t f = 0; f < setup.frames.size(); ++f) region.frames.push_back(f);
  DropLonely(setup, &region.frames);
  // The frames with the largest blur are removed one by one; each removal lets the window grow.
  while (region.frames.size() >= kMinFrames) {
    const Box box = SeenByAll(setup, region.frames);
    const Eigen::Vector2d size = (box.high - box.low) * part;
    const double smaller = size.minCoeff();
    const auto blur = [&](std::size_t f) {
      return std::sqrt(std::max(0.0, setup.frames[f].expected_variance_px2 - least));
    };
    const auto worst =
        std::max_element(region.frames.begin(), region.frames.end(),
                         [&](std::size_t a, std::size_t b) { return blur(a) < blur(b); });
    if (smaller > 0 && blur(*worst) <= smaller / window_over_blur) {
      region.window.size_px = size;
      region.window.centre_px = 0.5 * (box.low + box.high) + place.cwiseProduct(box.high - box.low);
      const auto reference = std::find(region.frames.begin(), region.frames.end(), setup.reference);
      if (reference == region.frames.end()) return std::nullopt;
      region.reference = static_cast<std::size_t>(reference - region.frames.begin());
      return region;
    }
    if (*worst == setup.reference) return std::nullopt;
    region.frames.erase(worst);
  }
  return std::nullopt;
}

}  // namespace

std::vector<Mode> CandidateModes(const TargetWindow& window) {
  const double least = kLowestMode / std::min(window.size_px.x(), window.size_px.y());
  return ModesBetween(window, least, kHighestFrequency);
}

std::size_t ModesInBand(const std::vector<Mode>& modes, const TargetWindow& window, double scale,
                        double added_variance_px2) {
  double limit = kHighestInFrame * scale;
  if (added_variance_px2 > 0)
    limit = std::min(limit, std::sqrt(kBandMargin / (2 * kPi * kPi * added_variance_px2)));
  std::size_t count = 0;
  while (count < modes.size() && ModeFrequency(modes[count], window).norm() < limit) ++count;
  return count;
}

std::vector<std::size_t> FramesThatShowModes(const SpectralEstimatorSetup& setup,
                                             const EstimatorRegion& region) {
  std::vector<std::size_t> sharpest = region.frames;
  std::stable_sort(sharpest.begin(), sharpest.end(), [&](std::size_t a, std::size_t b) {
    return setup.frames[a].expected_variance_px2 < setup.frames[b].expected_variance_px2;
  });
  sharpest.resize(std::min<std::size_t>(sharpest.size(), 3));
  sharpest.push_back(setup.reference);
  return sharpest;
}

std::optional<EstimatorRegion> PlanRegion(const SpectralEstimatorSetup& setup, double part,
                                          const Eigen::Vector2d& place) {
  std::optional<EstimatorRegion> region;
  for (const double window_over_blur : kWindowOverBlur) {
    region = PlanRegion(setup, part, place, window_over_blur);
    if (region && region->frames.size() >= std::min(kEnoughFrames, setup.frames.size())) break;
  }
  return region;
}

void MeasureRegions(const SpectralEstimatorSetup& setup, std::vector<EstimatorRegion>* regions) {
  const double least = LeastVariance(setup);
  ChooseModes(setup, regions);
  for (EstimatorRegion& region : *regions) region.samples.assign(region.frames.size(), {});
  const auto count = static_cast<int>(setup.frames.size());
  ParallelFor(count, setup.threads, [&](int index) {
    const auto f = static_cast<std::size_t>(index);
    const EstimatorFrame& frame = setup.frames[f];
    const bool is_used = std::any_of(regions->begin(), regions->end(), [&](const auto& region) {
      return std::find(region.frames.begin(), region.frames.end(), f) != region.frames.end();
    });
    if (is_used) {
      const cv::Mat grey = Derotated(setup.read_grey(frame.frame), setup, frame);
      for (EstimatorRegion& region : *regions) {
        const auto place = std::find(region.frames.begin(), region.frames.end(), f);
        if (place == region.frames.end()) continue;
        const std::size_t modes = f == setup.reference
                                      ? region.modes.size()
                                      : ModesInBand(region.modes, region.window, frame.place.scale,
                                                    frame.expected_variance_px2 - least);
        auto spectrum =
            MeasureSpectrum(grey, setup.origin_px, frame.place, region.window, region.modes, modes);
        if (!spectrum) continue;
        SpectrumSample& sample =
            region.samples[static_cast<std::size_t>(place - region.frames.begin())];
        sample.scale = frame.place.scale;
        sample.pixel_noise = frame.pixel_noise;
        sample.start_variance_px2 = frame.expected_variance_px2;
        sample.spectrum = std::move(*spectrum);
      }
    }
    if (setup.tick) setup.tick();
  });
  for (EstimatorRegion& region : *regions) {
    EstimatorRegion kept = region;
    kept.frames.clear();
    kept.samples.clear();
    for (std::size_t i = 0; i < region.frames.size(); ++i) {
      if (region.samples[i].spectrum.values.size() < 4) continue;
      if (region.frames[i] == setup.reference) kept.reference = kept.frames.size();
      kept.frames.push_back(region.frames[i]);
      kept.samples.push_back(std::move(region.samples[i]));
    }
    region = std::move(kept);
  }
  const cv::Mat reference = Derotated(setup.read_grey(setup.frames[setup.reference].frame), setup,
                                      setup.frames[setup.reference]);
  // Regions are independent, so that each is the work of one thread where there are several.
  const int threads_of_one = regions->size() > 1 ? 1 : setup.threads;
  ParallelFor(static_cast<int>(regions->size()), setup.threads, [&](int index) {
    EstimatorRegion& region = (*regions)[static_cast<std::size_t>(index)];
    if (region.frames.size() < kMinFrames || region.modes.empty()) return;
    double largest = 0;
    for (const std::size_t f : region.frames)
      largest = std::max(largest, setup.frames[f].expected_variance_px2 - least);
    region.leakage = WindowLeakage(reference, setup.origin_px, region.window, region.modes,
                                   region.samples[region.reference].spectrum, setup.psf,
                                   kLeakageMargin * std::sqrt(largest) + 0.5, threads_of_one);
  });
}

AxisLeakage MeasureAxisLeakage(const SpectralEstimatorSetup& setup, const EstimatorRegion& region,
                               double largest_variance_px2, double angle_rad) {
  const EstimatorFrame& frame = setup.frames[region.frames[region.reference]];
  const cv::Mat reference = Derotated(setup.read_grey(frame.frame), setup, frame);
  std::vector<WindowLeakage> leakages = WindowLeakage::AlongAxes(
      reference, setup.origin_px, region.window, region.modes,
      region.samples[region.reference].spectrum, setup.psf,
      kLeakageMargin * std::sqrt(largest_variance_px2) + 0.5, setup.threads,
      {Eigen::Vector2d::UnitX(), Eigen::Vector2d::UnitY()}, angle_rad);
  return {std::move(leakages[0]), std::move(leakages[1])};
}

EstimatorRegion PartOf(const EstimatorRegion& region,
                       const std::function<bool(std::size_t frame)>& frame,
                       const std::function<bool(const Mode& mode)>& mode) {
  EstimatorRegion part;
  part.window = region.window;
  std::vector<Eigen::Index> kept;
  for (std::size_t k = 0; k < region.modes.size(); ++k) {
    if (!mode(region.modes[k])) continue;
    kept.push_back(static_cast<Eigen::Index>(k));
    part.modes.push_back(region.modes[k]);
  }
  part.leakage = region.leakage.Of(kept);
  for (std::size_t i = 0; i < region.frames.size(); ++i) {
    if (!frame(region.frames[i])) continue;
    if (i == region.reference) part.reference = part.frames.size();
    part.frames.push_back(region.frames[i]);
    SpectrumSample sample = region.samples[i];
    std::vector<Eigen::Index> present;
    for (const Eigen::Index k : kept) {
      if (k < sample.spectrum.values.size()) present.push_back(k);
    }
    sample.spectrum.values = Eigen::ArrayXcd(region.samples[i].spectrum.values(present));
    part.samples.push_back(std::move(sample));
  }
  return part;
}

}  // namespace thicklens::calib

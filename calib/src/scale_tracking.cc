#include "scale_tracking.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "thicklens/model/parallel.h"

namespace thicklens::calib {
namespace {

// More pixels than this would cost time and tell nothing more about the scale.
constexpr int kRegistrationSizePx = 1024;

cv::Mat ForRegistration(const FocusSweep& sweep, std::size_t index) {
  const cv::Mat grey = LinearGrey(sweep.read_frame(index), sweep, index);
  const double shrink = static_cast<double>(kRegistrationSizePx) / std::max(grey.cols, grey.rows);
  if (!(shrink < 1)) return grey;
  cv::Mat small;
  cv::resize(grey, small, cv::Size(), shrink, shrink, cv::INTER_AREA);
  return small;
}

// Predicts the scale at a reading from what has been registered so far.
class ScalePrediction {
 public:
  ScalePrediction(const FocusSweep& sweep, std::size_t reference, std::optional<double> offset_mm)
      : reference_reading_mm_(sweep.frames[reference].reading_mm),
        sign_(model::DirectionSign(sweep.direction)) {
    if (offset_mm) reference_depth_mm_ = *offset_mm + sign_ * reference_reading_mm_;
  }

  double At(double reading_mm) const {
    if (reference_depth_mm_ > 0) {
      const double depth_mm = reference_depth_mm_ + sign_ * (reading_mm - reference_reading_mm_);
      return std::clamp(reference_depth_mm_ / std::max(depth_mm, 1e-9), 0.05, 20.0);
    }
    return 1 / std::max(0.05, 1 + slope_ * (reading_mm - reference_reading_mm_));
  }

  // 1/scale is a straight line through 1 at the reference; its slope by the median over the samples
  // is not moved by a registration that went wrong.
  void Learn(const std::vector<ScaleSample>& samples) {
    if (reference_depth_mm_ > 0) return;
    std::vector<double> slopes;
    for (const ScaleSample& s : samples) {
      const double step_mm = s.reading_mm - reference_reading_mm_;
      if (step_mm != 0) slopes.push_back((1 / s.scale - 1) / step_mm);
    }
    if (slopes.empty()) return;
    std::sort(slopes.begin(), slopes.end());
    slope_ = slopes[slopes.size() / 2];
  }

 private:
  double reference_reading_mm_;
  double sign_;
  double reference_depth_mm_ = 0;  // 0: unknown, the slope is learnt
  double slope_ = 0;
};

}  // namespace

std::vector<ScaleSample> TrackScale(const FocusSweep& sweep, const std::vector<std::size_t>& frames,
                                    std::size_t reference, std::optional<double> known_offset_mm,
                                    int threads, const std::function<void()>& tick) {
  const cv::Mat reference_grey = ForRegistration(sweep, reference);
  const double reference_reading_mm = sweep.frames[reference].reading_mm;
  std::vector<std::size_t> order;
  for (const std::size_t frame : frames) {
    if (frame != reference) order.push_back(frame);
  }
  const auto distance_mm = [&](std::size_t frame) {
    return std::abs(sweep.frames[frame].reading_mm - reference_reading_mm);
  };
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return distance_mm(a) < distance_mm(b); });

  std::vector<ScaleSample> samples = {{reference, reference_reading_mm, 1.0}};
  ScalePrediction prediction(sweep, reference, known_offset_mm);
  std::size_t done = 0;
  // Waves that double: within one, every start comes from the law of the waves before.
  std::size_t wave = known_offset_mm ? order.size() : 2;
  while (done < order.size()) {
    const std::size_t count = std::min(wave, order.size() - done);
    std::vector<std::optional<double>> scales(count);
    model::ParallelFor(static_cast<int>(count), threads, [&](int i) {
      const std::size_t frame = order[done + static_cast<std::size_t>(i)];
      scales[static_cast<std::size_t>(i)] =
          RegisterScale(reference_grey, ForRegistration(sweep, frame),
                        prediction.At(sweep.frames[frame].reading_mm));
      tick();
    });
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t frame = order[done + i];
      if (scales[i]) samples.push_back({frame, sweep.frames[frame].reading_mm, *scales[i]});
    }
    prediction.Learn(samples);
    done += count;
    wave = std::max<std::size_t>(wave, done / 2);
  }
  return samples;
}

}  // namespace thicklens::calib

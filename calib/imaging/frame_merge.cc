#include "thicklens/calib/frame_merge.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "calib/imaging/frame_placement.h"
#include "calib/registration/scale_tracking.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/validity.h"

namespace thicklens::calib {
namespace {

constexpr double kMinLogWeight = -27.6;  // of each frame where none shows detail
constexpr double kMinLogRatio = -80;     // of two weights: below it, one has no effect
constexpr double kNoiseQuantile = 0.01;  // of the energies; such places show noise alone
constexpr double kShowsDetail = 6;       // energy over that of the noise
constexpr double kSmoothedPx = 0.7;      // before the Laplacian, against noise
constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();

// Energy of the Laplacian in a neighbourhood: of a defocused texture it falls with the fourth power
// of the frequency that is left, so that it has its largest value in focus.
cv::Mat SharpnessOf(const cv::Mat& grey, double sigma_px) {
  cv::Mat smooth, energy;
  cv::GaussianBlur(grey, smooth, {}, kSmoothedPx);
  cv::Laplacian(smooth, energy, CV_32F);
  energy = energy.mul(energy);
  cv::GaussianBlur(energy, energy, {}, sigma_px);
  return energy;
}

float Quantile(const cv::Mat& values, const cv::Mat& shown, double part) {
  std::vector<float> sorted;
  constexpr int kStep = 3;
  for (int y = 0; y < values.rows; y += kStep) {
    for (int x = 0; x < values.cols; x += kStep) {
      if (shown.at<float>(y, x) > 0) sorted.push_back(values.at<float>(y, x));
    }
  }
  if (sorted.empty()) return 0;
  const auto at =
      sorted.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(sorted.size() - 1));
  std::nth_element(sorted.begin(), at, sorted.end());
  return *at;
}

// The sharpness at the sharpest frame of a pixel and at its neighbours in the order of the
// readings.
struct Peaks {
  explicit Peaks(cv::Size size)
      : before(size, CV_32F, kNothing),
        best(size, CV_32F, cv::Scalar(0)),
        after(size, CV_32F, kNothing),
        last(size, CV_32F, kNothing),
        index(size, CV_32S, cv::Scalar(-1)) {}
  cv::Mat before, best, after, last, index;

  void Add(const cv::Mat& energy, const cv::Mat& shown, int frame) {
    for (int y = 0; y < energy.rows; ++y) {
      ThrowIfCancelled();
      for (int x = 0; x < energy.cols; ++x) {
        const float value = shown.at<float>(y, x) > 0 ? energy.at<float>(y, x) : kNothing;
        if (value > best.at<float>(y, x)) {
          before.at<float>(y, x) = last.at<float>(y, x);
          best.at<float>(y, x) = value;
          after.at<float>(y, x) = kNothing;
          index.at<int>(y, x) = frame;
        } else if (index.at<int>(y, x) == frame - 1) {
          after.at<float>(y, x) = value;
        }
        last.at<float>(y, x) = value;
      }
    }
  }
};

// Vertex of the parabola through the logarithms of three energies, at the readings b.
double PeakReading(const double b[3], double before, double best, double after) {
  if (!(before > 0) || !(after > 0)) return b[1];
  const double x0 = b[0] - b[1], x2 = b[2] - b[1];
  const double y0 = std::log(before / best), y2 = std::log(after / best);
  const double bend = (y0 / x0 - y2 / x2) / (x0 - x2), slope = y0 / x0 - bend * x0;
  if (!(bend < 0)) return b[1];
  return b[1] + std::clamp(-slope / (2 * bend), std::min(x0, x2), std::max(x0, x2));
}

class Merge {
 public:
  Merge(const FocusSweep& sweep, const Calibration& calibration, const MergeOptions& options)
      : sweep_(sweep), calibration_(calibration), options_(options) {}

  MergedFrames Run() {
    const auto reference = AlignmentReference(calibration_);
    if (!reference) return Ended("no frame passed its checks");
    merged_.reference = static_cast<int>(*reference);
    const auto reference_scale = ScaleOfFrame(calibration_, *reference, sweep_.direction);
    if (!reference_scale) return Ended("the image scale of the frames is not known");
    axis_ = RegionCentre(sweep_);
    reference_grey_ = LinearGrey(sweep_.read_frame(*reference), sweep_, *reference);
    // The unit of the reference is that of all frames. A common factor changes only where detail
    // begins to count.
    unit_ = std::max(Quantile(SharpnessOf(reference_grey_, options_.sharpness_sigma_px),
                              cv::Mat::ones(reference_grey_.size(), CV_32F), 0.99),
                     1e-20F);
    const std::vector<std::size_t> order = FramesByReading();
    int done = 0;
    for (const std::size_t frame : order) {
      ThrowIfCancelled();
      const auto scale = ScaleOfFrame(calibration_, frame, sweep_.direction);
      if (!scale || !Add(frame, *scale / *reference_scale, frame == *reference)) ++merged_.left_out;
      if (options_.progress) options_.progress(++done, static_cast<int>(order.size()));
    }
    if (merged_.frames < 2)
      return Ended(fmt::format("{} of {} frames could be aligned, but 2 are needed", merged_.frames,
                               order.size()));
    Finish();
    return std::move(merged_);
  }

 private:
  MergedFrames Ended(const std::string& why) {
    MergedFrames ended;
    ended.message = why;
    return ended;
  }

  std::vector<std::size_t> FramesByReading() const {
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < calibration_.frames.size(); ++i) {
      if (calibration_.frames[i].rejection.empty()) order.push_back(i);
    }
    std::stable_sort(order.begin(), order.end(), [this](std::size_t a, std::size_t b) {
      return calibration_.frames[a].reading_mm < calibration_.frames[b].reading_mm;
    });
    return order;
  }

  cv::Mat Light(std::size_t frame, const cv::Mat& stored) const {
    const int channels = stored.channels() >= 3 ? 3 : 1;
    if (channels == 1) return LinearGrey(stored, sweep_, frame);
    std::vector<cv::Mat> planes;
    for (int c = 0; c < channels; ++c) planes.push_back(LinearChannel(stored, sweep_, frame, c));
    cv::Mat light;
    cv::merge(planes, light);
    return light;
  }

  bool Add(std::size_t frame, double scale, bool is_reference) {
    const cv::Mat stored = sweep_.read_frame(frame);
    cv::Mat map = cv::Mat::eye(2, 3, CV_64F);
    const cv::Mat grey = LinearGrey(stored, sweep_, frame);
    if (!is_reference) {
      const auto placed = PlaceFrame(reference_grey_, grey, scale, axis_);
      if (!placed) return false;
      map = *placed;
    }
    cv::Mat light = Warped(Light(frame, stored), map, is_reference);
    if (!sum_.empty() && light.channels() != sum_.channels()) {
      throw Error(fmt::format("{}: it has {} channel(s), but the frames before it have {}",
                              calibration_.frames[frame].image, light.channels(), sum_.channels()));
    }
    const cv::Mat grey_here = is_reference ? grey : Warped(grey, map, false);
    cv::Mat shown = is_reference ? cv::Mat::ones(grey.size(), CV_32F)
                                 : Warped(cv::Mat::ones(grey.size(), CV_32F), map, false);
    shown = ShownOf(shown);
    const double gain = GainOf(grey_here, shown);
    light *= gain;
    cv::Mat energy = SharpnessOf(grey_here, options_.sharpness_sigma_px);
    energy *= gain * gain;
    Accumulate(light, energy, shown, calibration_.frames[frame].reading_mm);
    return true;
  }

  static cv::Mat Warped(const cv::Mat& image, const cv::Mat& map, bool is_same) {
    if (is_same) return image.clone();
    cv::Mat warped;
    cv::warpAffine(image, warped, map, image.size(), cv::INTER_CUBIC | cv::WARP_INVERSE_MAP,
                   cv::BORDER_CONSTANT, cv::Scalar::all(0));
    return warped;
  }

  // 1 where the frame shows the whole neighbourhood in which sharpness is measured, otherwise 0.
  cv::Mat ShownOf(const cv::Mat& ones) const {
    cv::Mat inside = ones > 0.999, shown;
    const int reach = static_cast<int>(std::ceil(2 * options_.sharpness_sigma_px)) + 2;
    cv::erode(inside, inside,
              cv::getStructuringElement(cv::MORPH_RECT, {2 * reach + 1, 2 * reach + 1}), {-1, -1},
              1, cv::BORDER_CONSTANT, cv::Scalar::all(255));
    inside.convertTo(shown, CV_32F, 1.0 / 255);
    return shown;
  }

  // The light of the target changes with its distance from the lamp.
  double GainOf(const cv::Mat& grey, const cv::Mat& shown) const {
    const cv::Mat mask = shown > 0;
    const double here = cv::mean(grey, mask)[0];
    return here > 0 ? cv::mean(reference_grey_, mask)[0] / here : 1;
  }

  void Accumulate(const cv::Mat& light, const cv::Mat& energy, const cv::Mat& shown,
                  double reading_mm) {
    if (sum_.empty()) {
      sum_ = cv::Mat(light.size(), light.type(), cv::Scalar::all(0));
      weights_ = cv::Mat(light.size(), CV_32F, cv::Scalar(0));
      log_largest_ = cv::Mat(light.size(), CV_32F, cv::Scalar(kMinLogWeight));
      peaks_.emplace(light.size());
    }
    noises_.push_back(Quantile(energy, shown, kNoiseQuantile));
    // Relative to the largest weight of the pixel until now: the weight itself, a power of the
    // energy, may exceed what a number can hold.
    cv::Mat weight = energy / unit_;
    cv::log(cv::max(weight, 1e-30F), weight);
    weight *= options_.selectivity;
    weight = cv::max(weight, kMinLogWeight);
    weight.setTo(kMinLogWeight, shown == 0);
    const cv::Mat largest = cv::max(log_largest_, weight);
    cv::Mat former = log_largest_ - largest;
    cv::exp(cv::max(former, kMinLogRatio), former);
    weight -= largest;
    cv::exp(cv::max(weight, kMinLogRatio), weight);
    weight = weight.mul(shown);
    log_largest_ = largest;
    weights_ = weights_.mul(former) + weight;
    if (light.channels() == 3) {
      cv::merge(std::vector<cv::Mat>(3, weight), weight);
      cv::merge(std::vector<cv::Mat>(3, former), former);
    }
    sum_ = sum_.mul(former) + light.mul(weight);
    peaks_->Add(energy, shown, merged_.frames);
    readings_mm_.push_back(reading_mm);
    ++merged_.frames;
  }

  void Finish() {
    cv::Mat weights = cv::max(weights_, 1e-30F);
    if (sum_.channels() == 3) cv::merge(std::vector<cv::Mat>(3, weights), weights);
    merged_.light = sum_ / weights;
    std::vector<float> noises = noises_;
    std::nth_element(noises.begin(),
                     noises.begin() + static_cast<std::ptrdiff_t>(noises.size() / 2), noises.end());
    FindReadings(noises[noises.size() / 2]);
    FindHeights();
    merged_.done = true;
    merged_.message = "done";
  }

  void FindReadings(float noise) {
    merged_.focus_reading_mm = cv::Mat(sum_.size(), CV_32F, kNothing);
    const int last = merged_.frames - 1;
    for (int y = 0; y < sum_.rows; ++y) {
      for (int x = 0; x < sum_.cols; ++x) {
        const int k = peaks_->index.at<int>(y, x);
        const float best = peaks_->best.at<float>(y, x);
        if (k < 0 || !(best > kShowsDetail * noise)) continue;
        double reading_mm = readings_mm_[static_cast<std::size_t>(k)];
        if (k > 0 && k < last) {
          const double b[3] = {readings_mm_[static_cast<std::size_t>(k - 1)], reading_mm,
                               readings_mm_[static_cast<std::size_t>(k + 1)]};
          if (b[0] < b[1] && b[1] < b[2]) {
            reading_mm = PeakReading(b, peaks_->before.at<float>(y, x) - noise, best - noise,
                                     peaks_->after.at<float>(y, x) - noise);
          }
        }
        merged_.focus_reading_mm.at<float>(y, x) = static_cast<float>(reading_mm);
      }
    }
  }

  // A point that comes into focus when the target's zero is at the depth z is at zf itself: it is
  // z - zf nearer to the camera than that zero.
  void FindHeights() {
    const auto& zf = calibration_.summary.focus_depth_mm;
    const auto& offset = calibration_.summary.bench_offset_mm;
    if (!zf || !offset || !std::isfinite(zf->value) || !std::isfinite(offset->value) ||
        model::MovesFocus(calibration_.diagnostics.moves))
      return;
    merged_.focus_reading_mm.convertTo(merged_.height_mm, CV_32F,
                                       model::DirectionSign(sweep_.direction),
                                       offset->value - zf->value);
  }

  const FocusSweep& sweep_;
  const Calibration& calibration_;
  const MergeOptions& options_;
  cv::Point2d axis_;
  cv::Mat reference_grey_;
  // Sums with weights relative to the largest of each pixel, and the logarithm of that.
  cv::Mat sum_, weights_, log_largest_;
  std::optional<Peaks> peaks_;
  float unit_ = 1;
  std::vector<float> noises_;
  std::vector<double> readings_mm_;  // of the merged frames, in their order
  MergedFrames merged_;
};

}  // namespace

bool MergeOptions::IsValid(std::string* why) const {
  if (!(sharpness_sigma_px >= 0.5) || !(sharpness_sigma_px <= 20)) {
    return Fail(why,
                fmt::format("sharpness_sigma_px is {}: 0.5 to 20 is expected", sharpness_sigma_px));
  }
  if (!(selectivity >= 1) || !(selectivity <= 20))
    return Fail(why, fmt::format("selectivity is {}: 1 to 20 is expected", selectivity));
  return true;
}

MergedFrames MergeFrames(const FocusSweep& sweep, const Calibration& calibration,
                         const MergeOptions& options) {
  std::string why;
  if (!options.IsValid(&why)) throw Error("merge: " + why);
  return Merge(sweep, calibration, options).Run();
}

}  // namespace thicklens::calib

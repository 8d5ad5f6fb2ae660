#include "calib/registration/scale_tracking.h"

#include <algorithm>
#include <cmath>

#include "calib/registration/blur_field.h"
#include "calib/registration/coarse_registration.h"
#include "calib/registration/radial_distortion.h"
#include "calib/registration/registration.h"
#include "calib/registration/shift_registration.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

constexpr double kSmallestScale = 0.1, kLargestScale = 10;
constexpr std::size_t kFirstWave = 4;
constexpr std::size_t kEnoughToLearn = 5;
constexpr double kNearlyAll = 0.8;  // share of the frames that must be registered again
// The steps of the ladder are half of the range within which a registration converges.
constexpr double kRung = 1.1;
constexpr int kRungs = 12;  // rungs up, and as many down: 1.1^12 = 3.1
constexpr std::ptrdiff_t kTriedRungs = 4;
constexpr int kRoundsWithBlur = 2;
// Maximum relative change of the image height at the corner that is expected of a lens.
constexpr double kLikelyDistortion = 0.02;

// Predicts the scale at a reading: 1/scale is a straight line. The line is fitted by medians to the
// frames registered so far, so that neither a wrong reading (including that of the reference) nor a
// failed registration moves it.
class ScalePrediction {
 public:
  ScalePrediction(const FocusSweep& sweep, std::size_t reference,
                  std::optional<double> known_offset_mm) {
    const double reading_mm = sweep.frames[reference].reading_mm;
    const double sign = model::DirectionSign(sweep.direction);
    const double depth_mm = known_offset_mm ? *known_offset_mm + sign * reading_mm : 0;
    if (depth_mm > 0) slope_ = sign / depth_mm;
    intercept_ = 1 - slope_ * reading_mm;
    is_known_ = depth_mm > 0;
  }

  double At(double reading_mm) const {
    const double inverse = intercept_ + slope_ * reading_mm;
    return std::clamp(inverse > 0 ? 1 / inverse : kLargestScale, kSmallestScale, kLargestScale);
  }

  void Learn(const std::vector<ScaleSample>& samples) {
    if (samples.size() < (is_known_ ? kEnoughToLearn : 2)) return;
    std::vector<double> slopes;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        const double step_mm = samples[i].reading_mm - samples[j].reading_mm;
        if (step_mm != 0) slopes.push_back((1 / samples[i].scale - 1 / samples[j].scale) / step_mm);
      }
    }
    if (slopes.empty()) return;
    slope_ = Median(slopes);
    std::vector<double> intercepts;
    for (const ScaleSample& s : samples) intercepts.push_back(1 / s.scale - slope_ * s.reading_mm);
    intercept_ = Median(intercepts);
  }

 private:
  double slope_ = 0, intercept_ = 1;  // line of 1/scale against the reading
  bool is_known_ = false;
};

// Starts from the expected scale, then from the scales of a ladder at which the phases agree best.
std::optional<FreeRegistration> RegisterAnyhow(const cv::Mat& reference, const cv::Mat& frame,
                                               double expected, cv::Point2d centre) {
  if (auto found = RegisterFreely(reference, frame, expected, centre)) return found;
  std::vector<std::pair<double, double>> starts;  // agreement, scale
  for (int rung = -kRungs; rung <= kRungs; ++rung) {
    const double scale = std::pow(kRung, rung);
    if (std::abs(std::log(scale / expected)) < 0.3 * std::log(kRung)) continue;
    starts.emplace_back(CoarseAgreement(reference, frame, scale, centre), scale);
  }
  const auto tried = std::min(kTriedRungs, static_cast<std::ptrdiff_t>(starts.size()));
  std::partial_sort(starts.begin(), starts.begin() + tried, starts.end(), std::greater<>());
  for (auto start = starts.begin(); start != starts.begin() + tried; ++start) {
    if (auto found = RegisterFreely(reference, frame, start->second, centre)) return found;
  }
  return std::nullopt;
}

// Takes the scales from the readings and measures the shifts. Returns only the reference where the
// depths are not known.
std::vector<ScaleSample> TrackShifts(const FocusSweep& sweep,
                                     const std::function<cv::Mat(std::size_t)>& read_grey,
                                     const std::vector<std::size_t>& frames, std::size_t reference,
                                     std::optional<double> known_offset_mm, int threads,
                                     const std::function<void()>& tick) {
  const auto depth_mm = [&](std::size_t frame) {  // without an offset no frame has a depth
    return known_offset_mm.value_or(-1e300) +
           model::DirectionSign(sweep.direction) * sweep.frames[frame].reading_mm;
  };
  const cv::Mat reference_grey = read_grey(reference);
  std::vector<std::optional<Registration>> found(frames.size());
  ParallelFor(static_cast<int>(frames.size()), threads, [&](int i) {
    const auto index = static_cast<std::size_t>(i);
    if (frames[index] == reference) return;
    const double scale = depth_mm(reference) / depth_mm(frames[index]);
    if (depth_mm(reference) > 0 && scale >= kSmallestScale && scale <= kLargestScale) {
      found[index] =
          RegisterShift(reference_grey, read_grey(frames[index]), scale, RegionCentre(sweep));
    }
    tick();
  });
  std::vector<ScaleSample> samples = {
      {reference, sweep.frames[reference].reading_mm, 1.0, {}, true}};
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (!found[i]) continue;
    samples.push_back(
        {frames[i], sweep.frames[frames[i]].reading_mm, found[i]->scale, *found[i], true});
  }
  return samples;
}

std::vector<BlurOverField> BlursOf(const std::vector<FreeRegistration>& registrations) {
  std::vector<BlurOverField> blurs;
  for (const FreeRegistration& registration : registrations) blurs.push_back(registration.blur);
  return blurs;
}

// Factors of a field that was not taken out.
BlurField AsErrors(const BlurField& factors) {
  const auto error = [](const model::Estimate& factor) {
    return model::Estimate{0, std::hypot(factor.value, factor.sigma)};
  };
  return {error(factors.curvature), error(factors.astigmatism)};
}

// A factor with what registrations with it show beyond it, whose error is that of the sum.
model::Estimate Plus(const model::Estimate& factor, const model::Estimate& left) {
  return {factor.value + left.value, left.sigma};
}

struct FrameReader {
  const cv::Mat& reference;
  const std::function<cv::Mat(std::size_t)>& read_grey;
  int threads;
};

// A blur that changes over the field displaces the detail of each texture in its own way, by an
// amount that is in proportion to the change of scale. All frames share these displacements, so
// that they look like another law of the scale, or like a distortion. Where the frames show such a
// field, they are registered again with a reference that is blurred in the same way: the law of the
// blur over the field comes from all frames, and what it leaves is added to it after each round.
// Frames that do not fit are left out, unless they are many.
void TakeOutStretchByBlur(double corner_px, const FrameReader& reader,
                          std::vector<FreeRegistration> registrations,
                          std::vector<ScaleSample>* samples) {
  const auto shown = BlurPerScale(BlursOf(registrations), *samples);
  if (!shown) return;
  BlurField factors = SeenFactors(*shown);
  std::vector<double> before;
  const auto is_seen = [&] {
    return factors.curvature.value != 0 || factors.astigmatism.value != 0;
  };
  for (int round = 0; round < kRoundsWithBlur && is_seen(); ++round) {
    std::vector<std::optional<FreeRegistration>> found(samples->size());
    ParallelFor(static_cast<int>(samples->size()), reader.threads, [&](int i) {
      const auto index = static_cast<std::size_t>(i);
      const double change = (*samples)[index].scale - 1;
      if (change == 0) return;
      found[index] = RegisterWithBlur(
          reader.reference, reader.read_grey((*samples)[index].frame), registrations[index],
          {factors.curvature.value * change, factors.astigmatism.value * change});
    });
    std::vector<FreeRegistration> again;
    std::vector<ScaleSample> kept;
    std::vector<double> kept_before;
    for (std::size_t i = 0; i < samples->size(); ++i) {
      ScaleSample sample = (*samples)[i];
      const double first = before.empty() ? sample.scale : before[i];
      if (sample.scale != 1) {
        if (!found[i]) continue;
        sample.registration = found[i]->WithCubic(0, 0);
        sample.scale = sample.registration.scale;
      }
      again.push_back(found[i].value_or(registrations[i]));
      kept.push_back(sample);
      kept_before.push_back(first);
    }
    // A law of the scale by a few frames is worse than one with an error for the stretch.
    const bool are_enough =
        kept.size() >= kEnoughToLearn &&
        static_cast<double>(kept.size()) >= kNearlyAll * static_cast<double>(samples->size());
    if (!are_enough) {
      if (before.empty()) factors = AsErrors(factors);  // nothing was taken out
      break;
    }
    registrations = std::move(again);
    *samples = std::move(kept);
    before = std::move(kept_before);
    TakeOutDistortion(corner_px, registrations, samples);
    const auto left = BlurPerScale(BlursOf(registrations), *samples);
    if (!left) break;
    factors = SeenFactors(
        {Plus(factors.curvature, left->curvature), Plus(factors.astigmatism, left->astigmatism)});
  }
  StateStretchByBlur(factors, BlursOf(registrations), before, samples);
}

}  // namespace

cv::Point2d RegionCentre(const FocusSweep& sweep) {
  const Eigen::Vector2d& axis = sweep.camera.sensor.principal_point_px;
  return {axis.x() - sweep.roi.x, axis.y() - sweep.roi.y};
}

double RegionCornerRadiusPx(const FocusSweep& sweep) {
  const cv::Point2d centre = RegionCentre(sweep);
  const bool is_whole = !(sweep.roi.width > 0);
  const double right = (is_whole ? sweep.camera.sensor.width_px : sweep.roi.width) - 1;
  const double bottom = (is_whole ? sweep.camera.sensor.height_px : sweep.roi.height) - 1;
  return std::hypot(std::max(centre.x, right - centre.x), std::max(centre.y, bottom - centre.y));
}

double PartOfDistortion(double corner_px, double sigma) {
  const double likely = kLikelyDistortion / (corner_px * corner_px);
  return likely * likely / (likely * likely + sigma * sigma);
}

void TakeOutDistortion(double corner_px, const std::vector<FreeRegistration>& registrations,
                       std::vector<ScaleSample>* samples) {
  const double likely = kLikelyDistortion / (corner_px * corner_px);
  double k = 0, variance = likely * likely;
  if (const auto fitted = FitRadialDistortion(*samples)) {
    // The fitted value is weighted against the expectation of no distortion.
    const double part = PartOfDistortion(corner_px, fitted->sigma);
    k = part * fitted->value;
    variance = part * fitted->sigma * fitted->sigma;
  }
  for (std::size_t i = 0; i < samples->size(); ++i) {
    ScaleSample& sample = (*samples)[i];
    const double response = CubicPerDistortion(sample.scale);
    sample.registration = registrations[i].WithCubic(
        k * response,
        std::min(std::sqrt(variance) * std::abs(response), registrations[i].free.cubic_sigma));
    sample.scale = sample.registration.scale;
  }
}

std::vector<ScaleSample> TrackScale(const FocusSweep& sweep,
                                    const std::function<cv::Mat(std::size_t)>& read_grey,
                                    const std::vector<std::size_t>& frames, std::size_t reference,
                                    std::optional<double> known_offset_mm, int threads,
                                    const std::function<void()>& tick) {
  const cv::Mat reference_grey = read_grey(reference);
  if (sweep.target != model::SweepTarget::kKnifeEdge && IsScaleInvariant(reference_grey))
    return TrackShifts(sweep, read_grey, frames, reference, known_offset_mm, threads, tick);
  const cv::Point2d centre = RegionCentre(sweep);
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

  std::vector<ScaleSample> samples = {{reference, reference_reading_mm, 1.0, {}, false}};
  std::vector<FreeRegistration> registrations(1);
  ScalePrediction prediction(sweep, reference, known_offset_mm);
  std::size_t done = 0;
  // The waves double in size. Within a wave, every start comes from the law of the previous waves.
  while (done < order.size()) {
    const std::size_t count = std::min(std::max(kFirstWave, done), order.size() - done);
    std::vector<std::optional<FreeRegistration>> found(count);
    ParallelFor(static_cast<int>(count), threads, [&](int i) {
      const std::size_t frame = order[done + static_cast<std::size_t>(i)];
      found[static_cast<std::size_t>(i)] = RegisterAnyhow(
          reference_grey, read_grey(frame), prediction.At(sweep.frames[frame].reading_mm), centre);
      tick();
    });
    for (std::size_t i = 0; i < count; ++i) {
      if (!found[i]) continue;
      const std::size_t frame = order[done + i];
      const Registration alone = found[i]->WithCubic(0, 0);
      samples.push_back({frame, sweep.frames[frame].reading_mm, alone.scale, alone, false});
      registrations.push_back(*found[i]);
    }
    prediction.Learn(samples);
    done += count;
  }
  const double corner_px = RegionCornerRadiusPx(sweep);
  TakeOutDistortion(corner_px, registrations, &samples);
  TakeOutStretchByBlur(corner_px, {reference_grey, read_grey, threads}, registrations, &samples);
  return samples;
}

}  // namespace thicklens::calib

#include "calib/calibrate/fixed_pattern.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "calib/registration/frame_shading.h"
#include "calib/registration/sensor_defects.h"

namespace thicklens::calib {
namespace {

// Specks of simulated sweeps were found to within 0.3 of their amplitude where the registrations
// were right.
constexpr double kMinRemainder = 0.3, kMaxRemainder = 1;
constexpr double kLogOfOpaque = -1.2;  // ln 0.3, up to which specks are divided out

// Adds to what is removed from the light of every frame.
void AddToCorrection(const FixedPatternRemoval& more, FrameStore* store) {
  const FixedPatternRemoval* before = store->correction();
  store->SetCorrection(before == nullptr ? more : before->With(more));
}

// Returns whether the shading is removed.
bool RemoveShading(const FramePlaces& places, const FrameShading& shading, FrameStore* store,
                   FixedPattern* pattern) {
  if (!shading.done || !shading.is_significant) return false;
  pattern->shading_removed = true;
  const cv::Size size = places.read_grey(places.used.front()).size();
  AddToCorrection({LogOfShading(shading, size), cv::Mat()}, store);
  return true;
}

// Power of ln of the light that passes. Filled pixels are opaque, or nearly so.
double PowerOf(const SensorDefects& defects) {
  return cv::norm(defects.log_gain, cv::NORM_L2SQR) +
         kLogOfOpaque * kLogOfOpaque * cv::countNonZero(defects.filled);
}

void Describe(const SensorDefects& defects, FixedPattern* pattern) {
  pattern->specks = defects.specks;
  pattern->deepest_speck = defects.deepest_speck;
  pattern->defective_px = defects.defective_px;
  pattern->divided_share = defects.divided_share;
  pattern->filled_share = defects.filled_share;
  pattern->column_deviation = defects.column_deviation;
  pattern->row_deviation = defects.row_deviation;
}

}  // namespace

RemovedPattern FindFixedPattern(const FramePlaces& places, std::size_t reference,
                                const std::vector<double>& sharpness, bool with_shading,
                                int threads, FrameStore* store, FixedPattern* pattern,
                                RemovedDefects* defects) {
  RemovedPattern removed;
  if (with_shading) {
    const FrameShading shading = MeasureShading(places, threads);
    pattern->measured = shading.done;
    pattern->message = shading.message;
    pattern->corner_stops = shading.corner_stops;
    removed.shading = RemoveShading(places, shading, store, pattern);
  }
  SensorDefects& found = defects->all;
  found = FindSensorDefects(places, reference, sharpness, threads);
  pattern->measured |= found.done;
  if (!found.Any()) return removed;
  Describe(found, pattern);
  AddToCorrection({found.log_gain, found.filled}, store);
  removed.defects = true;
  return removed;
}

RemovedPattern FindRemainingPattern(const FramePlaces& places, std::size_t reference,
                                    const std::vector<double>& sharpness, bool with_shading,
                                    int threads, FrameStore* store, FixedPattern* pattern,
                                    RemovedDefects* defects) {
  RemovedPattern removed;
  if (with_shading) {
    const FrameShading shading = MeasureShading(places, threads);
    const bool had_shading = pattern->shading_removed;
    removed.shading = RemoveShading(places, shading, store, pattern);
    if (removed.shading && had_shading) {
      pattern->corner_stops->value += shading.corner_stops->value;
      pattern->corner_stops->sigma = shading.corner_stops->sigma;
    } else if (removed.shading) {
      pattern->corner_stops = shading.corner_stops;
    }
  }
  if (!defects->all.Any()) return removed;
  const SensorDefects more = FindSensorDefects(places, reference, sharpness, threads);
  defects->remainder = kMinRemainder;
  if (!more.done || !more.Any()) return removed;
  const double before = PowerOf(defects->all);
  const cv::Mat filled_before = defects->all.filled;
  defects->all = WithMore(defects->all, more);
  const double all = PowerOf(defects->all);
  SensorDefects fresh = more;
  fresh.filled = more.filled & (filled_before == 0);
  if (all > 0) {
    defects->remainder =
        std::clamp(std::sqrt(PowerOf(fresh) / std::max(all, before)), kMinRemainder, kMaxRemainder);
  }
  Describe(defects->all, pattern);
  AddToCorrection({more.log_gain, more.filled}, store);
  removed.defects = true;
  return removed;
}

void AddErrorOfShading(const FixedPattern& pattern, const ScaleModel& before, ScaleModel* law) {
  if (!pattern.shading_removed || !law->done || !before.done) return;
  const double part =
      std::min(1.0, pattern.corner_stops->sigma / std::abs(pattern.corner_stops->value));
  law->offset_mm.sigma =
      std::hypot(law->offset_mm.sigma, part * (law->offset_mm.value - before.offset_mm.value));
}

void AddErrorOfDefects(const RemovedDefects& defects, const ScaleModel& before, ScaleModel* law) {
  if (!defects.all.Any() || !law->done || !before.done) return;
  law->offset_mm.sigma = std::hypot(
      law->offset_mm.sigma, defects.remainder * (law->offset_mm.value - before.offset_mm.value));
}

}  // namespace thicklens::calib

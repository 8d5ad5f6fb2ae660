#include "calib/calibrate/fixed_pattern.h"

#include <algorithm>
#include <cmath>

#include "calib/registration/frame_shading.h"
#include "calib/registration/sensor_defects.h"

namespace thicklens::calib {
namespace {

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

}  // namespace

bool FindFixedPattern(const FramePlaces& places, std::size_t reference,
                      const std::vector<double>& sharpness, int threads, FrameStore* store,
                      FixedPattern* pattern) {
  const FrameShading shading = MeasureShading(places, threads);
  pattern->measured = shading.done;
  pattern->message = shading.message;
  pattern->corner_stops = shading.corner_stops;
  const bool shades = RemoveShading(places, shading, store, pattern);
  const SensorDefects defects = FindSensorDefects(places, reference, sharpness, threads);
  pattern->measured |= defects.done;
  if (!defects.Any()) return shades;
  pattern->specks = defects.specks;
  pattern->deepest_speck = defects.deepest_speck;
  pattern->defective_px = defects.defective_px;
  pattern->divided_share = defects.divided_share;
  pattern->filled_share = defects.filled_share;
  pattern->column_deviation = defects.column_deviation;
  pattern->row_deviation = defects.row_deviation;
  AddToCorrection({defects.log_gain, defects.filled}, store);
  return true;
}

bool FindRemainingShading(const FramePlaces& places, int threads, FrameStore* store,
                          FixedPattern* pattern) {
  const FrameShading shading = MeasureShading(places, threads);
  if (!RemoveShading(places, shading, store, pattern)) return false;
  pattern->corner_stops->value += shading.corner_stops->value;
  pattern->corner_stops->sigma = shading.corner_stops->sigma;
  return true;
}

void AddErrorOfShading(const FixedPattern& pattern, const ScaleModel& before, ScaleModel* law) {
  if (!pattern.shading_removed || !law->done || !before.done) return;
  const double part =
      std::min(1.0, pattern.corner_stops->sigma / std::abs(pattern.corner_stops->value));
  law->offset_mm.sigma =
      std::hypot(law->offset_mm.sigma, part * (law->offset_mm.value - before.offset_mm.value));
}

}  // namespace thicklens::calib

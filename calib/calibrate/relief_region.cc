#include "calib/calibrate/relief_region.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "calib/calibrate/recognised_target.h"
#include "calib/calibrate/target_calibration.h"
#include "calib/registration/scale_tracking.h"
#include "calib/sharpness/zone_focus.h"
#include "calib/sweep/frame_selection.h"
#include "calib/sweep/frame_store.h"
#include "calib/uncertainty/relief_parts.h"
#include "thicklens/base/error.h"

namespace thicklens::calib {
namespace {

constexpr double kSmallestSidePx = 64;  // of a rectangle that is measured alone
constexpr double kMaxLost = 0.5;        // of its sides, to the parts that move into it
constexpr double kMinShare = 0.02;      // of the region of interest
constexpr double kBlurReach = 2;        // blurs, by which the light of another part reaches

// Frames with their image scale. A frame that was not registered has the scale of the nearest
// reading that was.
std::vector<ZoneFrame> FramesOf(const Calibration& found, bool with_rejected) {
  std::vector<ZoneFrame> frames;
  for (std::size_t i = 0; i < found.frames.size(); ++i) {
    const FrameMeasurement& frame = found.frames[i];
    if (!(frame.statistics.mean_linear > 0)) continue;
    if (!with_rejected && !frame.rejection.empty()) continue;
    ZoneFrame entry{i, frame.reading_mm, 1};
    double nearest_mm = -1;
    for (const FrameMeasurement& other : found.frames) {
      if (!other.image_scale) continue;
      const double apart_mm = std::abs(other.reading_mm - frame.reading_mm);
      if (nearest_mm >= 0 && apart_mm >= nearest_mm) continue;
      nearest_mm = apart_mm;
      entry.scale = *other.image_scale;
    }
    frames.push_back(entry);
  }
  return frames;
}

double StepMm(const std::vector<ZoneFrame>& frames) {
  const auto [low, high] = std::minmax_element(
      frames.begin(), frames.end(),
      [](const ZoneFrame& a, const ZoneFrame& b) { return a.reading_mm < b.reading_mm; });
  return (high->reading_mm - low->reading_mm) / static_cast<double>(frames.size() - 1);
}

// Whether the target has detail in all zones, as it is stated or as its frames are recognised.
// Points and a lone edge come into focus in some zones alone.
bool IsPattern(const FocusSweep& sweep, const Calibration& found, FrameStore* store) {
  FocusSweep recognised = sweep;
  Calibration told;
  told.frames = found.frames;
  RecogniseTarget([store](std::size_t frame) { return store->Grey(frame); }, &recognised, &told);
  return recognised.target == model::SweepTarget::kAuto ||
         recognised.target == model::SweepTarget::kTexture;
}

// The pixels that show only the rectangle in every frame.
cv::Rect2d SeenByAll(const cv::Rect2d& rectangle, const std::vector<ZoneFrame>& frames,
                     const cv::Point2d& centre_px) {
  cv::Rect2d seen = rectangle;
  for (const ZoneFrame& frame : frames) {
    const cv::Point2d first = centre_px + frame.scale * (rectangle.tl() - centre_px);
    const cv::Point2d last = centre_px + frame.scale * (rectangle.br() - centre_px);
    seen &= cv::Rect2d(first, last);
  }
  return seen;
}

// The frame's own borders end no part.
cv::Rect2d WithoutSeams(const cv::Rect2d& rectangle, double margin_px, cv::Size image) {
  const double left = rectangle.x > 0 ? margin_px : 0;
  const double top = rectangle.y > 0 ? margin_px : 0;
  const double right = rectangle.x + rectangle.width < image.width - 0.5 ? margin_px : 0;
  const double bottom = rectangle.y + rectangle.height < image.height - 0.5 ? margin_px : 0;
  return {rectangle.x + left, rectangle.y + top, rectangle.width - left - right,
          rectangle.height - top - bottom};
}

// The blur of the frame in the middle between the sharpest and the most blurred one, px.
double TypicalBlurPx(const Calibration& found) {
  double most_px = 0;
  for (const FrameMeasurement& frame : found.frames)
    most_px = std::max(most_px, frame.source_blur_sigma_px);
  return 0.5 * most_px;
}

// A reason is one line: " / " stands between the rows of a map.
std::string InOneLine(const std::string& map) {
  std::string line;
  for (std::size_t i = 0; i < map.size(); ++i) {
    if (map[i] != '\n') {
      line += map[i];
    } else if (i + 1 < map.size()) {
      line += " / ";
    }
  }
  return line;
}

// Takes back what the calibration says of focus and of the bench offset: its frames are no target
// at one depth.
void Forget(const FocusSweep& sweep, Calibration* found) {
  constexpr char kHasRelief[] = "the target has relief";
  CalibrationSummary& summary = found->summary;
  summary.image_distance_mm.reset();
  summary.focus_depth_mm.reset();
  summary.blur_ratio.reset();
  summary.blur_floor_px.reset();
  summary.chi2_per_dof = 0;
  CalibrationDiagnostics& diagnostics = found->diagnostics;
  diagnostics.magnification_at_focus.reset();
  diagnostics.focus_reading_mm.reset();
  diagnostics.blur_slope_px_per_mm.reset();
  diagnostics.covariance_order.clear();
  diagnostics.covariance.resize(0, 0);
  diagnostics.systematic_parts.clear();
  diagnostics.advice.clear();
  diagnostics.blur = {};
  diagnostics.nearer = diagnostics.farther = {};
  diagnostics.field = {};
  for (std::string* message : {&diagnostics.blur.message, &diagnostics.nearer.message,
                               &diagnostics.farther.message, &diagnostics.field.message})
    *message = kHasRelief;
  diagnostics.channels.clear();
  if (sweep.offset_mm) return;
  summary.bench_offset_mm.reset();
  diagnostics.bench_offset_from.clear();
  diagnostics.paper_recipe = {};
  diagnostics.sharpness = {};
  diagnostics.paper_recipe.message = diagnostics.sharpness.message = kHasRelief;
  for (FrameMeasurement& frame : found->frames) frame.depth_mm = 0;
}

Calibration Refused(const FocusSweep& sweep, Calibration found, const std::string& why) {
  CalibrationSummary& summary = found.summary;
  summary.outcome = Outcome::kRefused;
  summary.reason = fmt::format(
      "the target has relief: zones of the field are sharpest at different readings ({}); {}; take "
      "a flat target, or state roi_px with one depth. Rows of the map of the zones: {}",
      PartsInWords(found.diagnostics.target.relief), why,
      InOneLine(found.diagnostics.target.ReliefMap()));
  Forget(sweep, &found);
  return found;
}

}  // namespace

Calibration WithoutRelief(const FocusSweep& sweep, const CalibrationOptions& options,
                          Calibration found,
                          const std::function<Calibration(const FocusSweep&)>& run) {
  const bool was_refused = found.summary.outcome == Outcome::kRefused;
  const std::vector<ZoneFrame> frames = FramesOf(found, was_refused);
  ReliefFinding& relief = found.diagnostics.target.relief;
  if (!options.fit_blur || frames.size() < kMinFrames) return found;
  FrameStore store(sweep);
  if (!IsPattern(sweep, found, &store)) return found;
  const auto steps = static_cast<int>(sweep.frames.size());
  std::mutex mutex;
  int done = (kStagesOfProgress - 1) * steps;  // this is the last stage
  const auto read_grey = [&](std::size_t frame) {
    if (options.progress) {
      const std::lock_guard<std::mutex> lock(mutex);
      options.progress(std::min(++done, kStagesOfProgress * steps), kStagesOfProgress * steps);
    }
    return store.Grey(frame);
  };
  const ZoneFocus zones = FindZoneFocus({read_grey, frames, RegionCentre(sweep), options.threads});
  relief.columns = zones.columns;
  relief.rows = zones.rows;
  relief.sharpest_mm = zones.sharpest_mm;
  DivideByDepth(StepMm(frames), model::DirectionSign(sweep.direction), &relief);
  if (!relief.is_relief) return found;
  int part = 0;
  const cv::Rect rectangle = LargestRectangle(relief, &part);
  MakeFirst(part, &relief);
  const cv::Size size = store.Grey(frames.front().frame).size();
  const cv::Rect2d whole = zones.Pixels(rectangle, size);
  const cv::Rect2d seen = WithoutSeams(SeenByAll(whole, frames, RegionCentre(sweep)),
                                       kBlurReach * TypicalBlurPx(found), size);
  const double share = seen.area() / (static_cast<double>(size.width) * size.height);
  if (!(std::min(seen.width, seen.height) >= kSmallestSidePx) || !(share >= kMinShare) ||
      !(seen.area() >= kMaxLost * kMaxLost * whole.area())) {
    return Refused(sweep, std::move(found),
                   fmt::format("no rectangle of at least {:.0f} x {:.0f} px is at one depth in all "
                               "frames",
                               sweep.sensor_px_per_px * kSmallestSidePx,
                               sweep.sensor_px_per_px * kSmallestSidePx));
  }
  FocusSweep part_of_it = sweep;
  part_of_it.roi = {sweep.roi.x + static_cast<int>(std::ceil(seen.x)),
                    sweep.roi.y + static_cast<int>(std::ceil(seen.y)),
                    static_cast<int>(std::floor(seen.width)) - 1,
                    static_cast<int>(std::floor(seen.height)) - 1};
  // The size of the grid is that at the depth of its own place, which may be another part.
  part_of_it.grid_scales.clear();
  Calibration again = run(part_of_it);
  const std::string words = PartsInWords(relief);
  const int px = sweep.sensor_px_per_px;
  const std::string region =
      fmt::format("roi_px [{}, {}, {}, {}]", px * part_of_it.roi.x, px * part_of_it.roi.y,
                  px * part_of_it.roi.width, px * part_of_it.roi.height);
  if (again.summary.outcome == Outcome::kRefused) {
    return Refused(sweep, std::move(found),
                   fmt::format("the largest part at one depth, {}, does not suffice: {}", region,
                               again.summary.reason));
  }
  again.diagnostics.target.relief = relief;
  again.diagnostics.target.relief.region = part_of_it.roi;
  again.diagnostics.target.relief.region_share = share;
  again.summary.seconds += found.summary.seconds;
  again.summary.warnings.insert(
      again.summary.warnings.begin(),
      fmt::format("the target has relief; everything is measured on its largest part at one depth, "
                  "{}, {:.0f} % of the region ({})",
                  region, 100 * share, words));
  return again;
}

}  // namespace thicklens::calib

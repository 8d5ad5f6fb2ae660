#ifndef THICKLENS_CALIB_SWEEP_FRAME_SELECTION_H_
#define THICKLENS_CALIB_SWEEP_FRAME_SELECTION_H_

#include <cstddef>
#include <functional>
#include <opencv2/core/types.hpp>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/frame_checks.h"

namespace thicklens::calib {

inline constexpr std::size_t kMinFrames = 5;
// Edge pixels of the sharpness index have gradients above this part of the sweep's steepest.
inline constexpr double kEdgeThreshold = 0.25;

// Returns the file's name as in the table of readings, without its directory on this machine.
std::string FileName(const std::string& image);

// A reading of the sweep, and the difference of two, as messages show them: with `digits` behind
// the point in mm, otherwise in the unit that was written (FocusSweep::shown_reading).
std::string ReadingInWords(const FocusSweep& sweep, double reading_mm, int digits);
std::string ReadingErrorInWords(const FocusSweep& sweep, double written_mm, double right_mm,
                                int digits);
// A reading as messages show it, with up to six significant digits in mm.
std::string ReadingInWords(const FocusSweep& sweep, double reading_mm);

// The frames of a sweep that are in use; the quality checks reject others one after the other.
class FrameSelection {
 public:
  // All frames are in use at first. `frames` must outlive this object.
  explicit FrameSelection(std::vector<FrameMeasurement>* frames);

  const std::vector<std::size_t>& used() const { return used_; }

  // Each Keep function sets the `rejection` of the used frames that it rejects. It returns the
  // reason for a refusal if too few are left.

  // Applies the absolute checks on the levels, then the blank quality check against the median of
  // the frames that passed them.
  std::optional<std::string> KeepMeasurable(const QualityCheckOptions& checks);
  // Rejects frames with hardly any edge, little contrast and no clear texture: they do not show the
  // target any more, but shading alone passes the quality checks of contrast and gradient.
  std::optional<std::string> KeepThoseWithEdges();
  // Rejects frames nearer than the front focal point. No image of the target forms there: such a
  // frame shows another object, or the lens rests on the target.
  std::optional<std::string> KeepPossibleDepths(double bench_offset_mm,
                                                double front_focal_length_mm);
  // Removes the frames whose `rejection` was set elsewhere.
  std::optional<std::string> KeepUnrejected();

 private:
  template <typename Reason>
  std::optional<std::string> KeepOnly(const Reason& reason);
  std::string TooFewUsable(std::size_t distinct_readings) const;

  std::vector<FrameMeasurement>& frames_;
  std::vector<std::size_t> used_;
};

// Advice about the light where it caused the rejection of most of the frames: "39 of 41 frames are
// over-exposed: lower the exposure ...". Any other fault is then a consequence. The advice is empty
// where the light was not at fault. Dark images with a clear texture are not simply under-exposed
// where their files have 16 bits (`have_16_bits` is called only then): values of 10 or 12 bits look
// the same.
std::string ExposureAdvice(const std::vector<FrameMeasurement>& frames,
                           const std::function<bool()>& have_16_bits);

// Nothing can be measured in a region whose shorter side is less than this.
inline constexpr int kSmallestRegionPx = 24;
// The size of the part of the frames that is measured, px.
cv::Size RegionSize(const FocusSweep& sweep);
// The shorter side of it, px.
int RegionSidePx(const FocusSweep& sweep);
// The region's size and the required size, if the region is too small for some of the targets;
// otherwise empty.
std::string RegionAdvice(const FocusSweep& sweep);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SWEEP_FRAME_SELECTION_H_

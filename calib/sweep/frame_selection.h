#ifndef THICKLENS_CALIB_SWEEP_FRAME_SELECTION_H_
#define THICKLENS_CALIB_SWEEP_FRAME_SELECTION_H_

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/frame_gates.h"

namespace thicklens::calib {

inline constexpr std::size_t kFewestFrames = 5;
// Edge pixels of the sharpness index: gradients above this part of the sweep's steepest.
inline constexpr double kEdgeThreshold = 0.25;

// Files are named as the table of readings names them, not by where they lie on this machine.
std::string FileName(const std::string& image);

// The frames of a sweep, of which one gate after the other throws some out.
class FrameSelection {
 public:
  // All are in use. `frames` must outlive it.
  explicit FrameSelection(std::vector<FrameMeasurement>* frames);

  const std::vector<std::size_t>& used() const { return used_; }

  // Each sets the `rejection` of the used frames that it throws out, and gives the reason for a
  // refusal if too few are left.

  // Absolute gates on the levels, then the blank gate against the median of those that passed.
  std::optional<std::string> KeepMeasurable(const GateOptions& gates);
  // Shading alone passes the gates of contrast and gradient. What has no edge worth the name and
  // little contrast besides does not show the target any more.
  std::optional<std::string> KeepThoseWithEdges();
  // Nearer than the front focal point no image forms: such a frame shows something else, such as
  // the lens resting on the target.
  std::optional<std::string> KeepPossibleDepths(double bench_offset_mm,
                                                double front_focal_length_mm);
  // Leaves out those whose `rejection` was set by others.
  std::optional<std::string> KeepUnrejected();

 private:
  template <typename Reason>
  std::optional<std::string> KeepOnly(const Reason& reason);
  std::string TooFewUsable(std::size_t distinct_readings) const;

  std::vector<FrameMeasurement>& frames_;
  std::vector<std::size_t> used_;
};

// What to do about the light where most of the frames were rejected for it: "39 of 41 frames are
// over-exposed: lower the exposure ...". Whatever else went wrong is then a consequence. Empty
// where the light was not at fault. Dark pictures whose texture is clear are not simply
// under-exposed where their files have 16 bits (asked only then): values of 10 or 12 bits look like
// that, too.
std::string ExposureAdvice(const std::vector<FrameMeasurement>& frames,
                           const std::function<bool()>& have_16_bits);

// In a region whose shorter side is less, nothing at all can be measured.
inline constexpr int kSmallestRegionPx = 24;
int RegionSidePx(const FocusSweep& sweep);
// The region's size and what is needed, where it is too small for some of the targets; else empty.
std::string RegionAdvice(const FocusSweep& sweep);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SWEEP_FRAME_SELECTION_H_

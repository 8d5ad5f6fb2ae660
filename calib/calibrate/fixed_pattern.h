#ifndef THICKLENS_CALIB_CALIBRATE_FIXED_PATTERN_H_
#define THICKLENS_CALIB_CALIBRATE_FIXED_PATTERN_H_

#include <cstddef>
#include <vector>

#include "calib/registration/frame_structure.h"
#include "calib/registration/sensor_defects.h"
#include "calib/sweep/frame_store.h"
#include "thicklens/calib/calibration.h"

namespace thicklens::calib {

// The fine structure that was removed.
struct RemovedDefects {
  SensorDefects all;  // the sum of what was found in each round
  // Part of the amplitude of the structure that may be left: what the last round found, over all.
  double remainder = 1;
};

// The parts of the fixed pattern that a round of the search removes from the light of all frames.
struct RemovedPattern {
  bool shading = false;
  bool defects = false;
  bool Any() const { return shading || defects; }
};

// Finds the shading, if `with_shading`, and the fine structure that are fixed to the frame, and
// lets `store` remove them from the light of all frames. Says in `pattern` what was found.
// `sharpness` has an index for each frame of the sweep. `defects` gets the fine structure.
RemovedPattern FindFixedPattern(const FramePlaces& places, std::size_t reference,
                                const std::vector<double>& sharpness, bool with_shading,
                                int threads, FrameStore* store, FixedPattern* pattern,
                                RemovedDefects* defects);

// Finds what is left of a strong shading, or of fine structure, once its removal has made the
// registrations better: fine structure pulls the scale of blurred frames toward 1 and their blur
// toward 0. Returns what more is removed.
RemovedPattern FindRemainingPattern(const FramePlaces& places, std::size_t reference,
                                    const std::vector<double>& sharpness, bool with_shading,
                                    int threads, FrameStore* store, FixedPattern* pattern,
                                    RemovedDefects* defects);

// Adds the part of the bench offset's error that the error of a removed shading causes: the shift
// of the offset is proportional to the shading. `before` is the law of the scales with the shading.
void AddErrorOfShading(const FixedPattern& pattern, const ScaleModel& before, ScaleModel* law);

// Adds the part that the remainder of the fine structure causes. Such structure is common to all
// frames and pulls their scales toward 1. The shift of the offset is at most proportional to its
// amplitude.
void AddErrorOfDefects(const RemovedDefects& defects, const ScaleModel& before, ScaleModel* law);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATE_FIXED_PATTERN_H_

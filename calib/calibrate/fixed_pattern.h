#ifndef THICKLENS_CALIB_CALIBRATE_FIXED_PATTERN_H_
#define THICKLENS_CALIB_CALIBRATE_FIXED_PATTERN_H_

#include <cstddef>
#include <vector>

#include "calib/registration/frame_structure.h"
#include "calib/sweep/frame_store.h"
#include "thicklens/calib/calibration.h"

namespace thicklens::calib {

// Finds the shading and the fine structure that are fixed to the frame, and lets `store` remove
// them from the light of all frames. Says in `pattern` what was found. `sharpness` has an index for
// each frame of the sweep. Returns whether anything is removed.
bool FindFixedPattern(const FramePlaces& places, std::size_t reference,
                      const std::vector<double>& sharpness, int threads, FrameStore* store,
                      FixedPattern* pattern);

// Finds what is left of a strong shading once its removal has made the scales better. Returns
// whether more is removed.
bool FindRemainingShading(const FramePlaces& places, int threads, FrameStore* store,
                          FixedPattern* pattern);

// Adds the part of the bench offset's error that the error of a removed shading causes: the shift
// of the offset is proportional to the shading. `before` is the law of the scales with the shading.
void AddErrorOfShading(const FixedPattern& pattern, const ScaleModel& before, ScaleModel* law);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATE_FIXED_PATTERN_H_

#ifndef THICKLENS_CALIB_CALIBRATE_LIGHT_CHANGES_H_
#define THICKLENS_CALIB_CALIBRATE_LIGHT_CHANGES_H_

#include <vector>

#include "calib/registration/image_scale.h"
#include "calib/sweep/frame_store.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// Measures how exposure and white balance change between the registered frames, on the part of the
// target that all of them show. A lamp that moves with the camera or with the target changes the
// light as a power of the depth from -2.2 to 0.2; the power in this range that fits best is left
// out of the change of the exposure. The light is the value that the stated transfer gives, to the
// power `exponent`, which is 1 unless the frames contradict that transfer. `frames` has the depths;
// `depths_are_known` is false where nothing determines them. The frames are sampled at 96 x 96
// places.
void MeasureLightChanges(const FocusSweep& sweep, const std::vector<ScaleSample>& samples,
                         const std::vector<FrameMeasurement>& frames, bool depths_are_known,
                         double exponent, FrameStore* store, FrameLight* light);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATE_LIGHT_CHANGES_H_

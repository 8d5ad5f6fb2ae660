#ifndef THICKLENS_CALIB_UNCERTAINTY_FIELD_MAP_H_
#define THICKLENS_CALIB_UNCERTAINTY_FIELD_MAP_H_

#include "calib/fit/blur_measurement.h"
#include "calib/sweep/frame_store.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// The same fit on parts of the field, on the blur along x and along y, and on the colour channels:
// tilt, field curvature, depths of the target, astigmatism, axial colour. All with the readings
// that the whole field's fit believes, so that what the parts share does not blur how they differ.
// Fills `field` and `channels` of the calibration, warns of what one plane of focus does not
// describe and widens the systematic interval by it.
void MapField(const FocusSweep& sweep, const BlurEvidence& evidence, const BlurFitResult& fit,
              FrameStore* store, Calibration* calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_UNCERTAINTY_FIELD_MAP_H_

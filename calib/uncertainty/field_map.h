#ifndef THICKLENS_CALIB_UNCERTAINTY_FIELD_MAP_H_
#define THICKLENS_CALIB_UNCERTAINTY_FIELD_MAP_H_

#include <string>
#include <vector>

#include "calib/fit/blur_measurement.h"
#include "calib/sweep/frame_store.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// Runs the same fit on parts of the field and on the colour channels: tilt, field curvature, depths
// of the target, axial colour. These fits use the readings as the whole field's fit corrected them,
// so that errors that the parts share do not hide their differences. The blur along x and along y
// is measured first (MeasureAstigmatism), with readings of its own. Fills `field` and `channels` of
// the calibration, warns of properties that one plane of focus does not describe, and widens the
// systematic interval by them. The results of a curved field are moved to the axis (MoveFocus),
// unless its plane of focus is stated.
void MapField(const FocusSweep& sweep, const BlurEvidence& evidence, const BlurFitResult& fit,
              FrameStore* store, Calibration* calibration);

// A cheap part of MapField for calibrations without the map: compares nine large zones on at most
// 24 frames. Moves the results, widens the systematic interval and warns as MapField does, so that
// a curved field or a tilted target is not silent, and leaves `field` empty.
void CompareZones(const FocusSweep& sweep, const BlurEvidence& evidence, const BlurFitResult& fit,
                  FrameStore* store, Calibration* calibration);

// The warnings about parts of the field at several depths and about tilt that the field of a
// calibration gives.
std::vector<std::string> FieldWarnings(const Calibration& calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_UNCERTAINTY_FIELD_MAP_H_

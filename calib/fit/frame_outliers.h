#ifndef THICKLENS_CALIB_FIT_FRAME_OUTLIERS_H_
#define THICKLENS_CALIB_FIT_FRAME_OUTLIERS_H_

#include <optional>
#include <string>

#include "calib/fit/blur_measurement.h"

namespace thicklens::calib {

// Removes from the estimators' samples the frames that do not follow the others: their spectrum
// scatters far more, or their blur is far from the law that any target follows. They are named in
// `calibration->frames` by their `rejection`, with the reading's error (the written reading minus
// that of the law, mm) where the law gives one. Returns the reason if too few frames are left for a
// fit.
std::optional<std::string> RejectOutliers(const FocusSweep& sweep, BlurEvidence* evidence,
                                          Calibration* calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_FRAME_OUTLIERS_H_

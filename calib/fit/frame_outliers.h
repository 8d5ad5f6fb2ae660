#ifndef THICKLENS_CALIB_FIT_FRAME_OUTLIERS_H_
#define THICKLENS_CALIB_FIT_FRAME_OUTLIERS_H_

#include <optional>
#include <string>

#include "calib/fit/blur_measurement.h"

namespace thicklens::calib {

// Whether a frame does not show what the others show: its spectrum scatters about the fit far more
// than theirs (`scatter`: ratio in power), and the scatter is a relevant part of its own spectrum
// (`misfit`, RelativeBlur::misfit). Without the second condition a frame with little noise, for
// example a large one, would be rejected for a small error of the blur law.
bool IsDamage(double scatter, double misfit);

// Removes from the estimators' samples the frames that do not follow the others: their spectrum
// scatters far more, or their blur is far from the law that any target follows. They are named in
// `calibration->frames` by their `rejection`, with the reading's error (the written reading minus
// that of the law, mm) where the law gives one. Returns the reason if too few frames are left for a
// fit.
std::optional<std::string> RejectOutliers(const FocusSweep& sweep, BlurEvidence* evidence,
                                          Calibration* calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_FRAME_OUTLIERS_H_

#ifndef THICKLENS_CALIB_FIT_FRAME_OUTLIERS_H_
#define THICKLENS_CALIB_FIT_FRAME_OUTLIERS_H_

#include <optional>
#include <string>

#include "calib/fit/blur_measurement.h"

namespace thicklens::calib {

// Takes out of the meters' samples the frames that do not follow the others: whose spectrum
// scatters far more than theirs, or whose blur lies off the law that any target follows. They are
// named in `calibration->frames` by their `rejection`, with the reading's error (written minus
// believed, mm) where the law tells one. Returns why nothing can be fitted, if too few are left.
std::optional<std::string> ThrowOutFrames(model::BenchDirection direction, BlurEvidence* evidence,
                                          Calibration* calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_FRAME_OUTLIERS_H_

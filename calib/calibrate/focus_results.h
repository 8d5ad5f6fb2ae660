#ifndef THICKLENS_CALIB_CALIBRATE_FOCUS_RESULTS_H_
#define THICKLENS_CALIB_CALIBRATE_FOCUS_RESULTS_H_

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "calib/calibrate/focus_motion.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/model/conjugates.h"

namespace thicklens::calib {

// CalibrationDiagnostics::bench_offset_from where the readings are in dioptres.
inline constexpr char kFromDioptres[] = "the dioptres of the readings";

// The source of xf.
struct FocusOrigin {
  std::string from;  // bench_offset_from
  std::optional<model::StatedConjugate> stated;
  model::Estimate sensor_distance_mm;  // xf by that source, mm from the rear principal plane
  // Interval by which the light distribution over the pupil may move xf, mm.
  Eigen::Vector2d pupil_interval_mm{0, 0};
  std::vector<double> contradicting_mm;  // xf by the sources that contradict it
  std::vector<ComparedFocus> compared;   // all other sources, by their zf
};

// Converts the calibration of the equivalent sweep of a motion to that of the camera: readings, d1,
// zf, magnification, intervals, the field and the frames. `found` may be refused.
void ConvertResults(const FocusSweep& sweep, model::SweepMotion moves, const FocusMotion& motion,
                    const FocusOrigin& origin, Calibration* found);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATE_FOCUS_RESULTS_H_

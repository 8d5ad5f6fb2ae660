#ifndef THICKLENS_CALIB_SRC_CALIBRATION_CHECKS_H_
#define THICKLENS_CALIB_SRC_CALIBRATION_CHECKS_H_

#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "reading_gates.h"
#include "scale_bend.h"
#include "thicklens/calib/calibrate.h"

namespace thicklens::calib {

// What may contradict the results without forbidding them. Each adds its warning, if there is one,
// to the calibration.

// The bench zero that was given against that of the image scale.
void CheckGivenOffset(const FocusSweep& sweep, Calibration* calibration);

void CheckDistortion(Calibration* calibration);

// Readings that go along a curve against the image scale.
std::optional<Bend> CheckBend(const FocusSweep& sweep, const std::vector<ScaleSample>& scales,
                              Calibration* calibration);

// Widens the systematic intervals of a bench zero that came from such a scale, and of the focus
// with it, by half of what the two halves of the sweep differ.
void WidenByBend(const FocusSweep& sweep, const Bend& bend, Calibration* calibration);

// Widens the systematic interval of the focus by the jump.
void CheckSlip(const FocusSweep& sweep, const Slip& slip, Calibration* calibration);

// d1 from the target's period, which must be stated, against d1 from the focus. `grey`: the linear
// light of the frame `reference`.
void CheckMagnification(const FocusSweep& sweep, std::size_t reference, const cv::Mat& grey,
                        Calibration* calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SRC_CALIBRATION_CHECKS_H_

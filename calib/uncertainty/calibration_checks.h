#ifndef THICKLENS_CALIB_UNCERTAINTY_CALIBRATION_CHECKS_H_
#define THICKLENS_CALIB_UNCERTAINTY_CALIBRATION_CHECKS_H_

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calib/fit/blur_fit.h"
#include "calib/registration/reading_gates.h"
#include "calib/registration/scale_bend.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// What may contradict the results without forbidding them. Each adds its warning, if there is one,
// to the calibration.

// The bench zero that was given against that of the image scale: the latter where they contradict
// each other. A refusal where they lie so far apart that one of them is plain wrong.
struct OffsetCheck {
  std::optional<std::string> refusal;
  std::optional<model::Estimate> conflicting_mm;
};
// `unit_that_fits`: what UnitThatFits says.
OffsetCheck CheckGivenOffset(const FocusSweep& sweep, const std::string& unit_that_fits,
                             Calibration* calibration);

// Readings that go along a curve against the image scale.
std::optional<Bend> CheckBend(const FocusSweep& sweep, const std::vector<ScaleSample>& scales,
                              Calibration* calibration);

void WarnOfSlip(const Slip& slip, Calibration* calibration);

// The setups of fits with what else the checks leave possible: the other bench zero; one of the
// sweep's halves' own zero; the readings before or after a jump moved, with the zero that their
// scales then give where none was given.
std::vector<BlurFitSetup> WithOffsets(const BlurFitSetup& setup,
                                      const std::vector<double>& offsets_mm);
std::vector<BlurFitSetup> WithoutSlip(const FocusSweep& sweep, const BlurFitSetup& setup,
                                      const Slip& slip, std::vector<ScaleSample> scales,
                                      std::size_t reference, const Calibration& calibration);

// d1 from the target's period, which must be stated, against d1 from the focus. `grey`: the linear
// light of the frame `reference`.
void CheckMagnification(const FocusSweep& sweep, std::size_t reference, const cv::Mat& grey,
                        Calibration* calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_UNCERTAINTY_CALIBRATION_CHECKS_H_

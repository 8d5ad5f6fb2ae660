#ifndef THICKLENS_CALIB_UNCERTAINTY_CALIBRATION_CHECKS_H_
#define THICKLENS_CALIB_UNCERTAINTY_CALIBRATION_CHECKS_H_

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calib/fit/blur_fit.h"
#include "calib/registration/reading_checks.h"
#include "calib/registration/scale_nonlinearity.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// Checks that may contradict the results without forbidding them. Each adds its warning, if there
// is one, to the calibration.

// The given bench offset compared with that of the image scale: `conflicting_mm` is the latter
// where the two contradict each other. `refusal` is set where they lie so far apart that one of
// them must be wrong.
struct OffsetCheck {
  std::optional<std::string> refusal;
  std::optional<model::Estimate> conflicting_mm;
};
// `unit_that_fits` is the result of UnitThatFits.
OffsetCheck CheckGivenOffset(const FocusSweep& sweep, const std::string& unit_that_fits,
                             Calibration* calibration);

// Finds readings that follow a curve against the image scale.
std::optional<ScaleNonlinearity> CheckScaleNonlinearity(const FocusSweep& sweep,
                                                        const std::vector<ScaleSample>& scales,
                                                        Calibration* calibration);

void WarnOfReadingStep(const FocusSweep& sweep, const ReadingStep& reading_step,
                       Calibration* calibration);

// The setups of fits with the alternatives that the checks leave possible. WithOffsets uses other
// bench offsets, such as that of one half of the sweep. WithoutReadingStep moves the readings
// before or after a jump; where no zero was given, it uses the zero that the scales of the moved
// readings give.
std::vector<BlurFitSetup> WithOffsets(const BlurFitSetup& setup,
                                      const std::vector<double>& offsets_mm);
std::vector<BlurFitSetup> WithoutReadingStep(const FocusSweep& sweep, const BlurFitSetup& setup,
                                             const ReadingStep& reading_step,
                                             std::vector<ScaleSample> scales, std::size_t reference,
                                             const Calibration& calibration);

// The setup with readings that are smaller by `shift_mm`, for each frame of the sweep. `frames` are
// the frames of setup.frames. Where no zero was given, it is the one that the scales of the moved
// readings give.
BlurFitSetup WithShiftedReadings(const FocusSweep& sweep, const BlurFitSetup& setup,
                                 const std::vector<std::size_t>& frames,
                                 const Eigen::VectorXd& shift_mm, std::vector<ScaleSample> scales,
                                 std::size_t reference, const Calibration& calibration);

// Compares d1 from the target's period, which must be stated, with d1 from the focus. `grey` is the
// linear light of the frame `reference`.
void CheckMagnification(const FocusSweep& sweep, std::size_t reference, const cv::Mat& grey,
                        Calibration* calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_UNCERTAINTY_CALIBRATION_CHECKS_H_

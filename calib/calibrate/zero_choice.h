#ifndef THICKLENS_CALIB_CALIBRATE_ZERO_CHOICE_H_
#define THICKLENS_CALIB_CALIBRATE_ZERO_CHOICE_H_

#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "calib/fit/blur_fit.h"
#include "calib/registration/image_scale.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/model/conjugates.h"

namespace thicklens::calib {

// The magnification in the plane of focus from the period of the target in a frame that lies
// `beyond_focus_mm` behind that plane: m = m_frame (zf + beyond)/zf, [D5] with [D127]. Absent if
// the sweep states no period or the frame shows none.
std::optional<model::StatedConjugate> MagnificationOfPeriod(const FocusSweep& sweep,
                                                            const cv::Mat& grey,
                                                            double beyond_focus_mm);

// The statement with the smallest error of zf, FocusDepthWithTolerance; absent if there is none.
std::optional<model::StatedConjugate> MostPrecise(
    const model::Camera& camera, const std::vector<model::StatedConjugate>& statements);

// The zf at which the blur of the registered frames, which grows with the distance from the
// sharpest reading, has a usual blur ratio. Where nothing determines the bench offset, it is a
// depth for which the expected blur is about right. Returns 2 f1 where the registrations show no
// blur.
double UsualFocusDepth(const model::Camera& camera, const std::vector<ScaleSample>& samples,
                       double sharpest_reading_mm);

// A statement, or the image scale, beside the fit.
struct FocusComparison {
  ComparedFocus source;
  std::string text;  // one sentence with both depths if they contradict each other, else empty
};

// Compares a fitted zf with the statements that were not used for it, with a stated bench offset
// that was not used, and with the image scale if a statement was used.
std::vector<FocusComparison> CompareFocus(const FocusSweep& sweep,
                                          const std::vector<model::StatedConjugate>& statements,
                                          const model::Estimate& found_mm,
                                          const Calibration& calibration);

// Compares the fitted zf with the statements that were not used for it, and with the image scale if
// a statement was used. A contradiction of more than three standard deviations is a warning, and
// the intervals of zf, d1, kappa and the bench offset then include the fit at the other depth. All
// comparisons are reported in CalibrationDiagnostics::compared_focus. The
// image scale of an objective is not compared: it shows where the entrance pupil is, which the
// equivalent lens does not describe.
void CompareWithStatements(const FocusSweep& sweep,
                           const std::vector<model::StatedConjugate>& statements,
                           const BlurFitSetup& setup, const BlurFitResult& fit,
                           Calibration* calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATE_ZERO_CHOICE_H_

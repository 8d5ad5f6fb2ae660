#ifndef THICKLENS_CALIB_UNCERTAINTY_SYSTEMATIC_ADVICE_H_
#define THICKLENS_CALIB_UNCERTAINTY_SYSTEMATIC_ADVICE_H_

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calib/fit/blur_fit.h"
#include "calib/fit/known_focus.h"
#include "thicklens/calib/calibration.h"

namespace thicklens::calib {

// Name of the part that another shape of the blur causes. It moves kappa only where the stated
// shape is clearly wrong.
inline constexpr const char* kShapePart = "shape of the blur";

// CalibrationDiagnostics::bench_offset_from where the image scale determines the bench offset.
inline constexpr char kFromScale[] = "the image scale";
// Its value where offset_mm is stated.
inline constexpr char kFromOffset[] = "offset_mm";

// Sorts the parts by their effect and gives the advice: the largest term of the error, statistical
// or systematic (ErrorTerms), and what makes it smaller.
void SortAndAdvise(Calibration* calibration);

// Adds a part to the table and linearly to the intervals of zf, d1 and kappa.
void AddPart(SystematicPart part, Calibration* calibration);

// Adds a part that moves zf by up to `move_mm` in either direction to the table and to the
// intervals of zf and d1. It is added linearly because such errors do not average out.
void WidenFocus(const std::string& name, double move_mm, const std::string& remedy,
                const model::ThickLens& lens, Calibration* calibration);

// Adds a part that moves zf by `focus_moves_mm` and kappa by `ratio_moves` (lowest <= 0 <= highest)
// to the table and linearly to the intervals of zf, d1 and kappa.
void WidenFocusAndRatio(const std::string& name, const Eigen::Vector2d& focus_moves_mm,
                        const Eigen::Vector2d& ratio_moves, const std::string& remedy,
                        const model::ThickLens& lens, Calibration* calibration);

// Adds a part to the table and to the intervals of zf, d1, kappa and the bench offset: the fit is
// repeated with each of `setups` instead of the assumed one, at the known plane of focus if there
// is one.
void WidenByTrials(const std::string& name, const std::string& remedy,
                   const std::vector<BlurFitSetup>& setups, const BlurFitResult& fit,
                   Calibration* calibration,
                   const std::optional<model::StatedConjugate>& known_focus = std::nullopt);

// Adds a part that moves kappa alone, by `moves` (lowest <= 0 <= highest), to the table and
// linearly to the interval of kappa.
void WidenRatio(const std::string& name, const Eigen::Vector2d& moves, const std::string& remedy,
                Calibration* calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_UNCERTAINTY_SYSTEMATIC_ADVICE_H_

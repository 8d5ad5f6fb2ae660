#ifndef THICKLENS_CALIB_FIT_AXIAL_FOCUS_H_
#define THICKLENS_CALIB_FIT_AXIAL_FOCUS_H_

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "calib/fit/blur_fit.h"
#include "calib/spectrum/relative_spectrum.h"

namespace thicklens::calib {

// The plane of focus and the blur ratio of the blur along x (0) and along y (1).
struct AxialFocus {
  bool done = false;                // true if the fit gave a result
  std::string message = "not run";  // how it ended; without a result, the reason
  // zf from Ap, mm. The errors do not include that of the bench offset, which moves both alike.
  std::array<model::Estimate, 2> focus_depth_mm;
  std::array<model::Estimate, 2> blur_ratio;  // kappa, dimensionless
  // zf along x minus zf along y, mm. The readings' errors move both and mostly cancel in it.
  model::Estimate difference_mm;
  double chi2_per_dof = 0;
};

// Fits one blur law along x and one along y to the same frames [D130]. The readings' errors are
// common to both laws and are part of the fit. `setup` has the readings, the bench offset (held)
// and the floor, which must be known; its estimators are not used. `frames` are the samples'
// indices in setup.frames. Frames that deviate from the law of an axis lose weight as in FitBlur.
// The errors are widened where chi^2 per degree of freedom is above 1.
AxialFocus FitAxialFocus(const BlurFitSetup& setup, const std::vector<std::size_t>& frames,
                         const AxialBlur& blur);

// Returns the samples that follow a parabola in depth along both axes, by their indices. The blur
// on the target follows one whatever the lens; the others have wrong readings or are damaged.
std::vector<std::size_t> SamplesOnParabolas(const BlurFitSetup& setup,
                                            const std::vector<std::size_t>& frames,
                                            const AxialBlur& blur);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_AXIAL_FOCUS_H_

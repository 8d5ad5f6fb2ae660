#ifndef THICKLENS_CALIB_SHARPNESS_GRADIENT_ENERGY_H_
#define THICKLENS_CALIB_SHARPNESS_GRADIENT_ENERGY_H_

#include <cstddef>
#include <opencv2/core/mat.hpp>
#include <vector>

namespace thicklens::calib {

// Mean of the squared gradient of a frame, relative to the squared mean of its light, px^-2:
//   E = (mean |grad (G * I)|^2 - n^2 (1 - exp(-1/s^2))/(4 pi s^2))/mean(I)^2   [D180]
// G is a Gaussian with the standard deviation s = 1 px, grad the central differences, and n the
// standard deviation of a pixel's noise, `noise_sigma`, in the unit of the CV_32F frame `grey`, so
// that a flat frame has about 0. Derived here: the power exp(-s^2 w^2) of white noise after G,
// times sin^2 w_x + sin^2 w_y, is integrated over all frequencies.
//   E is a mean over all pixels, and the gradients of the target and of what is fixed to the frame
// (dust, defective pixels) are independent of one another. What is fixed therefore adds the same to
// E of all frames, and E is largest in the sharpest one. The mean edge slope is a mean over the
// edges that a frame shows: in blurred frames, these are the edges of the dust alone.
double GradientEnergy(const cv::Mat& grey, double noise_sigma);

// Returns the sharpest of `frames` (indices of both other lists): the one with the largest slope,
// unless its energy is so far below the largest that its edges do not belong to the target. Then it
// is the one with the largest energy.
std::size_t SharpestFrame(const std::vector<std::size_t>& frames, const std::vector<double>& slopes,
                          const std::vector<double>& energies);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SHARPNESS_GRADIENT_ENERGY_H_

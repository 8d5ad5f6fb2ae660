#ifndef THICKLENS_MODEL_SRC_RAY_SET_H_
#define THICKLENS_MODEL_SRC_RAY_SET_H_

#include <Eigen/Core>
#include <vector>

#include "thicklens/model/camera.h"

namespace thicklens::model {

// One ray of a pixel: where it goes through the aperture, and where it lands.
struct PixelRay {
  Eigen::Vector2d aperture{0, 0};   // in standard deviations, per axis, of the aperture's weight
  Eigen::Vector2d offset_px{0, 0};  // from the pixel's centre
};

// `count` rays of equal weight: over the aperture by the PSF's shape, with mean 0 and second moment
// 1 per axis, and over the pixel's box of one px convolved with a Gaussian of `floor_sigma_px`.
// Hammersley points in four dimensions, mapped by the inverse distribution functions.
std::vector<PixelRay> PhotographRays(Psf psf, double floor_sigma_px, int count);

// The same over the pixel alone, all through the middle of the aperture: 89 points of a Fibonacci
// lattice.
std::vector<PixelRay> ViewRays(double floor_sigma_px);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SRC_RAY_SET_H_

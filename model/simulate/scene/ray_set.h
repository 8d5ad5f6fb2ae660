#ifndef THICKLENS_MODEL_SIMULATE_SCENE_RAY_SET_H_
#define THICKLENS_MODEL_SIMULATE_SCENE_RAY_SET_H_

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "thicklens/model/camera.h"

namespace thicklens::model {

// One ray of a pixel: its position on the aperture and its landing point.
struct PixelRay {
  Eigen::Vector2d aperture{0, 0};   // in standard deviations, per axis, of the aperture's weight
  Eigen::Vector2d offset_px{0, 0};  // relative to the pixel's centre
};

// The distributions over which the rays of a pixel spread.
struct RaySpread {
  std::optional<Psf> aperture;  // absent: a pinhole in its middle
  bool box = true;              // the box of the pixel, one px wide
  double gaussian_px = 0;       // sigma per axis of a Gaussian spread of the landing points
  double airy_px = 0;           // radius of an additional Airy pattern of the landing points
};

// Maximum distance of a ray from the middle of the aperture, in standard deviations. The radius of
// a disc is two of them; it is a little larger where the second moment of few rays is scaled to 1.
constexpr double kGaussianDeviations = 5;
constexpr double kDiscDeviations = 2.2;
double FarthestDeviations(const RaySpread& spread);  // 0 without aperture
// Maximum distance of a ray from its nominal landing point, px.
double FarthestLandingPx(const RaySpread& spread);

// Returns `count` rays of equal weight. They are distributed over the aperture by the PSF's shape,
// with mean 0 and second moment 1 per axis, and over the box convolved with the Gaussian and the
// Airy pattern. They are Hammersley points of the necessary number of dimensions, mapped by the
// inverse distribution functions.
std::vector<PixelRay> PhotographRays(const RaySpread& spread, int count);

// Returns rays that spread over the pixel only and pass through the middle of the aperture: 89
// points of a Fibonacci lattice, or one ray without any spread.
std::vector<PixelRay> ViewRays(bool box, double gaussian_px);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SCENE_RAY_SET_H_

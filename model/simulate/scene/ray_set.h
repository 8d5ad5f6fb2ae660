#ifndef THICKLENS_MODEL_SIMULATE_SCENE_RAY_SET_H_
#define THICKLENS_MODEL_SIMULATE_SCENE_RAY_SET_H_

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "thicklens/model/camera.h"

namespace thicklens::model {

// One ray of a pixel: where it goes through the aperture, and where it lands.
struct PixelRay {
  Eigen::Vector2d aperture{0, 0};   // in standard deviations, per axis, of the aperture's weight
  Eigen::Vector2d offset_px{0, 0};  // from the pixel's centre
};

// Over what the rays of a pixel spread.
struct RaySpread {
  std::optional<Psf> aperture;  // absent: a pinhole in its middle
  bool box = true;              // the pixel's own, of one px
  double gaussian_px = 0;       // sigma per axis of a Gaussian by which they miss it
  double airy_px = 0;           // radius of an Airy pattern by which they miss it, too
};

// No ray goes farther than this from the middle of the aperture, in standard deviations. A disc's
// radius is two of them, a little more where the second moment of few rays is made 1.
constexpr double kGaussianDeviations = 5;
constexpr double kDiscDeviations = 2.2;
double FarthestDeviations(const RaySpread& spread);  // 0 without aperture
// Nor than this from where it would land, px.
double FarthestLandingPx(const RaySpread& spread);

// `count` rays of equal weight: over the aperture by the PSF's shape, with mean 0 and second moment
// 1 per axis, and over the box convolved with the Gaussian and the pattern. Hammersley points in
// as many dimensions as it takes, mapped by the inverse distribution functions.
std::vector<PixelRay> PhotographRays(const RaySpread& spread, int count);

// The same over the pixel alone, all through the middle of the aperture: 89 points of a Fibonacci
// lattice, or one where nothing spreads.
std::vector<PixelRay> ViewRays(bool box, double gaussian_px);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SCENE_RAY_SET_H_

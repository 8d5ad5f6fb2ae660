#ifndef THICKLENS_CALIB_SPECTRUM_TEXTURE_SPECTRUM_H_
#define THICKLENS_CALIB_SPECTRUM_TEXTURE_SPECTRUM_H_

#include <vector>

#include "thicklens/model/sweep_simulator.h"

namespace thicklens::calib {

// A texture in numbers: the kinds, the contrast and the size of the detail are those of
// model::TargetOptions.
struct Texture {
  model::TargetKind kind = model::TargetKind::kDeadLeaves;
  double contrast = 0.6;
  double feature_size_mm = 0;  // > 0
  double field_mm = 0;         // shorter side of the field in the plane of focus
};

// Whether the spectrum of the kind is known: of dead leaves and of both noises.
bool HasSpectrum(model::TargetKind kind);

// Mean power density of the light of a texture relative to its mean, mm^2 of the target, without
// blur [D153]. Its integral over the frequencies is the variance of the relative light.
//
// Dead leaves: of two points at a distance x, the leaf in front that covers any of them covers both
// with the probability b(x) = g/(2 - g), g(x) = E(area that a leaf shares with itself moved by x)/
// E(its area); otherwise their greys are independent. The covariance is therefore the greys' own
// variance, contrast^2/3, times b(x), and the density is its Hankel transform. For radii r from r0
// to r1 distributed as r^-3, E(area) is in proportion to ln(r1/r0).
// Noise: flat, or as 1/max(f, 1/field)^2, up to the shortest period, of the variance that is left
// below it after the limit tanh: (contrast/2)^2 times the square of the mean slope of tanh.
class TextureSpectrum {
 public:
  explicit TextureSpectrum(const Texture& texture);

  double DensityMm2(double cycles_per_mm) const;

 private:
  void TabulateLeaves();

  Texture texture_;
  double level_mm2_ = 0;  // noise: density at its lowest frequency
  // Leaves: ln density at equal steps of ln frequency.
  double first_ = 0, step_ = 1;
  std::vector<double> densities_mm2_;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SPECTRUM_TEXTURE_SPECTRUM_H_

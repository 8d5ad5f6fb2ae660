#ifndef THICKLENS_CALIB_REGISTRATION_BLUR_FIELD_H_
#define THICKLENS_CALIB_REGISTRATION_BLUR_FIELD_H_

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "thicklens/calib/calibration.h"

namespace thicklens::calib {

struct ScaleSample;

// Blur of one tile of a frame beyond the reference, which was brought to the mean blur of the
// frame.
struct TileBlur {
  Eigen::Vector2d centre_px{0, 0};  // from the centre of the map
  // Variances along x and y and their covariance, px^2, with the inverse of their covariance.
  Eigen::Vector3d added_px2{0, 0, 0};
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
};

// How the added blur changes with the distance R from the centre of the map: its variance is a + b
// R^2 in all directions, plus d R^2 along the radius and less by it along the tangent. Both are
// dimensionless.
struct BlurField {
  model::Estimate curvature;    // b
  model::Estimate astigmatism;  // d
};

// Fits the field, with a constant and a slope of the variance besides, which displace the detail
// without changing its scale. Returns std::nullopt for fewer than nine tiles.
std::optional<BlurField> FitBlurField(const std::vector<TileBlur>& tiles);

// Power of a texture where the phases of a frame determine its shift. Frequencies are logarithms of
// cycles per px.
struct TexturePower {
  double log_frequency = 0;  // mean of the frequencies that determine the shift
  // The exponent n of the power k^n, at the mean of those frequencies that the blur leaves.
  struct Exponent {
    double value = 0, log_frequency = 0;
  };
  std::optional<Exponent> exponent;
};

// The blur over the field, as far as a registration shows it.
struct BlurOverField {
  std::optional<BlurField> field;
  TexturePower texture;
};

// The relative change of the image scale that a field of the blur makes in a registration by phases
// [D156]. A point whose blur has the variance matrix V(p) spreads its light evenly, but its
// surroundings do not, and detail of the frequency k (radians) appears displaced by -(div V) (1 -
// k.V k/2). The contrast that changes across a tile adds grad(G k.V k)/(4 G) to the phases of its
// cross-spectrum G with a reference of equal mean blur. Together, for a texture whose power is
// proportional to k^n, the displacement is -(b (2 - n)/2 + d (4 - n)/2) p: detail moves to where
// the blur is smaller. Derived here; it holds where V changes across a tile by less than 2/k^2.
// Limit: a blur that is the same everywhere does not displace.
double StretchByBlur(double curvature, double astigmatism, double texture_exponent);

// The curvature and the astigmatism of the blur per change of the scale, (s - 1). A lens with a
// curved or astigmatic field makes both proportional to it [D156], and a factor is fitted to all
// frames. Returns std::nullopt for fewer than five frames that show the field, and where the scales
// differ from 1 by no more than their errors, as those of aligned frames do: such errors would turn
// a curvature that all frames have into a factor without a meaning. `blurs` are those of the
// samples.
std::optional<BlurField> BlurPerScale(const std::vector<BlurOverField>& blurs,
                                      const std::vector<ScaleSample>& samples);

// The factors that are to be taken into account: one within twice its error is 0, and its value is
// a part of its error.
BlurField SeenFactors(const BlurField& factors);

// Stores in each sample the error of the scale that all samples share: from the errors of the
// factors and, where these are not 0, from the part of the stretch that the model of the blur
// leaves open. The exponent of the texture is fitted as a linear function of the frequency, because
// the frames with a strong blur show low frequencies only, and not their exponent. `before` has the
// scales without the blur over the field if those of the samples were measured with it
// (RegisterWithBlur); otherwise it is empty. Changes no scale.
void StateStretchByBlur(const BlurField& factors, const std::vector<BlurOverField>& blurs,
                        const std::vector<double>& before, std::vector<ScaleSample>* samples);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_BLUR_FIELD_H_

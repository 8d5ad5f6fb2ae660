#ifndef THICKLENS_MODEL_EFFECTS_EFFECT_BOUNDS_H_
#define THICKLENS_MODEL_EFFECTS_EFFECT_BOUNDS_H_

#include <vector>

#include "thicklens/model/effect_impact.h"

namespace thicklens::model {

// Quantities of a camera and of the effects of an image that the bounds of effects need, computed
// once. Keeps a reference to the conditions, which must outlive it.
class EffectOptics {
 public:
  EffectOptics(const EffectConditions& given, const EffectSet& of_image);

  const EffectConditions& conditions() const { return conditions_; }
  const Camera& camera() const { return conditions_.camera; }
  double inverse_focus() const { return inverse_focus_; }          // 1/zf, per mm
  double aperture_sigma_mm() const { return aperture_sigma_mm_; }  // kappa r
  double scale_px() const { return scale_px_; }                    // K/p
  double floor_px() const { return floor_px_; }
  // The image distance d1; K, that of the thin lens, without the effect of thickness.
  double image_distance_mm() const { return image_distance_mm_; }
  const TransferCurve& transfer() const { return transfer_; }  // linear without its effect
  bool is_disc() const { return conditions_.camera.psf == Psf::kDisc; }

  // c(z) kappa r/p: displacement on the sensor, px, per standard deviation of the aperture. Its
  // absolute value is the sigma of defocus.
  double DefocusPx(double depth_mm) const;

  // Smoothing of the image by other effects.
  struct Smoothing {
    double gaussian_px2 = 0;  // variance of the Gaussian blur per axis
    double disc_px = 0;       // radius of the disc
    bool boxed = false;       // true: the box of a pixel has turned jumps into ramps
  };
  Smoothing SmoothingBy(const EffectSet& effects, const EffectSite& place) const;

 private:
  const EffectConditions& conditions_;
  double inverse_focus_ = 0, aperture_sigma_mm_ = 0, scale_px_ = 0, floor_px_ = 0;
  double image_distance_mm_ = 0;
  TransferCurve transfer_;
};

// Bounds of changes in linear light.

// Change by a blur of zero mean and `variance_px2` per axis, applied to an image that already has
// the smoothing `other`.
double BlurChange(const EffectSite& place, double variance_px2,
                  const EffectOptics::Smoothing& other);
// Change by a displacement, px, of an image that already has the smoothing `other`.
double ShiftChange(const EffectSite& place, double shift_px, const EffectOptics::Smoothing& other);

// Bounds of changes of encoded values, 255 at full scale.

// Stored change for a change of the radiance anywhere between `dark` and `bright` of the place.
double EncodedChange(const EffectOptics& optics, const EffectSite& place, double change);
// Stored change for light that is scaled by (1 + relative).
double EncodedScaling(const EffectOptics& optics, const EffectSite& place, double relative);
// Standard deviation of encoded values for a standard deviation in linear light where the place is
// darkest. Curves are continued as odd functions below black (TransferCurve::Encode).
double EncodedSigma(const EffectOptics& optics, const EffectSite& place, double sigma);

// Throws Error if the conditions are not valid or there is no place.
void CheckEffects(const EffectConditions& conditions, const std::vector<EffectSite>& places);
bool MattersMore(const EffectImpact& a, const EffectImpact& b);
// The place with the largest impact of the effect in an image that also has `others`.
LargestEffectImpact FindImpact(Effect effect, const EffectConditions& conditions,
                               const std::vector<EffectSite>& places, const EffectSet& others);

// The impact of each effect: one function per effect.
EffectImpact ThicknessImpact(const EffectOptics& optics, const EffectSite& place,
                             const EffectSet& others);
EffectImpact DefocusImpact(const EffectOptics& optics, const EffectSite& place,
                           const EffectSet& others);
EffectImpact ApertureShapeImpact(const EffectOptics& optics, const EffectSite& place,
                                 const EffectSet& others);
EffectImpact FalloffImpact(const EffectOptics& optics, const EffectSite& place,
                           const EffectSet& others);
EffectImpact VignettingImpact(const EffectOptics& optics, const EffectSite& place,
                              const EffectSet& others);
EffectImpact OcclusionImpact(const EffectOptics& optics, const EffectSite& place,
                             const EffectSet& others);
EffectImpact PixelBoxImpact(const EffectOptics& optics, const EffectSite& place,
                            const EffectSet& others);
EffectImpact LensFloorImpact(const EffectOptics& optics, const EffectSite& place,
                             const EffectSet& others);
EffectImpact DiffractionImpact(const EffectOptics& optics, const EffectSite& place,
                               const EffectSet& others);
EffectImpact ShotNoiseImpact(const EffectOptics& optics, const EffectSite& place,
                             const EffectSet& others);
EffectImpact ReadNoiseImpact(const EffectOptics& optics, const EffectSite& place,
                             const EffectSet& others);
EffectImpact QuantisationImpact(const EffectOptics& optics, const EffectSite& place,
                                const EffectSet& others);
EffectImpact TransferCurveImpact(const EffectOptics& optics, const EffectSite& place,
                                 const EffectSet& others);
EffectImpact LampFalloffImpact(const EffectOptics& optics, const EffectSite& place,
                               const EffectSet& others);
EffectImpact FlickerImpact(const EffectOptics& optics, const EffectSite& place,
                           const EffectSet& others);
EffectImpact MagnificationImpact(const EffectOptics& optics, const EffectSite& place,
                                 const EffectSet& others);
EffectImpact DriftImpact(const EffectOptics& optics, const EffectSite& place,
                         const EffectSet& others);
EffectImpact TiltImpact(const EffectOptics& optics, const EffectSite& place,
                        const EffectSet& others);
EffectImpact ReadingErrorImpact(const EffectOptics& optics, const EffectSite& place,
                                const EffectSet& others);

EffectImpact ShadingImpact(const EffectOptics& optics, const EffectSite& place,
                           const EffectSet& others);
EffectImpact DustImpact(const EffectOptics& optics, const EffectSite& place,
                        const EffectSet& others);
EffectImpact AberrationsImpact(const EffectOptics& optics, const EffectSite& place,
                               const EffectSet& others);
EffectImpact DistortionImpact(const EffectOptics& optics, const EffectSite& place,
                              const EffectSet& others);
EffectImpact BandsImpact(const EffectOptics& optics, const EffectSite& place,
                         const EffectSet& others);
EffectImpact ExposureDriftImpact(const EffectOptics& optics, const EffectSite& place,
                                 const EffectSet& others);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_EFFECTS_EFFECT_BOUNDS_H_

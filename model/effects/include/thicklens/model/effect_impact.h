#ifndef THICKLENS_MODEL_EFFECT_IMPACT_H_
#define THICKLENS_MODEL_EFFECT_IMPACT_H_

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/effects.h"
#include "thicklens/model/lens_aberrations.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/scene.h"

namespace thicklens::model {

// A bench that moves a flat target along the axis. Depth, light and scale refer to the plane of
// focus zf.
struct BenchConditions {
  bool lamp_at_camera = true;   // true: the irradiance of the target is in proportion to (zf/z)^2
  double flicker = 0;           // relative standard deviation of the lamp per frame
  double drift_sigma_px = 0;    // sd of the target's lateral position per frame and axis, px at zf
  double reading_sigma_mm = 0;  // standard deviation of the error of each reading
  double tilt_deg = 0;          // angle between the target and the plane across the axis
  double corner_stops = 0;      // light at the farthest corner over that on the axis, factors of 2
  double speck_depth = 0;       // part of the light that a speck on the sensor takes, 0 to 1
  LensAberrations aberrations = {};  // of the lens
  double band_amplitude = 0;         // relative amplitude of bands of the light, 0 to 1
  double exposure_drift_stops = 0;   // change of the exposure over the sweep, factors of 2
};

// Relative light of a row under a lamp that flickers while the shutter rolls [D140]:
// 1 + amplitude sin(2 pi phase), or the sign of the sine for a lamp that is switched on and off.
// `phase` counts periods of the lamp.
THICKLENS_EXPORT double BandFactor(double amplitude, double phase, bool is_square);

// Relative light that the shading of a camera lets through [D135]:
// (1 + (c^(-1/2) - 1) r^2/R^2)^-2, c = 2^corner_stops, as cos^4 of an angle whose tangent is
// proportional to r. r and R are distances from the axis, of the pixel and of the farthest corner.
// It is 1 on the axis and c in that corner.
THICKLENS_EXPORT double ShadingAt(const Sensor& sensor, double corner_stops,
                                  const Eigen::Vector2d& position_px);

// Conditions under which a scene is photographed.
struct EffectConditions {
  Camera camera;  // needs image distance and blur ratio; an absent blur floor is taken as 0
  // Planes of the light field from which the image is made; absent: UV is the aperture plane.
  std::optional<LightFieldPlanes> planes;
  double wavelength_mm = 550e-6;         // wavelength of the light, mm, for diffraction
  int bits = 8;                          // bits per value of the encoded image
  double encoded_noise_grey_levels = 0;  // sd of the noise that is added to encoded values
  double full_well_electrons = 0;        // at full scale; 0: no noise in electrons is known
  double read_noise_electrons = 0;       // standard deviation of the read noise, electrons
  std::optional<BenchConditions> bench;  // absent: a single image

  // Returns true if all numbers are in their range and the camera has its image distance and blur
  // ratio. Otherwise `why`, if not null, gets the field, the value and the constraint.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// A place of a scene and the radiance around it. The default is an edge between black and white
// across the image, without another surface near or behind it.
struct EffectSite {
  Eigen::Vector2d position_px{0, 0};  // position in the image
  double depth_mm = 0;                // depth from Ap; may be +inf
  // Depth from Ap of the surface whose 1/z differs most, among all surfaces that blur spreads to
  // this place across a depth edge. Absent: there is no such edge.
  std::optional<double> other_depth_mm;
  // Depth from Ap of the sharpest surface among all that blur spreads to this place. Absent: the
  // depth nearest to the plane of focus between the two depths above.
  std::optional<double> sharpest_depth_mm;
  // Radiance, in linear light, of the surfaces that blur spreads to this place: its bounds `dark`
  // and `bright`, the largest `jump` between neighbours and, between jumps, the largest `slope` per
  // px and the largest `bend`, |d2L/dx2| + |d2L/dy2|, per px^2.
  double dark = 0, bright = 1;
  double jump = 1, slope = 0, bend = 0;  // between neighbours; per px; per px^2
};

// Change of the image by one effect at one place.
struct EffectImpact {
  double amount = 0;  // in the unit of the effect (EffectFacts::unit)
  // Bound of the change of encoded values, 255 at full scale; the standard deviation for random
  // effects. It holds wherever the radiance is as the place states.
  double grey_levels = 0;
  // The part of `grey_levels` that `amount` does not cover: for effects in px, their change of the
  // fall-off.
  double aside_grey_levels = 0;
};

// Impact of the effect at a place on an image that also has the effects `others`. Effects of a
// bench do not change a single image. The derivation of each bound is at its function in
// effects_of_*.cc. Throws Error if the conditions are not valid.
THICKLENS_EXPORT EffectImpact ImpactAt(Effect effect, const EffectConditions& conditions,
                                       const EffectSite& place, const EffectSet& others);

// The place where an effect has its largest impact, and that impact.
struct LargestEffectImpact {
  Effect effect = Effect::kThickness;  // the effect that is judged
  EffectImpact impact;                 // its largest change of the image
  EffectSite place;                    // where it has this impact
};
// One finding for each of `effects`, in their order, in an image with all the other `effects`.
// Throws Error if the conditions are not valid or there is no place. `threads`: 0 means one per
// core.
THICKLENS_EXPORT std::vector<LargestEffectImpact> FindImpacts(const EffectConditions& conditions,
                                                              const std::vector<EffectSite>& places,
                                                              const EffectSet& effects,
                                                              int threads = 1);

// Black and white edges in the middle and in the farthest corner of the image, at depths from Ap
// that are equally spaced in 1/z. With `occlusion` there are also edges at near_mm in front of
// far_mm. Throws Error unless 0 < near_mm <= far_mm and near_mm is finite.
THICKLENS_EXPORT std::vector<EffectSite> PlacesBetween(const Camera& camera, double near_mm,
                                                       double far_mm, bool occlusion);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_EFFECT_IMPACT_H_

#ifndef THICKLENS_MODEL_EFFECT_IMPACT_H_
#define THICKLENS_MODEL_EFFECT_IMPACT_H_

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/model/camera.h"
#include "thicklens/model/effects.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/scene.h"

namespace thicklens::model {

// A bench that moves a flat target along the axis. The plane of focus is what depths, light and
// scale are compared with.
struct BenchConditions {
  bool lamp_at_camera = true;   // irradiance of the target as (zf/z)^2
  double flicker = 0;           // relative sd of the lamp, per frame
  double drift_sigma_px = 0;    // sd of the target's lateral position, per frame, at zf
  double reading_sigma_mm = 0;  // sd of the error of each reading
  double tilt_deg = 0;          // of the target against the plane across the axis
};

// How a scene is photographed.
struct EffectConditions {
  Camera camera;  // with image distance and blur ratio; a blur floor that it lacks is taken as 0
  // Of the light field that the picture is made from; absent: UV on the aperture.
  std::optional<LightFieldPlanes> planes;
  double wavelength_mm = 550e-6;
  int bits = 8;                         // of the stored picture
  double stored_noise_grey_levels = 0;  // sd of noise that is added to stored values
  double full_well_electrons = 0;       // at full scale; 0: no noise in electrons is known
  double read_noise_electrons = 0;
  std::optional<BenchConditions> bench;  // absent: a single picture

  bool IsValid(std::string* why) const;
};

// A place of a scene, with what is photographed there. The default is an edge between black and
// white across the picture, with nothing near or behind it.
struct EffectPlace {
  Eigen::Vector2d position_px{0, 0};  // in the picture
  double depth_mm = 0;                // from Ap; may be +inf
  // Of what is most different in 1/z of all that blur spreads to here past an edge of depth.
  std::optional<double> other_depth_mm;
  // Of what is least blurred of all that blur spreads to here; absent: the nearest to the plane of
  // focus between the two above.
  std::optional<double> sharpest_depth_mm;
  // Radiance in linear light of what blur spreads to here: bounds, the highest jump between
  // neighbours, and of what lies between jumps the steepest slope per px and the largest
  // |d2L/dx2| + |d2L/dy2| per px^2.
  double dark = 0, bright = 1;
  double jump = 1, slope = 0, bend = 0;
};

struct EffectImpact {
  double amount = 0;  // in the effect's unit
  // Bound of the change of stored values, 255 at full scale; of random effects their standard
  // deviation. Wherever the place's radiance is what it is said to be.
  double grey_levels = 0;
  // The part of it that is none of the amount's: of effects in px what they do to the fall-off.
  double aside_grey_levels = 0;
};

// What the effect does at a place to a picture that has the effects `others`, too. Effects of a
// bench do nothing to a single picture. Each bound is derived at its section: effects_of_*.cc.
EffectImpact ImpactAt(Effect effect, const EffectConditions& conditions, const EffectPlace& place,
                      const EffectSet& others);

// Where an effect matters most.
struct EffectFinding {
  Effect effect = Effect::kThickness;
  EffectImpact impact;
  EffectPlace place;
};
// Of each of `effects`, in their order, among all of them. Throws Error if the conditions are not
// valid or there is no place. `threads`: 0: one per core.
std::vector<EffectFinding> FindImpacts(const EffectConditions& conditions,
                                       const std::vector<EffectPlace>& places,
                                       const EffectSet& effects, int threads = 1);

// Black and white edges in the middle and in the farthest corner of the picture at depths equally
// spaced in 1/z; with `occlusion` those of the one end before the other. Throws Error unless
// 0 < near_mm <= far_mm.
std::vector<EffectPlace> PlacesBetween(const Camera& camera, double near_mm, double far_mm,
                                       bool occlusion);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_EFFECT_IMPACT_H_

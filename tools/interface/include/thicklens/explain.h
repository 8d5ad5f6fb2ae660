#ifndef THICKLENS_EXPLAIN_H_
#define THICKLENS_EXPLAIN_H_

#include <optional>
#include <string>

#include "thicklens/base/export.h"
#include "thicklens/camera.h"
#include "thicklens/depth.h"
#include "thicklens/effects.h"
#include "thicklens/model/effect_costs.h"
#include "thicklens/model/explanation.h"
#include "thicklens/run.h"

namespace thicklens {

using DepthRange = model::DepthRange;  // mm from Ap; far_mm may be infinite

// The options of ExplainCamera.
struct ExplainOptions {
  // Exactly one: a range, 0 < near < far; or the depth map of the scene, of the sensor's size, in
  // kZ or kRange.
  std::optional<DepthRange> depth_range;
  std::optional<DepthMap> depth;  // see depth_range
  int depth_count = 9;            // of the table, equally spaced in 1/depth; 2 to 10000
  EffectSelection effects;        // the effects that are judged
  int bits = 8;                   // per encoded value, 1 to 32
  // Electrons at full scale, 0: unknown; standard deviation of the read noise in electrons, which
  // needs the former. Finite and >= 0.
  double full_well_electrons = 0, read_noise_electrons = 0;
  // The depths are those of a target on a bench; absent: those of a scene. Its members are finite,
  // >= 0, and |tilt_deg| <= 89.
  std::optional<model::BenchConditions> bench;
  // Depth of the UV plane of a light field whose ST plane is the plane of focus, mm, finite.
  std::optional<double> uv_depth_mm;
  bool measure_costs = false;  // takes some seconds; not with a bench

  // Returns whether all members are valid. Otherwise `why`, if not null, gets the field, the value
  // and the constraint.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// The blur and the effects of a camera at some depths.
struct CameraExplanation {
  DepthRange depth_range;          // given, or of the map
  model::Explanation camera;       // blur and depth of field
  model::EffectSelection effects;  // with the largest impact of each effect at these depths
  std::optional<model::EffectCosts> costs;  // present if measure_costs was set
};

// Explains blur, depth of field and effects of a calibrated camera: `thicklens explain`. `options`
// is a value so that a large map can be moved in. Throws OptionError, Error for a camera that is
// not valid or has no calibration, or a map that does not fit it, and Interrupted.
THICKLENS_EXPORT CameraExplanation ExplainCamera(const Camera& camera, ExplainOptions options,
                                                 const RunControl& run = {});

}  // namespace thicklens

#endif  // THICKLENS_EXPLAIN_H_

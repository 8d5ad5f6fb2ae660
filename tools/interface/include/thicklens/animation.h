#ifndef THICKLENS_ANIMATION_H_
#define THICKLENS_ANIMATION_H_

#include <string>

#include "thicklens/base/export.h"
#include "thicklens/render.h"
#include "thicklens/run.h"
#include "thicklens/scene_form.h"

namespace thicklens {

// The kind of animation: what changes from frame to frame.
enum class AnimationKind {
  // The viewpoint goes once around the aperture, on the ellipse through the outermost views of the
  // middle row and column.
  kParallax,
  // The focus goes from the far end of the scene to the near one and back; 0.5 % of the points at
  // either end are left out, because a few wrong depths would stretch the way.
  kFocus,
};

// The options of RenderAnimation.
struct AnimationOptions {
  AnimationKind kind = AnimationKind::kParallax;  // what changes
  int frames = 36;                                // 2 to 1000
  double seconds = 3;       // length of one loop, s, 0.1 to 3600, and at least 0.02 per frame
  int quality = 90;         // of the compression, 0 to 100
  RenderAperture aperture;  // of kFocus

  // Returns whether all members are valid. Otherwise `why`, if not null, gets the field, the value
  // and the constraint.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// Renders an animation that repeats for ever, and returns it as the bytes of a WebP file. Its last
// frame leads to its first. Throws OptionError, Error for a scene that is not valid or has more
// than 16383 px per side and in builds without an encoder of WebP, and Interrupted.
THICKLENS_EXPORT std::string RenderAnimation(const SceneForm& scene,
                                             const AnimationOptions& options = {},
                                             const RunControl& run = {});

}  // namespace thicklens

#endif  // THICKLENS_ANIMATION_H_

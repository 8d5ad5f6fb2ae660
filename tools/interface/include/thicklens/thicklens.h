#ifndef THICKLENS_THICKLENS_H_
#define THICKLENS_THICKLENS_H_

// The public interface of thicklens: read, plan, calibrate, verify, estimate, render, compare,
// simulate, explain, write. A program includes this file and links thicklens::thicklens. Values are
// in the unit that their name ends with; depths are positive from the aperture plane Ap toward the
// scene.
//
// Errors: a wrong file, option or device throws thicklens::Error (options: OptionError). The
// outcome of an operation is in its summary. A cancelled call throws thicklens::Interrupted.
//
// The headers that need OpenCV are included apart: thicklens/opencv.h, frames.h and watch.h.
#include "thicklens/animation.h"    // IWYU pragma: export
#include "thicklens/calibrate.h"    // IWYU pragma: export
#include "thicklens/camera.h"       // IWYU pragma: export
#include "thicklens/compare.h"      // IWYU pragma: export
#include "thicklens/depth.h"        // IWYU pragma: export
#include "thicklens/depth_fit.h"    // IWYU pragma: export
#include "thicklens/distortion.h"   // IWYU pragma: export
#include "thicklens/effects.h"      // IWYU pragma: export
#include "thicklens/estimate.h"     // IWYU pragma: export
#include "thicklens/explain.h"      // IWYU pragma: export
#include "thicklens/image.h"        // IWYU pragma: export
#include "thicklens/light_field.h"  // IWYU pragma: export
#include "thicklens/plan.h"         // IWYU pragma: export
#include "thicklens/render.h"       // IWYU pragma: export
#include "thicklens/run.h"          // IWYU pragma: export
#include "thicklens/scene_form.h"   // IWYU pragma: export
#include "thicklens/simulate.h"     // IWYU pragma: export
#include "thicklens/solver.h"       // IWYU pragma: export
#include "thicklens/sweep.h"        // IWYU pragma: export
#include "thicklens/verify.h"       // IWYU pragma: export
#include "thicklens/version.h"      // IWYU pragma: export

#endif  // THICKLENS_THICKLENS_H_

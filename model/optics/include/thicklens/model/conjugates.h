#ifndef THICKLENS_MODEL_CONJUGATES_H_
#define THICKLENS_MODEL_CONJUGATES_H_

#include <string>

#include "thicklens/base/export.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::model {

// Quantities each of which determines the plane of focus of a known lens, and so all the others.
enum class ConjugateKind {
  kFocusDepth,     // zf, in-focus object distance from Ap, mm
  kImageDistance,  // d1, from Ap to the sensor, mm
  kTubeLength,     // D - f2, from the rear focal plane to the sensor ("optical tube length"), mm
  kMagnification,  // m > 0, size on the sensor over size in the plane of focus
};

// A statement about the plane of focus: its value in mm, or dimensionless for a magnification.
struct StatedConjugate {
  ConjugateKind kind = ConjugateKind::kFocusDepth;  // what is stated
  Estimate value;                                   // the stated value and its standard deviation
  std::string name;                                 // where it is stated, "lens.magnification"
};

// zf from Ap and its standard deviation, mm, for a lens that is known exactly. From [S13], with
// Newton's x = zf - f1 and x' = D - f2, for which x x' = f1 f2 and m = f1/x = x'/f2 [D127]:
//   zf = f1 + f1/m,  zf = f1 + f1 f2/x',  x' = d1 - rho - f2.
// Throws Error, which names the statement, unless the image is real: zf > f1, x' > 0, m > 0.
THICKLENS_EXPORT Estimate FocusDepthOf(const ThickLens& lens, const StatedConjugate& stated);

// The magnification m = f1/(zf - f1) in the plane of focus, > 0 [D127]. Throws Error unless
// zf > f1.
THICKLENS_EXPORT double MagnificationAtFocus(const ThickLens& lens, double focus_depth_mm);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_CONJUGATES_H_

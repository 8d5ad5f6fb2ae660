#ifndef THICKLENS_CALIB_UNCERTAINTY_RELIEF_PARTS_H_
#define THICKLENS_CALIB_UNCERTAINTY_RELIEF_PARTS_H_

#include <opencv2/core/types.hpp>

#include "thicklens/calib/target_finding.h"

namespace thicklens::calib {

// Decides whether the zones of `finding` (columns, rows, sharpest_mm) show a target with relief:
// zones at a few depths, with steps between them. A tilted target, field curvature and astigmatism
// that grows over the field are smooth. With the deviations r of the zones, each in units of its
// error e (at least a tenth of a step, and the scatter of neighbours), and n zones, the costs
//   C_smooth = sum min(r^2, 16) about a polynomial of the second order in x and y, robustly fitted,
//   C_steps = sum min(r^2, 16) about k depths + 2 b ln k                                     [D169]
// with b pairs of neighbours of different depths, are compared: relief is C_steps < C_smooth/2,
// C_smooth > 3 n, and k > 1. A depth is that of at least three zones, of which each has a
// neighbour, and lies at least 0.7 steps and six errors from the next one. Fills in the rest of
// `finding` except the region. `step_mm` is the mean distance of the readings; `toward_camera` is
// +1 if a part that is nearer to the camera is sharpest at a larger reading, -1 otherwise.
void DivideByDepth(double step_mm, double toward_camera, ReliefFinding* finding);

// The largest rectangle of zones that belong to one part, in zones; empty where there are no parts.
// `part` gets its index.
cv::Rect LargestRectangle(const ReliefFinding& finding, int* part);

// Makes a part the first one, to which the others are relative.
void MakeFirst(int part, ReliefFinding* finding);

// The depths in words: "a: 62 % of the field, b: 3.02 +- 0.05 mm nearer (31 %)".
std::string PartsInWords(const ReliefFinding& finding);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_UNCERTAINTY_RELIEF_PARTS_H_

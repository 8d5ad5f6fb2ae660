#ifndef THICKLENS_ESTIMATOR_REFINE_DEPTH_H_
#define THICKLENS_ESTIMATOR_REFINE_DEPTH_H_

#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/estimator/disparity_map.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::estimator {

// The faults of a depth map, and what was changed. Lengths are px of the map.
struct DepthRefinement {
  std::string message = "not run";  // one line: what was changed, and why
  bool applied = false;             // the map was changed
  // Width of the map's edges: 1 for steps, more for ramps, which bleed from one surface to the
  // other; 0: too few edges to say it.
  double edge_width_px = 0;
  int block_px = 1;          // edge of the blocks of a map that was enlarged without interpolation
  double quantum_px = 0;     // step of a quantised map, px per view step; 0: none
  double outlier_share = 0;  // share of pixels that differ from all neighbours
  // Distances by which the map lay to the right of and below the photograph, and by which its near
  // surfaces were too wide on each side.
  double right_px = 0, down_px = 0, dilation_px = 0;
  // Scale and offset (px per view step) by which the disparities were changed to agree with the
  // blur of the photograph, with standard deviations. RefineDepth leaves them alone; an estimate
  // corrects them afterwards (FitDepthValues).
  double scale = 1, offset_px = 0, scale_sigma = 0, offset_sigma_px = 0;
  // Share of the pixels that changed by more than half of the smallest jump.
  double changed_share = 0;
  double seconds = 0;  // time that it took
};

// How a map is refined.
struct DepthRefinementOptions {
  // Change what is probable; false: only what is certain.
  bool eager = false;
  double noise_px = 0;  // standard deviation of the map, px per view step
  int threads = 0;      // 0: one per core
};

// Repairs the usual faults of depth maps with the help of the photograph. The map itself shows
// which faults it has, and no other step is taken: blocks are interpolated; the steps of a
// quantised map are made smooth within their rounding; values between two surfaces, where edges are
// ramps, get that of the nearer surface [D191]; the whole map is moved where the colours on both
// sides of its edges ask for it, and its near surfaces made narrower or wider [D193]; where one of
// these was done, the pixels near edges are given to the surface whose colours they have [D192]. A
// hole that was filled gets the surface of its colour. A map without a fault stays as it is, bit
// for bit. `was_hole`: per pixel, or empty. The size of the photograph is that of the map, which
// has no holes. The result does not depend on the number of threads. Throws Error for sizes that do
// not fit.
THICKLENS_EXPORT DepthRefinement RefineDepth(const model::LinearImage& photo,
                                             const model::TransferCurve& transfer,
                                             const std::vector<bool>& was_hole,
                                             const DepthRefinementOptions& options,
                                             DisparityMap* map);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_REFINE_DEPTH_H_

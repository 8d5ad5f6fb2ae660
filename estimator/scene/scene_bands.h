#ifndef THICKLENS_ESTIMATOR_SCENE_SCENE_BANDS_H_
#define THICKLENS_ESTIMATOR_SCENE_SCENE_BANDS_H_

#include <vector>

#include "thicklens/estimator/disparity_map.h"
#include "thicklens/model/scene.h"

namespace thicklens::estimator {

// A part of an image that is solved for by itself: the rows [first, last), with the rows [from, to)
// around them, which contribute to the result.
struct SceneBand {
  int first = 0, last = 0;
  int from = 0, to = 0;

  int rows() const { return to - from; }
};

// Returns `count` bands of nearly the same height, with `margin_px` more rows above and below as
// far as the image has them.
std::vector<SceneBand> BandsOf(int height_px, int count, int margin_px);
// Returns every `stride`-th of the bands of `rows` rows.
std::vector<SceneBand> SampleBands(int height_px, int rows, int stride, int margin_px);

// Returns the number of rows from a pixel of the photograph to the farthest pixel that it is a mean
// of. `disparity` is that of the samples of a grid, on which a ray of the next view down lands
// `landing_step_px` px beside its sample.
int ReachPx(const DisparityMap& disparity, double landing_step_px, int v_count);
// Returns the number of rows around a band whose radiance still affects it. A row of H extends as
// far as the fan reaches, and twice as far where views see past an edge. The errors at the border
// of the rows that are solved for decay in steps of that reach.
int BandMarginPx(int reach_px);
// Returns the margin that H and the slopes alone need.
int SampleMarginPx(int reach_px);

model::LinearImage CutRows(const model::LinearImage& image, int from, int to);
DisparityMap CutRows(const DisparityMap& map, int from, int to);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_SCENE_BANDS_H_

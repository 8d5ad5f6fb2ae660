#ifndef THICKLENS_ESTIMATOR_SCENE_SCENE_BANDS_H_
#define THICKLENS_ESTIMATOR_SCENE_SCENE_BANDS_H_

#include <vector>

#include "thicklens/estimator/view_geometry.h"
#include "thicklens/model/scene.h"

namespace thicklens::estimator {

// A part of a picture that is solved for by itself: the rows [first, last), with the rows [from,
// to) around them, which have part in what they show.
struct SceneBand {
  int first = 0, last = 0;
  int from = 0, to = 0;

  int rows() const { return to - from; }
};

// So many bands of nearly the same height, with `margin_px` rows more above and below as far as the
// picture has them.
std::vector<SceneBand> BandsOf(int height_px, int count, int margin_px);
// Every `stride`-th of the bands of `rows` rows.
std::vector<SceneBand> SampleBands(int height_px, int rows, int stride, int margin_px);

// Rows from a pixel of the photograph to the farthest pixel that it is a mean of. `disparity` of
// the samples of a grid, for which a ray of the next view down lands so many px beside its sample.
int ReachPx(const DisparityMap& disparity, double landing_step_px, int v_count);
// Rows around a band of which the radiance still matters to it. A row of H sees as far as the fan
// reaches, and where views see past an edge twice as far; what the border of the rows that are
// solved for does wrong dies out in steps of that reach.
int BandMarginPx(int reach_px);
// The same for H and the slopes alone.
int SampleMarginPx(int reach_px);

model::LinearPicture CutRows(const model::LinearPicture& picture, int from, int to);
DisparityMap CutRows(const DisparityMap& map, int from, int to);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_SCENE_BANDS_H_

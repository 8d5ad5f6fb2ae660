#ifndef THICKLENS_CALIB_REGISTRATION_TILE_PASS_H_
#define THICKLENS_CALIB_REGISTRATION_TILE_PASS_H_

#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "calib/registration/coarse_registration.h"
#include "calib/registration/tile_phases.h"

namespace thicklens::calib {

// The shifts of tiles over the whole of the field that two pictures share.
struct TilePass {
  // Beyond the map, in px of full resolution, their centres from the map's.
  std::vector<TileShift> shifts;
  double weight_variance_px2 = 0;            // second moment of a tile, as TilePhases has it
  double agreement = 0;                      // correlation, 0 to 1
  std::optional<double> added_variance_px2;  // what the frame's blur has over the reference's
};

// With the frame shrunk by `factor`, and with `variance_px2`, what is known so far of the added
// blur, put on the sharper picture. Nothing where the shared field is too small for tiles.
std::optional<TilePass> MeasureTiles(const cv::Mat& reference, const cv::Mat& frame,
                                     const FrameMap& map, int factor, double variance_px2);

// By how much to shrink a field: more pixels than that cost time and tell nothing more.
int TileFactor(double field_px, double blur_px);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_TILE_PASS_H_

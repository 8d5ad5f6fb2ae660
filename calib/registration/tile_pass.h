#ifndef THICKLENS_CALIB_REGISTRATION_TILE_PASS_H_
#define THICKLENS_CALIB_REGISTRATION_TILE_PASS_H_

#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "calib/registration/coarse_registration.h"
#include "calib/registration/tile_phases.h"

namespace thicklens::calib {

// The shifts of tiles over the whole field that two images share.
struct TilePass {
  // Shifts beyond the map, in px of full resolution. The tile centres are relative to the centre of
  // the map.
  std::vector<TileShift> shifts;
  double weight_variance_px2 = 0;            // second moment of a tile, as in TilePhases
  double agreement = 0;                      // correlation, 0 to 1
  std::optional<double> added_variance_px2;  // blur of the frame minus that of the reference
  // How the added blur changes over the field, and what the texture makes of it.
  std::vector<TileBlur> blurs;
  TexturePower texture;  // frequencies in cycles per px of full resolution
};

// The tiles of a frame shrunk by a factor, in shrunk px.
struct TileLayout {
  cv::Rect field;                  // the part that both frames show
  int size_px = 0;                 // side of a tile
  std::vector<cv::Point> corners;  // top left corner of each tile
};

// Returns std::nullopt where the shared field is too small for tiles.
std::optional<TileLayout> LayOutTiles(const FrameMap& map, cv::Size reference, cv::Size frame,
                                      int factor);

// How a blur is known to change with the distance from the centre of the map, as in BlurField.
struct KnownBlurField {
  double curvature = 0, astigmatism = 0;
};

// Measures the tiles with the frame shrunk by `factor`. The blur added by `variance_px2`, the
// present estimate of its mean over the field, is applied to the sharper image. With a known field,
// every point of the reference gets the blur that it lacks at its own place, so that a blur that
// changes over the field displaces the detail of both images alike; where the reference has too
// much blur, the frame is blurred evenly. Returns std::nullopt where the shared field is too small
// for tiles.
std::optional<TilePass> MeasureTiles(const cv::Mat& reference, const cv::Mat& frame,
                                     const FrameMap& map, int factor, double variance_px2,
                                     const std::optional<KnownBlurField>& known = std::nullopt);

// Factor by which to shrink a field. More pixels would cost time without more information.
int TileFactor(double field_px, double blur_px);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_TILE_PASS_H_

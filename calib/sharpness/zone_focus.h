#ifndef THICKLENS_CALIB_SHARPNESS_ZONE_FOCUS_H_
#define THICKLENS_CALIB_SHARPNESS_ZONE_FOCUS_H_

#include <cstddef>
#include <functional>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "thicklens/model/camera.h"

namespace thicklens::calib {

// A frame whose zones are compared, and how its image of the target is scaled.
struct ZoneFrame {
  std::size_t frame = 0;  // index for ZoneSetup::read_grey
  double reading_mm = 0;
  double scale = 1;  // image scale relative to the frame in which the zones are squares
};

struct ZoneSetup {
  std::function<cv::Mat(std::size_t frame)> read_grey;  // linear light, CV_32F, of one size
  std::vector<ZoneFrame> frames;
  cv::Point2d centre_px;  // the pixel that stays where the scale changes
  int threads = 0;
};

// The readings at which the zones of a grid over the image are sharpest.
struct ZoneFocus {
  int columns = 0, rows = 0;
  // Row by row, with the standard deviation; absent where the zone has too little texture, or no
  // maximum within the sweep.
  std::vector<std::optional<model::Estimate>> sharpest_mm;

  // The pixels of a rectangle of zones in an image of that size.
  cv::Rect2d Pixels(const cv::Rect& zones, cv::Size image) const;
};

// Divides the image into zones of at least 20 px, up to 16 along a side, which keep their place on
// the target. The sharpness of a zone is the mean square of the gradient over the square of the
// mean light, as the part of the target grows (scale^2). The reading is the vertex of a parabola
// through its logarithm over the frames that reach half of the maximum.
ZoneFocus FindZoneFocus(const ZoneSetup& setup);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SHARPNESS_ZONE_FOCUS_H_

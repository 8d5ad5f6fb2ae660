#ifndef THICKLENS_CALIB_REGISTRATION_SPOT_MOMENTS_H_
#define THICKLENS_CALIB_REGISTRATION_SPOT_MOMENTS_H_

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "thicklens/model/camera.h"

namespace thicklens::calib {

// Points (pinholes or beads) that were found in a sharp frame.
struct SpotPattern {
  bool done = false;                // true if there are enough points
  std::string message = "not run";  // how it ended; without a result, the reason
  // True: the frame is even apart from compact points of similar strength, so that no other kind of
  // target is meant. It decides where the kind is not stated.
  bool is_nothing_else = false;
  bool are_bright = false;              // true: bright points on a dark ground
  std::vector<cv::Point2d> centres_px;  // of the points
  double spacing_px = 0;                // median distance of a point from its nearest neighbour
  double sigma_px = 0;                  // rough sigma of a point's image
};

// Looks for points in linear light, CV_32F.
SpotPattern FindSpots(const cv::Mat& grey);

// Reason for which a point of a frame has no blur.
enum class SpotFault { kNone, kOutside, kOverlapped, kClipped, kFaint };
// The reason in words: "at the border", "overlapped by a neighbour", "clipped", "too faint".
std::string SpotFaultInWords(SpotFault fault);

// Whether a point has a place.
inline bool HasPlace(SpotFault fault) {
  return fault == SpotFault::kNone || fault == SpotFault::kClipped;
}

// One point of one frame, from the moments of its light above the ground.
struct SpotMoments {
  SpotFault fault = SpotFault::kFaint;
  cv::Point2d centre_px;          // centroid; of a clipped point, too
  double variance_px2 = 0;        // mean of the central second moments along x and y, with the box
  double variance_sigma_px2 = 0;  // its standard deviation by the noise of the ground
};

// How the points of a frame are measured.
struct SpotWindow {
  double sigma_px = 1;       // sigma of the image of a point, which the window follows
  double sign = 1;           // +1: bright points, -1: dark ones
  double clip_light = 1e30;  // light at which a pixel is clipped, linear
  // Radius over sigma. A Gaussian has (1 + w^2/2) exp(-w^2/2) of its second moment beyond w sigma:
  // 0.3 % for 4, and a disc (radius 2 sigma) nothing.
  static constexpr double kRadius = 4;
};

// Measures the point at a start by its moments
//   F = sum d, x = sum d p/F, sigma^2 = sum d |p - x|^2/(2 F)                              [D167]
// where d is the light less the ground, over pixels within a circle around the centroid (pixels on
// the circle by the part of them that is within). The ground is a plane fitted to the ring between
// 1 and 1.5 radii, without the circles of neighbours. Corrected are, for noise of standard
// deviation n, N pixels in the circle and S_k = sum |p - x|^k over them: what the noise of the
// centroid takes, n^2 S_2/(2 F^2), and the bias of the quotient,
// 1 + n^2 N/F^2 - n^2 S_2/(2 F^2 sigma^2); and for a Gaussian what lies beyond the circle [D168].
// `neighbours` are the places of the other points.
SpotMoments MeasureSpot(const cv::Mat& grey, const cv::Point2d& start,
                        const std::vector<cv::Point2d>& neighbours, const SpotWindow& window,
                        model::Psf psf);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_SPOT_MOMENTS_H_

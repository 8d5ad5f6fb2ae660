#ifndef THICKLENS_CALIB_EDGE_SPREAD_H_
#define THICKLENS_CALIB_EDGE_SPREAD_H_

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "thicklens/model/camera.h"

namespace thicklens::calib {

// A blur sigma, px per axis, second moment, without the pixel box, and its standard deviation from
// the residuals of the fit.
struct BlurSigma {
  double sigma_px = 0;
  double error_px = 0;
};

// A straight edge or an X corner (two edges that cross, opposite quadrants alike) in a frame.
struct EdgeFeature {
  enum class Kind { kEdge, kCorner } kind = Kind::kEdge;
  Eigen::Vector2d centre_px{0, 0};
  // kEdge: direction of its normal, from dark to bright, rad from the x axis, and its half length.
  // kCorner: direction of the normal of the more vertical of the two edges.
  double angle_rad = 0;
  double half_length_px = 0;
  double half_width_px = 0;  // how far the two plateaus reach undisturbed on each side
};

// Isolated straight edges (longer than they are blurred, a plateau on each side) and X corners of a
// frame, strongest first, at most `most`. `grey` is CV_32F, linear light.
std::vector<EdgeFeature> FindEdges(const cv::Mat& grey, int most);

// Blur of one feature. The pixels themselves are fitted, unbinned: the step's two levels (each a
// plane, so that a lamp's slope does no harm, and of an edge at least half as long as the frame's
// shorter side with a bend, so that a lens's darkening does none), place, direction and blur, with
// the profile integrated over the pixel's box for the edge's direction. kGaussian: the profile is
// an erf. kDisc: a disc blurred by a Gaussian of `floor_px`, so that sigma^2 = floor^2 +
// (radius/2)^2.
struct EdgeSpreadFit {
  // Along the normal of an edge. Of a corner: of each of its two edges, the more vertical one
  // first; an edge that is more vertical gives `across_x`, the other `across_y`.
  std::optional<BlurSigma> across_x, across_y;
  EdgeFeature feature;      // as refined by the fit
  double chi2_per_dof = 0;  // against the noise of the plateaus
  // The edge's profile for a report, of edges alone: distance px, level 0 to 1, and the fit.
  std::vector<double> distance_px, level, fitted;
};
// Nothing if the fit does not converge, the feature leaves the frame or the residual shows that it
// is no such feature. With `want_profile` the last three vectors are filled.
std::optional<EdgeSpreadFit> FitEdgeSpread(const cv::Mat& grey, const EdgeFeature& feature,
                                           model::Psf psf, double floor_px, bool want_profile);

// All features of a frame together: weighted, robust medians along x and along y and of both.
struct FrameEdgeSpread {
  std::optional<BlurSigma> across_x, across_y;
  BlurSigma both;
  int features = 0;
};
// Nothing where no feature can be fitted.
std::optional<FrameEdgeSpread> MeasureEdgeSpread(const cv::Mat& grey, model::Psf psf,
                                                 double floor_px);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_EDGE_SPREAD_H_

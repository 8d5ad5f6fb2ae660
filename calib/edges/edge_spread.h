#ifndef THICKLENS_CALIB_EDGES_EDGE_SPREAD_H_
#define THICKLENS_CALIB_EDGES_EDGE_SPREAD_H_

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "thicklens/model/camera.h"

namespace thicklens::calib {

// A blur sigma in px per axis (second moment, without the pixel box) and its standard deviation,
// which is computed from the residuals of the fit.
struct BlurSigma {
  double sigma_px = 0;
  double error_px = 0;
};

// A straight edge or an X corner (two edges that cross; opposite quadrants are equal) in a frame.
struct EdgeFeature {
  enum class Kind { kEdge, kCorner } kind = Kind::kEdge;
  Eigen::Vector2d centre_px{0, 0};
  // kEdge: direction of the edge's normal from dark to bright, rad from the x axis, and the half
  // length of the edge.
  // kCorner: direction of the normal of the more vertical of the two edges.
  double angle_rad = 0;
  double half_length_px = 0;
  double half_width_px = 0;  // undisturbed extent of the plateau on each side
};

// Finds isolated straight edges (longer than their blur, with a plateau on each side) and X corners
// of a frame. Returns at most `most` features, the strongest first. `grey` is CV_32F in linear
// light. Throws Interrupted after a request to stop.
std::vector<EdgeFeature> FindEdges(const cv::Mat& grey, int most);

// Blur of one feature. The fit uses the pixels themselves, without binning. Its parameters are the
// two levels of the step, its place, its direction and its blur. Each level is a plane, so that an
// illumination gradient does not bias the blur. The levels of an edge at least half as long as the
// shorter side of the frame also have a bend, so that vignetting does not bias it. The profile is
// integrated over the pixel's box for the direction of the edge. kGaussian: the profile is an erf.
// kDisc: the profile is that of a disc blurred by a Gaussian of `floor_px`, so that sigma^2 =
// floor^2 + (radius/2)^2.
struct EdgeSpreadFit {
  // Blur along the normal of an edge, or of each of the two edges of a corner, the more vertical
  // one first. An edge that is more vertical gives `across_x`; any other edge gives `across_y`.
  std::optional<BlurSigma> across_x, across_y;
  EdgeFeature feature;      // the feature as refined by the fit
  double chi2_per_dof = 0;  // relative to the noise of the plateaus
  // The profile of an edge for a report (empty for a corner): distance in px, level from 0 to 1,
  // and the fitted level.
  std::vector<double> distance_px, level, fitted;
};
// Fits one feature of `grey` (CV_32F, linear light). Returns std::nullopt if the fit does not
// converge, if the feature leaves the frame, or if the residual shows that it is no such feature.
// The last three vectors of the result are filled only if `want_profile` is true. Throws
// Interrupted after a request to stop.
std::optional<EdgeSpreadFit> FitEdgeSpread(const cv::Mat& grey, const EdgeFeature& feature,
                                           model::Psf psf, double floor_px, bool want_profile);

// Result of all features of a frame: weighted, robust medians along x, along y and of both axes.
struct FrameEdgeSpread {
  std::optional<BlurSigma> across_x, across_y;
  BlurSigma both;
  int features = 0;
};
// Measures all features of `grey` (CV_32F, linear light). Returns std::nullopt where no feature can
// be fitted. Throws Interrupted after a request to stop.
std::optional<FrameEdgeSpread> MeasureEdgeSpread(const cv::Mat& grey, model::Psf psf,
                                                 double floor_px);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_EDGES_EDGE_SPREAD_H_

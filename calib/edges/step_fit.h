#ifndef THICKLENS_CALIB_EDGES_STEP_FIT_H_
#define THICKLENS_CALIB_EDGES_STEP_FIT_H_

#include <cmath>
#include <optional>

#include "calib/edges/edge_spread.h"
#include "calib/edges/feature_pixels.h"

namespace thicklens::calib {

// Half the width of the fitted strip, which contains the edge and enough of both plateaus to
// determine their slopes.
inline double StripHalfWidthPx(double sigma_px) { return 5.5 * sigma_px + 6; }
// Minimum half width. Narrower plateaus do not separate blur from slope.
inline double LeastHalfWidthPx(double sigma_px) { return 2.2 * sigma_px + 1.5; }

inline double SigmaOf(double variance_px2) { return std::sqrt(std::max(variance_px2, 0.0)); }

// Converts a variance, which the fit may have found below 0, to a sigma. The error is the distance
// to the sigma of the variance plus one standard deviation. Its limit for error << variance is
// error/(2 sigma), and for a variance of 0 it is sqrt(error).
inline BlurSigma SigmaWithError(double variance_px2, double error_px2) {
  const double sigma_px = SigmaOf(variance_px2);
  return {sigma_px, std::sqrt(sigma_px * sigma_px + error_px2) - sigma_px};
}

// Whether the blur is known well enough to be called measured.
inline bool IsDetermined(const BlurSigma& blur) {
  return blur.error_px < 0.1 + 0.1 * blur.sigma_px;
}

// FitEdgeSpread for an edge and for a corner. Throws Interrupted after a request to stop.
std::optional<EdgeSpreadFit> FitEdge(const cv::Mat& grey, const EdgeFeature& feature,
                                     model::Psf psf, double floor_px, bool want_profile);
std::optional<EdgeSpreadFit> FitCorner(const cv::Mat& grey, const EdgeFeature& feature,
                                       model::Psf psf, double floor_px);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_EDGES_STEP_FIT_H_

#ifndef THICKLENS_CALIB_EDGE_BLUR_H_
#define THICKLENS_CALIB_EDGE_BLUR_H_

#include <opencv2/core/mat.hpp>
#include <optional>

#include "thicklens/model/camera.h"

namespace thicklens::calib {

// Blur of a frame at its edges after Zhuo & Sim 2011: the frame is blurred once more by a known
// Gaussian of sigma0; at an ideal step edge of blur sigma the gradient falls by the ratio
// R = sqrt((sigma^2 + sigma0^2)/sigma^2), so sigma = sigma0/sqrt(R^2 - 1).

// As the source has it: sigma0 = 1, gradient magnitudes at the edge pixels as they are, the median
// over the edges. It includes the pixel box (1/12 px^2) and the blur of the difference operator
// (1/3 px^2), which is why it is nearly flat below 0.7 px.
struct SourceEdgeBlur {
  double sigma_px = 0;
  int edge_count = 0;
};
std::optional<SourceEdgeBlur> MeasureSourceEdgeBlur(const cv::Mat& grey);

// A blur variance sigma^2, px^2, without the pixel box; below 0 where a texture looks sharper than
// a step edge. The error is a standard deviation, from the scatter over the edges.
struct EdgeVariance {
  double variance_px2 = 0;
  double error_px2 = 0;
  int edge_count = 0;
};

// The same ratio at the interpolated crest of the gradient, with the pixel box and the operator's
// own variance taken out. The frame is smoothed first against noise, by a Gaussian that is taken
// out too. Exact at isolated straight edges of any direction, for blurs up to about
// `reblur_sigma_px` times 2.
struct EdgeScale {
  double smoothing_sigma_px = 0;
  double reblur_sigma_px = 0;
};
inline constexpr EdgeScale kFineEdges{1, 2};
inline constexpr EdgeScale kCoarseEdges{2, 4};
// Nothing where fewer than 12 edges are found. `grey` is CV_32F.
std::optional<EdgeVariance> MeasureEdgeVariance(const cv::Mat& grey, const EdgeScale& scale);

// The fine scale, or the coarse one where the blur is too large for it.
std::optional<EdgeVariance> MeasureEdgeVariance(const cv::Mat& grey);

// The change of the reading over the change of the true variance when the frame is blurred by a
// known amount through the exact transfer function of the PSF. 1 at isolated edges, so that
// readings are absolute; about 0.6 between the edges of a texture, where the ratio is no longer a
// lone step's. Nothing where the frame has too few edges.
std::optional<double> EdgeMeterSlope(const cv::Mat& grey, double noise_sigma, model::Psf psf);

// How much more a frame is blurred than a reference frame of the same target, whatever the texture:
// the reference is brought to the frame's size (`scale`: the frame's over the reference's) and
// blurred by known amounts, through the exact transfer function of the PSF, until the meter reads
// the same. The result is tau^2 = (sigma^2 + 1/12) - scale^2 (sigma_ref^2 + 1/12), px^2 of the
// frame, below 0 where the frame is the sharper one. `noise_sigma` is that of a pixel of `frame`;
// the reference gets as much. Nothing where there are too few edges or the frame is blurred beyond
// the meter's range.
std::optional<EdgeVariance> MeasureAddedVariance(const cv::Mat& reference, const cv::Mat& frame,
                                                 double scale, cv::Point2d centre,
                                                 double noise_sigma, model::Psf psf);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_EDGE_BLUR_H_

#ifndef THICKLENS_ESTIMATOR_SCENE_SCENE_DATA_H_
#define THICKLENS_ESTIMATOR_SCENE_SCENE_DATA_H_

#include <Eigen/Core>
#include <vector>

#include "estimator/projection/scene_projection.h"
#include "estimator/scene/scene_system.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::estimator {

// Returns H and I of a photograph; weights and squared rows must still be set. `projection` is kept
// by reference.
template <typename Real>
DataTerm<Real> DataTermOf(const SceneProjection<Real>& projection,
                          const model::LinearImage& photograph, int threads);

// Planar converts interleaved pixels to one plane per channel; Interleaved converts them back.
template <typename Real>
std::vector<Real> Planar(const model::LinearImage& image);
template <typename Real>
model::LinearImage Interleaved(const std::vector<Real>& planes, int width_px, int height_px,
                               int channels);

// Returns sum_j H_ij^2 of each pixel i, within a tenth. It is the value for the fan of the pixel's
// own disparity on one surface, linear between pixels, with the products of the sums of the weights
// over rows and over columns as weights.
template <typename Real>
std::vector<Real> SquaredRows(const DisparityMap& disparity, const Eigen::ArrayXXd& weights);

// Returns W of each pixel [D102]: s^2/(1 + (20 h)^2), h the share of the aperture that sees past an
// edge. Without `disocclusion_weights` h is 0.
template <typename Real>
std::vector<Real> DataWeights(const std::vector<Real>& slope_squared,
                              const std::vector<float>& occluded_fraction,
                              bool disocclusion_weights);

// Returns the standard deviation of the blur of each pixel, px: the root mean square over both
// axes.
std::vector<float> BlurSigmaPx(const DisparityMap& disparity, const Eigen::ArrayXXd& weights);

// H r - I in encoded values in some rows: the mean of the channels at each pixel (0 in other rows),
// and the rms of all; 0 where H r is above a lower bound.
struct EncodedResidual {
  std::vector<float> mean;
  double rms = 0;
};
template <typename Real>
EncodedResidual EncodedResidualOf(const DataTerm<Real>& data, const std::vector<Real>& radiance,
                                  const model::TransferCurve& transfer, int first_row,
                                  int last_row);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_SCENE_DATA_H_

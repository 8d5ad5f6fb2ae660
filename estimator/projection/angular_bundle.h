#ifndef THICKLENS_ESTIMATOR_PROJECTION_ANGULAR_BUNDLE_H_
#define THICKLENS_ESTIMATOR_PROJECTION_ANGULAR_BUNDLE_H_

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "thicklens/estimator/view_geometry.h"
#include "thicklens/kernels/image_filter.h"

namespace thicklens::estimator {

struct BundleView {
  double a = 0, b = 0;  // steps from the centre
  double weight = 0;
  CompactView sees;
};

// All rays of the aperture through the pixels of a photograph.
struct AngularBundle {
  int width_px = 0, height_px = 0;
  std::vector<BundleView> views;  // the views with a weight > 0, row by row
};
double BytesOf(const AngularBundle& bundle);
// Returns the view that is so many steps from the centre; null if it has no weight.
const CompactView* ViewAt(const AngularBundle& bundle, double a, double b);
AngularBundle RenderBundle(const DisparityMap& disparity, const Eigen::ArrayXXd& weights,
                           int threads, const std::function<void()>& progress);

// The origin of the rays of a column or a row of the aperture if the bundle is a product: px to the
// source, along one axis, for each of `count` positions on it. NaN at all positions: at one of them
// that point is not on the pixel's surface.
struct BundleAxis {
  int count = 0;
  std::vector<std::vector<float>> source_px;  // [position][pixel]
  std::vector<unsigned char> usable;          // per pixel: usable at all positions
};
struct BundleAxes {
  BundleAxis across, down;
};
BundleAxes AxesOf(const AngularBundle& bundle, const DisparityMap& disparity, int u_count,
                  int v_count, int threads);

// Returns for each pixel whether the product of the axes places every ray of the bundle correctly,
// to a tolerance, on taps of one surface inside the image. Pixels with `known` set are not
// examined.
std::vector<unsigned char> IsProduct(const AngularBundle& bundle, const BundleAxes& axes,
                                     const DisparityMap& disparity, double tolerance_px,
                                     const std::vector<unsigned char>& known, int threads);

// Interpolation of an image between its pixels.
enum class Interpolation {
  kLinear,
  kCubic,  // cubic where the pixels read are of one surface; linear elsewhere
};

// Returns the filter of one axis: pixel p gets sum_i weights_i x(p + source_i). kCubic requires
// four pixels of p's surface in the line of the axis. Pixels without an axis get sum_i weights_i
// x(p).
template <typename Real>
kernels::VaryingFilter<Real> FilterOf(const BundleAxis& axis, kernels::Axis direction,
                                      const DisparityMap& disparity, const Eigen::VectorXd& weights,
                                      Interpolation interpolation, int threads);

// Returns the rows of the pixels that are no product, linear between the pixels of a ray's surface.
// The rows are made in parts of whole image rows, each by one thread, and are then joined. A part
// has an eighth of a thread's share of these pixels, plus the excess of the last of its rows.
// `freed` (may be empty) is called, from any thread, whenever a part has been freed.
constexpr int kPartsOfAThread = 8;
template <typename Real>
kernels::PixelBlockedCsr<Real> RunsOf(const AngularBundle& bundle, const DisparityMap& disparity,
                                      const std::vector<unsigned char>& is_product, int threads,
                                      const std::function<void()>& freed);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_PROJECTION_ANGULAR_BUNDLE_H_

#ifndef THICKLENS_ESTIMATOR_PROJECTION_VIEW_FAN_H_
#define THICKLENS_ESTIMATOR_PROJECTION_VIEW_FAN_H_

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "thicklens/estimator/view_geometry.h"
#include "thicklens/kernels/picture_filter.h"

namespace thicklens::estimator {

struct FanView {
  double a = 0, b = 0;  // steps from the centre
  double weight = 0;
  CompactView sees;
};

// All rays of the aperture through the pixels of a photograph.
struct ViewFan {
  int width_px = 0, height_px = 0;
  std::vector<FanView> views;  // those with a weight, row by row
};
double BytesOf(const ViewFan& fan);
// The view that is so many steps from the centre; null if it has no weight.
const CompactView* ViewAt(const ViewFan& fan, double a, double b);
ViewFan RenderFan(const DisparityMap& disparity, const Eigen::ArrayXXd& weights, int threads,
                  const std::function<void()>& progress);

// Where the rays of a column or a row of the aperture come from, if the fan is a product: px to the
// source, along one axis, for each of `count` positions on it. NaN, at all positions: at one of
// them it is not on the pixel's surface.
struct FanAxis {
  int count = 0;
  std::vector<std::vector<float>> source_px;  // [position][pixel]
  std::vector<unsigned char> usable;          // per pixel: at all positions
};
struct FanAxes {
  FanAxis across, down;
};
FanAxes AxesOf(const ViewFan& fan, const DisparityMap& disparity, int u_count, int v_count,
               int threads);

// For each pixel whether the product of the axes puts every ray of the fan where it belongs, to a
// tolerance, on taps of one surface inside the picture. Those that are known to be are not looked
// at.
std::vector<unsigned char> IsProduct(const ViewFan& fan, const FanAxes& axes,
                                     const DisparityMap& disparity, double tolerance_px,
                                     const std::vector<unsigned char>& known, int threads);

// How a picture is read between its pixels.
enum class Between {
  kLinear,
  kCubic,  // where the pixels that it takes are of one surface; linear elsewhere
};

// The filter of one axis: pixel p gets sum_i weights_i x(p + source_i). kCubic asks for four pixels
// of p's surface in the line of the axis. Pixels without an axis get sum_i weights_i x(p).
template <typename Real>
kernels::PixelFilter<Real> FilterOf(const FanAxis& axis, kernels::Axis direction,
                                    const DisparityMap& disparity, const Eigen::VectorXd& weights,
                                    Between between, int threads);

// The rows of the pixels that are no product, linear between the pixels of a ray's surface. They
// are made in parts of whole rows of the picture, which are then put together, each by one thread:
// a part has an eighth of a thread's share of these pixels, and what more the last of its rows has.
// `freed` (may be empty) is called, from any thread, whenever one of them is no longer.
constexpr int kPartsOfAThread = 8;
template <typename Real>
kernels::PixelRuns<Real> RunsOf(const ViewFan& fan, const DisparityMap& disparity,
                                const std::vector<unsigned char>& is_product, int threads,
                                const std::function<void()>& freed);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_PROJECTION_VIEW_FAN_H_

#ifndef THICKLENS_MODEL_SIMULATE_SWEEP_RELIEF_IMAGE_H_
#define THICKLENS_MODEL_SIMULATE_SWEEP_RELIEF_IMAGE_H_

#include <Eigen/Core>
#include <functional>
#include <opencv2/core.hpp>
#include <vector>

#include "thicklens/model/camera.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::model {

// The target, or a part that stands out of it, in a frame. The images are CV_64F and of one size.
struct ReliefLayer {
  cv::Mat light;    // in focus, as if nothing hid it, over the whole image
  cv::Mat blurred;  // `light` through the defocus; of the target alone
  cv::Mat cover;    // part of each sample that the layer covers, 0 to 1; of the parts alone
  // Defocus, with its sign: the light of a point through the aperture position a, in units of its
  // standard deviation on the aperture, lands a defocus_px beside the chief ray. Px of the frame.
  double defocus_px = 0;
};

// Transfer function of a defocus of a standard deviation, px, at a frequency in cycles per px.
using TransferOfDefocus = std::function<double(double sigma_px, const Eigen::Vector2d& frequency)>;

// The light of a target with parts in front of it, on samples `step_px` apart that repeat
// themselves beyond the borders, CV_64F. Through one aperture position a each layer is displaced by
// its own a defocus_px, and a part hides the target behind it. The mean over the aperture is
//   I = B + sum_l [k_l * (c_l F_l) - C_l B - cov_a(c_l, B)]                                  [D166]
// with B = k_0 * light of the target, F_l the light of a part, c_l its cover, C_l = k_l * c_l and
// k the defocus of each layer. Only the covariance over the aperture needs its positions. It is 0
// except near outlines, where either image varies over the aperture, and is the mean over 192
// positions there. Parts do not hide one another.
cv::Mat ReliefImage(const ReliefLayer& target, const std::vector<ReliefLayer>& parts,
                    double step_px, Psf psf, const TransferOfDefocus& transfer);

// The part of a square of side `cell_mm` around a place that a part covers, 0 to 1. The place is
// relative to the target's centre, in the plane of the part, mm.
double CoverAt(const ReliefPartOptions& part, const Eigen::Vector2d& place_mm, double cell_mm);

// The image (CV_64F) with every frequency, in cycles per px, multiplied by a transfer function.
cv::Mat Filtered(const cv::Mat& image, double step_px,
                 const std::function<double(const Eigen::Vector2d& frequency)>& transfer);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SWEEP_RELIEF_IMAGE_H_

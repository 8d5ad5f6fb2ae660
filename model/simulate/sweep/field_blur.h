#ifndef THICKLENS_MODEL_SIMULATE_SWEEP_FIELD_BLUR_H_
#define THICKLENS_MODEL_SIMULATE_SWEEP_FIELD_BLUR_H_

#include <Eigen/Core>
#include <functional>
#include <opencv2/core/mat.hpp>

#include "thicklens/model/camera.h"
#include "thicklens/model/pupil_law.h"

namespace thicklens::model {

// A pupil whose blur varies over the field.
struct FieldBlur {
  Psf psf = Psf::kGaussian;
  const PupilProfile* profile = nullptr;  // the shape of the blur if it is not that of `psf`
  // The blur of a point whose chief ray lands at a position of the image, in samples of the image:
  // a blur with a sigma of 1 px, transformed by this symmetric matrix, px.
  std::function<Eigen::Matrix2d(const Eigen::Vector2d&)> map_px;
  double floor_sigma_px = 0;  // of the image: frequencies that it removes need no exact blur
};

// Blurs an image (CV_64F, samples `step_px` apart) that repeats itself beyond its borders: each
// point spreads its light by the blur of its own place, so that no light is lost or displaced.
// Where the blur grows, an even field is then not quite even: it changes by half of the Laplacian
// of the variance, below 1 % for a variance of 100 px^2 at 200 px from the axis.
//
// The transfer function of each place is a sum of those of a few places with weights,
// T(f; q) = sum_k w_k(q) T(f; q_k) [D151], so that the image is sum_k h_k * (w_k S). The places are
// those of a QR decomposition with column pivoting of the transfer functions of a grid of places;
// the weights are from least squares. The error of the transfer function, behind floor and pixel
// box, is about 5e-5 in the root mean square over all frequencies.
cv::Mat Blurred(const cv::Mat& image, double step_px, const FieldBlur& blur);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SWEEP_FIELD_BLUR_H_

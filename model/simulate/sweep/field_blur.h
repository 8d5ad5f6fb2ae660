#ifndef THICKLENS_MODEL_SIMULATE_SWEEP_FIELD_BLUR_H_
#define THICKLENS_MODEL_SIMULATE_SWEEP_FIELD_BLUR_H_

#include <Eigen/Core>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "model/simulate/sweep/periodic_image.h"

namespace thicklens::model {

// A blur that varies over the field, as a sum of images with one blur each: the blurs of a few
// places of the field, each with a weight at every pixel. The places are those of an interpolative
// decomposition (a QR decomposition with column pivoting) of the transfer functions at a grid of
// places, and the weights of every other place are from least squares [D151]. The error of the
// transfer function, with floor and pixel box, is below 1e-3 in the root mean square over all
// frequencies.
struct FieldBlur {
  std::vector<FrameBlur> blurs;
  std::vector<cv::Mat> weights;  // CV_32F, height x width, one per blur
};

// `blur_at` gives the blur at a position in px, (0, 0) the centre of the first pixel.
FieldBlur DecomposeBlur(cv::Size size,
                        const std::function<FrameBlur(const Eigen::Vector2d&)>& blur_at);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SWEEP_FIELD_BLUR_H_

#ifndef THICKLENS_CALIB_RESPONSE_RESPONSE_FRAMES_H_
#define THICKLENS_CALIB_RESPONSE_RESPONSE_FRAMES_H_

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "calib/registration/image_scale.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

// A frame with its place on the target and its blur.
struct ResponseFrame {
  std::size_t frame = 0;      // index into the sweep
  Registration registration;  // relative to the common reference
  double variance_px2 = 0;    // variance of the defocus blur, px^2 of this frame, without the floor
  // Linear light at and beyond which the values are clipped.
  double darkest = -1, brightest = 2;
  // CV_8U of the size of the frame, not 0 where a value comes from the pixels around it, so that
  // detail is missing there; empty: nowhere.
  cv::Mat filled = cv::Mat();
};

// The frames whose response is measured. All have one size.
struct ResponseFrames {
  std::function<cv::Mat(std::size_t)> read_grey;  // linear light, CV_32F, by the index in the sweep
  std::vector<ResponseFrame> frames;
  cv::Point2d centre;                      // of the registrations, px
  model::Psf psf = model::Psf::kGaussian;  // shape of the defocus blur
  std::function<void()> tick = [] {};      // called for each frame that is read; may throw
};

// The middle of a frame, at most 512 px wide and high, and the same part of each other frame.
class ResponseCrop {
 public:
  ResponseCrop(const ResponseFrames& frames, cv::Size whole);

  cv::Size size() const { return part_.size(); }
  // Reads the part of one frame. `index` counts in ResponseFrames::frames.
  cv::Mat Read(std::size_t index) const;
  // The place in frame `to` of what frame `from` shows at p, px of the crop.
  Eigen::Vector2d Place(std::size_t from, std::size_t to, const Eigen::Vector2d& p) const;
  // An image in the geometry of frame `of`, as seen in the geometry of frame `as`.
  cv::Mat Seen(const cv::Mat& image, std::size_t of, std::size_t as) const;
  // Scale of frame `of` relative to frame `to`.
  double Scale(std::size_t of, std::size_t to) const;
  // The blur variance by which frame `of` exceeds frame `than` in the geometry of `of`, px^2.
  double AddedVariancePx2(std::size_t of, std::size_t than) const;

 private:
  const ResponseFrames& frames_;
  cv::Rect part_;
  Eigen::Vector2d centre_;
};

// 1 where the values of the frame are clipped or filled, 0 where they are not, CV_32F. `image` is
// the middle part of the frame, as ResponseCrop reads it.
cv::Mat ClippedPixels(const cv::Mat& image, const ResponseFrame& frame);

// Gaussian blur of an image of any number of pixels per sigma; none for sigma 0.
cv::Mat GaussianOf(const cv::Mat& image, double sigma_px);

// The image blurred by a shape of that variance.
cv::Mat BlurredByShape(const cv::Mat& image, double variance_px2, model::Psf psf);

// Indices into `frames` in the order of their blur on the target, the sharpest first.
std::vector<std::size_t> BySharpness(const ResponseFrames& frames);

// At most `count` of the indices, evenly spread over them.
std::vector<std::size_t> Spread(const std::vector<std::size_t>& indices, std::size_t count);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_RESPONSE_RESPONSE_FRAMES_H_

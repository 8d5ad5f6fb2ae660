#ifndef THICKLENS_CALIB_FRAME_CORRECTION_H_
#define THICKLENS_CALIB_FRAME_CORRECTION_H_

#include <cstddef>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "thicklens/base/export.h"

namespace thicklens::calib {

// The traits of a sensor that stay in place, and how a frame is freed of them: from linear light
// the dark is subtracted, the difference is divided by the flat, and the pixels that are defective
// are interpolated from those around them. The division raises the noise where the flat is below
// its mean, in proportion. Several threads may use one correction.
class THICKLENS_EXPORT FrameCorrection {
 public:
  // A pixel whose flat is below this part of the flat's mean has no light to be divided by.
  static constexpr double kMinFlat = 0.02;

  // Takes images of one size, in linear light with full scale 1, CV_32F with 1 or 3 channels, and
  // a mask, CV_8U, which is not 0 where a pixel is defective. Each may be empty: there is none. The
  // dark is subtracted from the flat too. Each channel of the flat is divided by its mean over the
  // pixels that are not defective, so that a frame keeps its levels and colours. Pixels whose flat
  // is below kMinFlat of that mean become defects. Throws Error for other types, for sizes or
  // numbers of channels that differ, for values that are not finite, for a flat that is nowhere
  // above the dark, if more than half of the pixels are defective, and for a hole of
  // more than 32 px to each side in `defects`. Such a hole of the flat stays as it is.
  FrameCorrection(const cv::Mat& dark, const cv::Mat& flat, const cv::Mat& defects);

  // Size of the images, px; empty if there are none.
  cv::Size size_px() const { return size_px_; }
  // Number of channels of dark and flat; 0 if there is neither.
  int channels() const { return channels_; }
  // The light that is subtracted, CV_32F; empty: none.
  const cv::Mat& dark() const { return dark_; }
  // The factors of the light: the mean of the flat over the flat, CV_32F; empty: 1.
  const cv::Mat& gain() const { return gain_; }
  // The pixels that are replaced, CV_8U with 0 and 255; empty: none.
  const cv::Mat& defects() const { return defects_; }
  // How many pixels are replaced.
  std::size_t defect_count() const { return replaced_.size(); }
  // How many of them are replaced because of their flat alone.
  std::size_t unlit_count() const { return unlit_; }

  // Subtracts the dark and divides by the flat in one channel of a whole frame, CV_32FC1, in linear
  // light. A correction of one channel serves every channel. Throws Error if the size is another or
  // the correction has no such channel.
  void Apply(int channel, cv::Mat* light) const;
  // Replaces the defects of a whole frame, CV_32FC1. A defect gets the mean of the sound pixels
  // around its hole, weighted by one over the square of their distance. On a disc this is Poisson's
  // formula, the interpolation that satisfies Laplace's equation. Throws Error if the size is
  // another.
  void ReplaceDefects(cv::Mat* light) const;

 private:
  void TakeFlat(const cv::Mat& flat);
  // `given` are the defects that the caller stated.
  void FindNeighbours(const cv::Mat& given);
  void RequireSize(const cv::Mat& light) const;

  cv::Size size_px_;
  int channels_ = 0;
  cv::Mat dark_, gain_, defects_;
  std::size_t unlit_ = 0;
  // A pixel that is replaced, and where its neighbours begin in `neighbours_`.
  struct Replaced {
    int pixel = 0;
    std::size_t first = 0;
  };
  struct Neighbour {
    int pixel = 0;
    float weight = 0;  // those of a pixel sum up to 1
  };
  std::vector<Replaced> replaced_;
  std::vector<Neighbour> neighbours_;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FRAME_CORRECTION_H_

#ifndef THICKLENS_CALIB_SPECTRUM_WINDOW_LEAKAGE_H_
#define THICKLENS_CALIB_SPECTRUM_WINDOW_LEAKAGE_H_

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "calib/spectrum/frame_spectrum.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

// Effect of the window's edge on a blurred image: the spectrum of the blurred image seen through
// the window minus the blurred spectrum of the image seen through it. It is computed from the
// reference frame (which is sharp and therefore represents the target), as a function of the added
// blur.
class WindowLeakage {
 public:
  WindowLeakage() = default;
  // `largest_sigma_px` is the end of the table. `spectrum` is that of the reference. `axes` are 1
  // for the axes along which the image is blurred, and 0 for the others; the first of them is
  // turned by `angle_rad` from x towards y.
  WindowLeakage(const cv::Mat& reference, const Eigen::Vector2d& origin_px,
                const TargetWindow& window, const std::vector<Mode>& modes,
                const FrameSpectrum& spectrum, model::Psf psf, double largest_sigma_px, int threads,
                const Eigen::Vector2d& axes = {1, 1}, double angle_rad = 0);
  // One leakage for each of `axes`, from one transform of the reference.
  static std::vector<WindowLeakage> AlongAxes(
      const cv::Mat& reference, const Eigen::Vector2d& origin_px, const TargetWindow& window,
      const std::vector<Mode>& modes, const FrameSpectrum& spectrum, model::Psf psf,
      double largest_sigma_px, int threads, const std::vector<Eigen::Vector2d>& axes,
      double angle_rad = 0);

  // The leakage at the first `count` modes for a blur of `variance_px2` beyond that of the
  // reference; 0 for no added blur.
  Eigen::ArrayXcd At(double variance_px2, std::size_t count) const;

  // The table for a subset of the modes, given by their indices in ascending order.
  WindowLeakage Of(const std::vector<Eigen::Index>& modes) const;

 private:
  double step_px_ = 0;                  // step of sigma between the nodes
  std::vector<Eigen::ArrayXcd> nodes_;  // fewer modes at strong blur; the rest is 0
};

// The leakage of a blur along the first axis alone (x, unless the axes are turned), and of one
// along the second axis alone.
struct AxisLeakage {
  WindowLeakage x, y;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SPECTRUM_WINDOW_LEAKAGE_H_

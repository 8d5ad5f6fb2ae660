#ifndef THICKLENS_CALIB_SPECTRUM_WINDOW_LEAKAGE_H_
#define THICKLENS_CALIB_SPECTRUM_WINDOW_LEAKAGE_H_

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "calib/spectrum/frame_spectrum.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

// What the window's edge does to a blurred picture: the spectrum of the blurred picture seen
// through the window minus the blurred spectrum of the picture seen through it, from the reference
// frame (sharp, so it stands for the target), as a function of the added blur.
class WindowLeakage {
 public:
  WindowLeakage() = default;
  // `largest_sigma_px`: how far the table reaches. `spectrum` is that of the reference.
  WindowLeakage(const cv::Mat& reference, const Eigen::Vector2d& origin_px,
                const TargetWindow& window, const std::vector<Mode>& modes,
                const FrameSpectrum& spectrum, model::Psf psf, double largest_sigma_px,
                int threads);

  // At the first `count` modes for a blur of `variance_px2` beyond the reference's; 0 for none.
  Eigen::ArrayXcd At(double variance_px2, std::size_t count) const;

  // The table of some of the modes alone, given by their indices in rising order.
  WindowLeakage Of(const std::vector<Eigen::Index>& modes) const;

 private:
  double step_px_ = 0;                  // of sigma, between the nodes
  std::vector<Eigen::ArrayXcd> nodes_;  // may hold fewer modes at strong blur: the rest is 0
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SPECTRUM_WINDOW_LEAKAGE_H_

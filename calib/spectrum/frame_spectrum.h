#ifndef THICKLENS_CALIB_SPECTRUM_FRAME_SPECTRUM_H_
#define THICKLENS_CALIB_SPECTRUM_FRAME_SPECTRUM_H_

#include <Eigen/Core>
#include <complex>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

namespace thicklens::calib {

// Position of a frame relative to the reference: p_frame = origin + shift + scale (p_ref - origin),
// px. `origin` is the principal point in both. X = p_ref - origin are the target coordinates.
struct FramePlace {
  double scale = 1;
  Eigen::Vector2d shift_px{0, 0};
};

// A Hann window on the target: cos^2(pi (X - centre)/size) per axis, 0 beyond size/2.
struct TargetWindow {
  Eigen::Vector2d centre_px{0, 0};  // X of its centre
  Eigen::Vector2d size_px{0, 0};
};

// The frequency of a mode is (jx/size_x, jy/size_y), cycles per target px. One mode of each
// conjugate pair is kept: jx > 0, or jx = 0 and jy > 0.
struct Mode {
  int jx = 0, jy = 0;
};
Eigen::Vector2d ModeFrequency(const Mode& mode, const TargetWindow& window);

// The modes with low < |nu| < high, cycles per target px, in the order of |nu|. Only every second
// mode along each axis is returned. Neighbouring modes share two thirds of their noise through the
// window, and every second one a sixth. The omitted modes would add a tenth to the information.
std::vector<Mode> ModesBetween(const TargetWindow& window, double low, double high);

// The window's Fourier integral of a frame [D76], relative to its mean:
//   G(nu) = sum w(X) (I/mu - 1) exp(-2 pi i nu.X) / box(nu),  sum w = 1, mu = sum w I.
// The sum is over the frame's own pixels at their target coordinates (no resampling). The pixel box
// sinc(nu_x/scale) sinc(nu_y/scale) is divided out.
struct FrameSpectrum {
  Eigen::ArrayXcd values;  // one value per requested mode, from the first one on
  double mean = 0;         // mu
  // Variance of a value, before the division by the box, per variance of a pixel: sum w^2 / mu^2.
  double noise_gain = 0;
};

// Measures the spectrum of `grey` (CV_32F) at the first `count` of `modes`. Returns std::nullopt
// where the window leaves the frame or its mean is not positive.
std::optional<FrameSpectrum> MeasureSpectrum(const cv::Mat& grey, const Eigen::Vector2d& origin_px,
                                             const FramePlace& place, const TargetWindow& window,
                                             const std::vector<Mode>& modes, std::size_t count);

// Measures the same of an image whose pixel p shows the target at X = (p - origin)/scale, with a
// scale along each axis, and without the division by the box of a pixel.
std::optional<FrameSpectrum> MeasureSums(const cv::Mat& image, const Eigen::Vector2d& origin_px,
                                         const Eigen::Vector2d& scale, const TargetWindow& window,
                                         const std::vector<Mode>& modes, std::size_t count);

// Transfer function of the pixel's box at a mode, for a frame of that scale.
double BoxTransfer(const Mode& mode, const TargetWindow& window, double scale);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SPECTRUM_FRAME_SPECTRUM_H_

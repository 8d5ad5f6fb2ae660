#ifndef THICKLENS_MODEL_SIMULATE_SWEEP_PERIODIC_IMAGE_H_
#define THICKLENS_MODEL_SIMULATE_SWEEP_PERIODIC_IMAGE_H_

#include <Eigen/Core>
#include <complex>
#include <functional>
#include <opencv2/core.hpp>
#include <vector>

#include "thicklens/model/camera.h"
#include "thicklens/model/pupil_law.h"

namespace thicklens::model {

// Positions of a row (or column) of pixel centres on a periodic image, in periods: pixel j is at
// start + j * step, or at at[j] if they are not evenly spaced.
struct AxisSampling {
  double start = 0;
  double step = 0;
  int count = 0;
  std::vector<double> at = {};  // `count` numbers, or none
};

// Effects on the light between the image and the stored pixel; lengths are in px of the frame,
// which are the steps of the sampling or, if the sampling is finer, pixel_steps steps each.
struct FrameBlur {
  double floor_sigma_px = 0;
  Psf psf = Psf::kGaussian;
  double defocus_sigma_px = 0;
  bool pixel_box = true;  // false: a pixel is the light at its centre
  // The shape of the defocus blur if it is not that of `psf`; not owned.
  const PupilProfile* profile = nullptr;
  double pixel_steps = 1;
  // The transfer function of the defocus at a frequency in cycles per px, for a shape that is not
  // round; it takes the place of `psf`, which is kDisc then. Empty: a round one.
  std::function<std::complex<double>(const Eigen::Vector2d& f)> shape = {};
};

// An image that is a finite Fourier series: it repeats in both directions and is band-limited by
// definition. A blurred, scaled and shifted frame of it is a sum that is computed to rounding
// error, without resampling and without a sampled kernel.
class PeriodicImage {
 public:
  // `samples` is one period, CV_64F, row 0 at y = 0. The series interpolates the samples, except
  // that the highest frequency of an even count, which has no phase of its own, is left out.
  explicit PeriodicImage(const cv::Mat& samples);

  // Returns the image behind blur and pixel box at every pixel centre, CV_64F, y.count x x.count:
  // sum over (a, b) of c(a, b) T(a x.step, b y.step) exp(2 pi i (a x + b y)), where T is the
  // product of the transfer functions; x.step and y.step in it are those of one px. The absolute
  // error is below 1e-9 of the coefficients' norm. Thread safe.
  cv::Mat Evaluate(const AxisSampling& x, const AxisSampling& y, const FrameBlur& blur) const;

  // The coefficient of exp(2 pi i (a x + b y)), a and b from -(count - 1)/2 to (count - 1)/2.
  std::complex<double> Coefficient(int a, int b) const;
  int max_x_frequency() const { return max_x_; }
  int max_y_frequency() const { return max_y_; }

 private:
  int max_x_ = 0;
  int max_y_ = 0;
  // Row b = 0..max_y_, columns a = -max_x_..max_x_; the other half is its conjugate.
  std::vector<std::complex<double>> half_spectrum_;
};

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SWEEP_PERIODIC_IMAGE_H_

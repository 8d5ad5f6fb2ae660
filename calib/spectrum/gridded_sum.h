#ifndef THICKLENS_CALIB_SPECTRUM_GRIDDED_SUM_H_
#define THICKLENS_CALIB_SPECTRUM_GRIDDED_SUM_H_

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <opencv2/core/mat.hpp>
#include <utility>
#include <vector>

namespace thicklens::calib {

// Weighted Fourier sums of a row of samples at any frequencies f in cycles per sample,
//   S(f) = sum over i of w_i v_i exp(-2 pi i f (i - middle)),
// by gridding [D174]: the samples, divided by the transform of a Kaiser-Bessel kernel, are padded
// and transformed by an FFT, and the kernel interpolates between its bins. The error is below 1e-6
// of the sum of |w_i v_i|. The sums of n samples at m frequencies cost n ln(n) + 8 m instead of n
// m.
class GriddedAxis {
 public:
  static constexpr int kTaps = 8;

  // The weights hold one entry per sample, of which there is at least one.
  explicit GriddedAxis(const Eigen::VectorXd& weights);

  int samples() const { return static_cast<int>(factors_.size()); }
  int middle() const { return samples() / 2; }
  int length() const { return length_; }  // of the FFT; even

  // The place of a sample in the input of the FFT, and the factor that it has there.
  int PlaceOf(int sample) const { return (sample - middle() + length_) % length_; }
  float FactorOf(int sample) const { return factors_[static_cast<std::size_t>(sample)]; }

  // The bins from `first` on and their weights, whose sum is S(f). Bins repeat after `length`.
  struct Taps {
    int first = 0;
    std::array<float, kTaps> weights{};
  };
  Taps At(double frequency) const;

 private:
  int length_ = 0;
  std::vector<float> factors_;
};

// Sums over a part of an image along both axes. `pixels` (CV_32F) has one column per sample of x
// and one row per sample of y; `less` is subtracted from every pixel first. The result holds one
// sum for each pair of indices of the frequencies along x and y, in the order of `pairs`.
Eigen::ArrayXcd GriddedSums(const cv::Mat& pixels, float less, const GriddedAxis& x,
                            const GriddedAxis& y, const std::vector<double>& frequencies_x,
                            const std::vector<double>& frequencies_y,
                            const std::vector<std::pair<int, int>>& pairs);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SPECTRUM_GRIDDED_SUM_H_

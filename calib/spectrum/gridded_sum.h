#ifndef THICKLENS_CALIB_SPECTRUM_GRIDDED_SUM_H_
#define THICKLENS_CALIB_SPECTRUM_GRIDDED_SUM_H_

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdlib>
#include <opencv2/core/mat.hpp>
#include <utility>
#include <vector>

namespace thicklens::calib {

// Weighted Fourier sums of a row of samples at the multiples j of one frequency f,
//   S(j) = sum over i of w_i v_i exp(-2 pi i j f (i - middle)),
// by gridding [D174]: a Kaiser-Bessel kernel spreads every sample over the cells that divide one
// period 1/f, an FFT transforms the cells, and the transform of the kernel is divided out. There
// are 3 cells for each order up to the highest, so that the sums at low frequencies need a small
// FFT. The error is below 1e-6 of the sum of |w_i v_i|.
class GriddedAxis {
 public:
  static constexpr int kTaps = 8;

  // The weights hold one entry per sample, of which there is at least one. `step` is f in cycles
  // per sample, and `highest` the largest |j|.
  GriddedAxis(const Eigen::VectorXd& weights, double step, int highest);

  int samples() const { return static_cast<int>(taps_.size()); }
  int middle() const { return samples() / 2; }
  int highest() const { return highest_; }
  int length() const { return length_; }  // cells; even

  // The first cell of a sample and its weights there. Cells repeat after `length`.
  struct Taps {
    int first = 0;
    std::array<float, kTaps> weights{};
  };
  const Taps& Of(int sample) const { return taps_[static_cast<std::size_t>(sample)]; }

  // The bin of the FFT for an order, and the factor that turns it into S.
  int BinOf(int order) const { return order >= 0 ? order : order + length_; }
  double FactorOf(int order) const { return factors_[static_cast<std::size_t>(std::abs(order))]; }

 private:
  int highest_ = 0, length_ = 0;
  std::vector<Taps> taps_;
  std::vector<double> factors_;  // by |j|
};

// Sums over a part of an image along both axes. `pixels` (CV_32F) has one column per sample of x
// and one row per sample of y; `less` is subtracted from every pixel first. The result holds one
// sum for each pair of orders along x and y.
Eigen::ArrayXcd GriddedSums(const cv::Mat& pixels, float less, const GriddedAxis& x,
                            const GriddedAxis& y, const std::vector<std::pair<int, int>>& orders);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SPECTRUM_GRIDDED_SUM_H_

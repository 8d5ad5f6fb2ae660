#include "calib/spectrum/gridded_sum.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <opencv2/core.hpp>

#include "thicklens/base/cancel.h"
#include "thicklens/base/pi.h"

namespace thicklens::calib {
namespace {

constexpr double kOversampling = 1.5;  // least number of cells over that of the orders
constexpr int kColumnsAtOnce = 512;    // a block of columns of some rows stays in the cache
constexpr int kHalfTaps = GriddedAxis::kTaps / 2;

// Beatty's choice for this width and oversampling (IEEE Trans. Med. Imaging 24, 2005, page 799).
double ShapeOfKernel() {
  const double ratio = GriddedAxis::kTaps / kOversampling * (kOversampling - 0.5);
  return kPi * std::sqrt(ratio * ratio - 0.8);
}

// The modified Bessel function I0 by its series, whose terms are all positive. std::cyl_bessel_i is
// missing from some standard libraries.
double BesselI0(double x) {
  double term = 1, sum = 1;
  for (int k = 1; term > 1e-17 * sum; ++k) {
    term *= x * x / (4.0 * k * k);
    sum += term;
  }
  return sum;
}

// The Kaiser-Bessel kernel against the distance in cells, as a table. The straight lines between
// its entries err by less than 1e-8 of the largest value.
class KernelTable {
 public:
  KernelTable() {
    values_.reserve(kHalfTaps * kPerCell + 2);
    for (int i = 0; i <= kHalfTaps * kPerCell + 1; ++i) {
      const double u = static_cast<double>(i) / (kHalfTaps * kPerCell);
      values_.push_back(u < 1 ? BesselI0(ShapeOfKernel() * std::sqrt(1 - u * u)) : 0);
    }
  }
  double At(double distance) const {
    const double place = std::min(std::abs(distance), static_cast<double>(kHalfTaps)) * kPerCell;
    const auto i = static_cast<std::size_t>(place);
    return values_[i] + (place - static_cast<double>(i)) * (values_[i + 1] - values_[i]);
  }

 private:
  static constexpr int kPerCell = 4096;
  std::vector<double> values_;
};

// The transform of the kernel at a frequency in cycles per cell.
double TransformOfKernel(double frequency) {
  const double shape = ShapeOfKernel(), wave = kPi * GriddedAxis::kTaps * frequency;
  const double root = std::sqrt(shape * shape - wave * wave);  // at most 1/3 cycle: positive
  return GriddedAxis::kTaps * std::sinh(root) / root;
}

// Spreads the rows of an image over the cells of an axis along y: one row per cell.
cv::Mat SpreadRows(const cv::Mat& pixels, float less, const GriddedAxis& axis) {
  cv::Mat cells = cv::Mat::zeros(axis.length(), pixels.cols, CV_32F);
  for (int begin = 0; begin < pixels.cols; begin += kColumnsAtOnce) {
    ThrowIfCancelled();
    const int count = std::min(kColumnsAtOnce, pixels.cols - begin);
    for (int row = 0; row < pixels.rows; ++row) {
      const auto* from = pixels.ptr<float>(row) + begin;
      const GriddedAxis::Taps& taps = axis.Of(row);
      int cell = taps.first;
      for (const float weight : taps.weights) {
        auto* to = cells.ptr<float>(cell) + begin;
        for (int i = 0; i < count; ++i) to[i] += weight * (from[i] - less);
        if (++cell == axis.length()) cell = 0;
      }
    }
  }
  return cells;
}

}  // namespace

GriddedAxis::GriddedAxis(const Eigen::VectorXd& weights, double step, int highest)
    : highest_(highest) {
  static const KernelTable kernel;
  length_ = 2 * cv::getOptimalDFTSize(std::max(
                    kTaps, static_cast<int>(std::ceil(0.5 * kOversampling * (2 * highest + 1)))));
  const auto samples = static_cast<int>(weights.size());
  taps_.reserve(static_cast<std::size_t>(samples));
  for (int i = 0; i < samples; ++i) {
    const double periods = step * (i - samples / 2);
    const double place = (periods - std::floor(periods)) * length_;
    const auto before = static_cast<int>(place);
    Taps taps;
    for (int t = 0; t < kTaps; ++t) {
      taps.weights[static_cast<std::size_t>(t)] =
          static_cast<float>(weights[i] * kernel.At(before - kHalfTaps + 1 + t - place));
    }
    taps.first = (before - kHalfTaps + 1 + length_) % length_;
    taps_.push_back(taps);
  }
  for (int j = 0; j <= highest; ++j)
    factors_.push_back(1 / TransformOfKernel(static_cast<double>(j) / length_));
}

Eigen::ArrayXcd GriddedSums(const cv::Mat& pixels, float less, const GriddedAxis& x,
                            const GriddedAxis& y, const std::vector<std::pair<int, int>>& orders) {
  Eigen::ArrayXcd result(static_cast<Eigen::Index>(orders.size()));
  if (orders.empty()) return result;
  cv::Mat cells, transform;
  cv::transpose(SpreadRows(pixels, less, y), cells);
  cells = SpreadRows(cells, 0, x);  // one row per cell of x, one column per cell of y
  ThrowIfCancelled();
  cv::dft(cells, transform, cv::DFT_COMPLEX_OUTPUT);
  for (std::size_t k = 0; k < orders.size(); ++k) {
    const auto [jx, jy] = orders[k];
    const auto bin = transform.at<std::complex<float>>(x.BinOf(jx), y.BinOf(jy));
    result[static_cast<Eigen::Index>(k)] =
        x.FactorOf(jx) * y.FactorOf(jy) * static_cast<std::complex<double>>(bin);
  }
  return result;
}

}  // namespace thicklens::calib

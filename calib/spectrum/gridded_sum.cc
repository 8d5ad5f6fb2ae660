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

constexpr double kOversampling = 1.5;  // least length of the FFT over the number of samples
constexpr int kRowsAtOnce = 32;        // a block of rows stays in the cache

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

// The Kaiser-Bessel kernel at a distance in bins, and its transform at a distance from the middle
// over the length of the FFT.
double Kernel(double distance) {
  const double u = 2 * distance / GriddedAxis::kTaps;
  return u * u < 1 ? BesselI0(ShapeOfKernel() * std::sqrt(1 - u * u)) : 0;
}
double TransformOfKernel(double place) {
  const double shape = ShapeOfKernel(), wave = kPi * GriddedAxis::kTaps * place;
  const double root = std::sqrt(shape * shape - wave * wave);  // place is at most 1/3: positive
  return GriddedAxis::kTaps * std::sinh(root) / root;
}

using Complex = std::complex<float>;

// The bin of the transform of real samples in OpenCV's packed order, of an even length.
Complex PackedBin(const float* packed, int length, int bin) {
  const int at = ((bin % length) + length) % length;
  const int k = std::min(at, length - at);
  if (k == 0) return packed[0];
  if (2 * k == length) return packed[length - 1];
  return {packed[2 * k - 1], at == k ? packed[2 * k] : -packed[2 * k]};
}

Complex Interpolated(const GriddedAxis::Taps& taps, const Complex* bins) {
  Complex sum = 0;
  for (int t = 0; t < GriddedAxis::kTaps; ++t)
    sum += taps.weights[static_cast<std::size_t>(t)] * bins[t];
  return sum;
}

std::vector<GriddedAxis::Taps> TapsOf(const GriddedAxis& axis,
                                      const std::vector<double>& frequencies) {
  std::vector<GriddedAxis::Taps> taps;
  taps.reserve(frequencies.size());
  for (const double f : frequencies) taps.push_back(axis.At(f));
  return taps;
}

// Sums along x. Each row of the result has one frequency, and its pixels of y at their places with
// their factors.
cv::Mat SumsAlongRows(const cv::Mat& pixels, float less, const GriddedAxis& x, const GriddedAxis& y,
                      const std::vector<GriddedAxis::Taps>& taps) {
  cv::Mat sums = cv::Mat::zeros(static_cast<int>(taps.size()), y.length(), CV_32FC2);
  const auto [least, most] = std::minmax_element(
      taps.begin(), taps.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  const int first = least->first, end = most->first + GriddedAxis::kTaps;
  std::vector<Complex> bins(static_cast<std::size_t>(end - first));
  cv::Mat block(kRowsAtOnce, x.length(), CV_32F), transform;
  for (int begin = 0; begin < pixels.rows; begin += kRowsAtOnce) {
    ThrowIfCancelled();
    const int rows = std::min(kRowsAtOnce, pixels.rows - begin);
    block.setTo(0);
    for (int r = 0; r < rows; ++r) {
      const auto* from = pixels.ptr<float>(begin + r);
      auto* to = block.ptr<float>(r);
      // The samples before the middle lie at the end.
      auto* to_end = to + x.length() - x.middle();
      for (int i = 0; i < x.middle(); ++i) to_end[i] = x.FactorOf(i) * (from[i] - less);
      to -= x.middle();
      for (int i = x.middle(); i < x.samples(); ++i) to[i] = x.FactorOf(i) * (from[i] - less);
    }
    cv::dft(block.rowRange(0, rows), transform, cv::DFT_ROWS);
    for (int r = 0; r < rows; ++r) {
      const auto* packed = transform.ptr<float>(r);
      for (int bin = first; bin < end; ++bin)
        bins[static_cast<std::size_t>(bin - first)] = PackedBin(packed, x.length(), bin);
      const int place = y.PlaceOf(begin + r);
      const float factor = y.FactorOf(begin + r);
      for (std::size_t j = 0; j < taps.size(); ++j)
        sums.ptr<Complex>(static_cast<int>(j))[place] =
            factor * Interpolated(taps[j], &bins[static_cast<std::size_t>(taps[j].first - first)]);
    }
  }
  return sums;
}

}  // namespace

GriddedAxis::GriddedAxis(const Eigen::VectorXd& weights) {
  const auto samples = static_cast<int>(weights.size());
  length_ = 2 * cv::getOptimalDFTSize(
                    std::max(kTaps, static_cast<int>(std::ceil(0.5 * kOversampling * samples))));
  factors_.reserve(static_cast<std::size_t>(samples));
  for (int i = 0; i < samples; ++i) {
    const double place = static_cast<double>(i - samples / 2) / length_;
    factors_.push_back(static_cast<float>(weights[i] / TransformOfKernel(place)));
  }
}

GriddedAxis::Taps GriddedAxis::At(double frequency) const {
  const double bin = frequency * length_;
  Taps taps;
  taps.first = static_cast<int>(std::floor(bin)) - kTaps / 2 + 1;
  for (int t = 0; t < kTaps; ++t)
    taps.weights[static_cast<std::size_t>(t)] = static_cast<float>(Kernel(taps.first + t - bin));
  return taps;
}

Eigen::ArrayXcd GriddedSums(const cv::Mat& pixels, float less, const GriddedAxis& x,
                            const GriddedAxis& y, const std::vector<double>& frequencies_x,
                            const std::vector<double>& frequencies_y,
                            const std::vector<std::pair<int, int>>& pairs) {
  Eigen::ArrayXcd result(static_cast<Eigen::Index>(pairs.size()));
  if (pairs.empty()) return result;
  cv::Mat sums = SumsAlongRows(pixels, less, x, y, TapsOf(x, frequencies_x));
  for (int begin = 0; begin < sums.rows; begin += kRowsAtOnce) {
    ThrowIfCancelled();
    cv::Mat block = sums.rowRange(begin, std::min(begin + kRowsAtOnce, sums.rows));
    cv::dft(block, block, cv::DFT_ROWS);
  }
  const std::vector<GriddedAxis::Taps> taps = TapsOf(y, frequencies_y);
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const auto* bins = sums.ptr<Complex>(pairs[k].first);
    const GriddedAxis::Taps& tap = taps[static_cast<std::size_t>(pairs[k].second)];
    std::complex<double> sum = 0;
    for (int t = 0; t < GriddedAxis::kTaps; ++t) {
      const int bin = (tap.first + t) % y.length();
      sum += static_cast<std::complex<double>>(bins[bin < 0 ? bin + y.length() : bin]) *
             static_cast<double>(tap.weights[static_cast<std::size_t>(t)]);
    }
    result[static_cast<Eigen::Index>(k)] = sum;
  }
  return result;
}

}  // namespace thicklens::calib

#include "calib/spectrum/window_leakage.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "thicklens/base/cancel.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/pi.h"
#include "thicklens/model/blur_transfer.h"

namespace thicklens::calib {
namespace {

constexpr double kTwoPiSquared = 2 * kPi * kPi;
constexpr int kLeakageNodes = 12;
constexpr double kLeakageBand = 4;  // H below exp(-4): no frame uses such a mode
// Frequencies beyond the modes of a node that still reach them through the window: a share of the
// highest mode, and orders of the window, whose transform falls with their third power.
constexpr double kReachOfBand = 1.5;
constexpr double kReachOfWindow = 32;
// Step of tabulated transfer functions in t = 2 pi f R. The error of the straight lines between the
// entries is at most 1/32 of its square, because the second derivative is at most 1/4.
constexpr double kStepOfTable = 0.002;

// The transfer function of the defocus against |f|, which is smooth, as a table.
class TransferTable {
 public:
  TransferTable(model::Psf psf, double sigma_px, double most)
      : per_step_(2 * kPi * 2 * sigma_px / kStepOfTable) {
    const auto entries = static_cast<std::size_t>(most * per_step_) + 3;
    values_.reserve(entries);
    for (std::size_t i = 0; i < entries; ++i)
      values_.push_back(static_cast<float>(
          model::DefocusTransfer(psf, sigma_px, static_cast<double>(i) / per_step_, 0)));
  }
  float At(double f) const {
    const double place = f * per_step_;
    const auto i = static_cast<std::size_t>(place);
    const auto part = static_cast<float>(place - static_cast<double>(i));
    return values_[i] + part * (values_[i + 1] - values_[i]);
  }

 private:
  double per_step_;
  std::vector<float> values_;
};

// Length of the FFT that holds the frequencies up to `reach`, in cycles per sample, of one that has
// `length` samples.
int ReducedLength(int length, double reach) {
  if (!(reach < 0.5)) return length;
  return std::min(length, 2 * cv::getOptimalDFTSize(static_cast<int>(reach * length) + 2));
}

// Index in the transform of `length` samples of the frequency that one of `reduced` samples has at
// `index`, and that frequency in cycles per sample of the former.
int IndexOfSameFrequency(int index, int reduced, int length) {
  return index <= reduced / 2 ? index : index - reduced + length;
}
double FrequencyAt(int index, int length) {
  return static_cast<double>(index <= length / 2 ? index : index - length) / length;
}

// An image with the frequencies up to `reach` along each axis of `transform`, times the transfer
// function; sampled as coarsely as these allow.
cv::Mat BlurredImage(const cv::Mat& transform, const TransferTable& transfer,
                     const Eigen::Vector2d& axes, const Eigen::Vector2d& reach) {
  const int cols = ReducedLength(transform.cols, reach.x());
  const int rows = ReducedLength(transform.rows, reach.y());
  const double share = static_cast<double>(cols) * rows / static_cast<double>(transform.total());
  std::vector<double> square_x;
  for (int u = 0; u < cols; ++u) {
    const double f =
        axes.x() * FrequencyAt(IndexOfSameFrequency(u, cols, transform.cols), transform.cols);
    square_x.push_back(f * f);
  }
  cv::Mat blurred(rows, cols, CV_32FC2), image;
  for (int v = 0; v < rows; ++v) {
    ThrowIfCancelled();
    const int from_v = IndexOfSameFrequency(v, rows, transform.rows);
    const double fy = axes.y() * FrequencyAt(from_v, transform.rows);
    const auto* from = transform.ptr<cv::Vec2f>(from_v);
    auto* row = blurred.ptr<cv::Vec2f>(v);
    for (int u = 0; u < cols; ++u) {
      const auto factor = static_cast<float>(share) *
                          transfer.At(std::sqrt(square_x[static_cast<std::size_t>(u)] + fy * fy));
      row[u] = factor * from[IndexOfSameFrequency(u, cols, transform.cols)];
    }
    // The highest frequency of a smaller transform is that of both signs.
    if (cols < transform.cols) row[cols / 2] = 0;
    if (rows < transform.rows && v == rows / 2) blurred.row(v).setTo(0);
  }
  cv::dft(blurred, image, cv::DFT_INVERSE | cv::DFT_SCALE | cv::DFT_REAL_OUTPUT);
  return image;
}

}  // namespace

WindowLeakage::WindowLeakage(const cv::Mat& reference, const Eigen::Vector2d& origin_px,
                             const TargetWindow& window, const std::vector<Mode>& modes,
                             const FrameSpectrum& spectrum, model::Psf psf, double largest_sigma_px,
                             int threads, const Eigen::Vector2d& axes) {
  if (!(largest_sigma_px > 0)) return;
  step_px_ = largest_sigma_px / (kLeakageNodes - 1);
  const int pad = static_cast<int>(std::ceil(4 * largest_sigma_px));
  // Only the part that the window sees is used, and the surroundings that the blur moves into it.
  const cv::Rect part =
      cv::Rect(
          cv::Point(
              static_cast<int>(origin_px.x() + window.centre_px.x() - 0.5 * window.size_px.x()) -
                  pad - 1,
              static_cast<int>(origin_px.y() + window.centre_px.y() - 0.5 * window.size_px.y()) -
                  pad - 1),
          cv::Size(static_cast<int>(window.size_px.x()) + 2 * pad + 3,
                   static_cast<int>(window.size_px.y()) + 2 * pad + 3)) &
      cv::Rect(cv::Point(0, 0), reference.size());
  const cv::Size size(cv::getOptimalDFTSize(part.width + 2 * pad),
                      cv::getOptimalDFTSize(part.height + 2 * pad));
  const Eigen::Vector2d padded_origin_px =
      origin_px - Eigen::Vector2d(part.x, part.y) + Eigen::Vector2d::Constant(pad);
  cv::Mat transform;
  {
    cv::Mat padded;
    // Pixels beyond the part are not read: the borders are mirrored instead.
    cv::copyMakeBorder(reference(part), padded, pad, size.height - part.height - pad, pad,
                       size.width - part.width - pad, cv::BORDER_REFLECT_101 | cv::BORDER_ISOLATED);
    cv::dft(padded, transform, cv::DFT_COMPLEX_OUTPUT);
  }
  nodes_.resize(kLeakageNodes);
  nodes_[0] = Eigen::ArrayXcd::Zero(static_cast<Eigen::Index>(modes.size()));
  ParallelFor(kLeakageNodes - 1, threads, [&](int index) {
    const double sigma = step_px_ * (index + 1);
    const double highest = std::sqrt(kLeakageBand / kTwoPiSquared) / sigma;
    const auto is_left = [&](const Mode& mode) {
      return axes.cwiseProduct(ModeFrequency(mode, window)).norm() < highest;
    };
    // A blur along one axis leaves modes of every |nu|.
    std::size_t count = axes.minCoeff() > 0 ? 0 : modes.size();
    while (count < modes.size() && is_left(modes[count])) ++count;
    const Eigen::Vector2d reach =
        (axes.array() > 0)
            .select((highest + kReachOfWindow / window.size_px.array()).max(kReachOfBand * highest),
                    0.5);
    const cv::Mat image =
        BlurredImage(transform, TransferTable(psf, sigma, std::sqrt(0.5)), axes, reach);
    const Eigen::Vector2d scale(static_cast<double>(image.cols) / size.width,
                                static_cast<double>(image.rows) / size.height);
    const auto seen =
        MeasureSums(image, padded_origin_px.cwiseProduct(scale), scale, window, modes, count);
    Eigen::ArrayXcd& node = nodes_[static_cast<std::size_t>(index + 1)];
    node = Eigen::ArrayXcd::Zero(static_cast<Eigen::Index>(count));
    if (!seen) return;
    for (std::size_t k = 0; k < count; ++k) {
      if (!is_left(modes[k])) continue;
      const Eigen::Vector2d nu = ModeFrequency(modes[k], window);
      const auto i = static_cast<Eigen::Index>(k);
      node[i] = seen->values[i] / BoxTransfer(modes[k], window, 1) -
                spectrum.values[i] *
                    model::DefocusTransfer(psf, sigma, axes.x() * nu.x(), axes.y() * nu.y());
    }
  });
}

// Cubic interpolation between the nodes. The function is even in sigma, so that the nodes are
// mirrored below 0.
Eigen::ArrayXcd WindowLeakage::At(double variance_px2, std::size_t count) const {
  const auto n = static_cast<Eigen::Index>(count);
  Eigen::ArrayXcd result = Eigen::ArrayXcd::Zero(n);
  if (nodes_.empty() || !(variance_px2 > 0)) return result;
  const double place = std::min(std::sqrt(variance_px2) / step_px_, kLeakageNodes - 1.0);
  const int first = std::min(static_cast<int>(place), kLeakageNodes - 3) - 1;
  for (int a = first; a < first + 4; ++a) {
    double weight = 1;
    for (int b = first; b < first + 4; ++b) {
      if (b != a) weight *= (place - b) / (a - b);
    }
    const Eigen::ArrayXcd& node = nodes_[static_cast<std::size_t>(std::abs(a))];
    const Eigen::Index c = std::min<Eigen::Index>(n, node.size());
    result.head(c) += weight * node.head(c);
  }
  return result;
}

WindowLeakage WindowLeakage::Of(const std::vector<Eigen::Index>& modes) const {
  WindowLeakage part;
  part.step_px_ = step_px_;
  for (const Eigen::ArrayXcd& node : nodes_) {
    std::vector<Eigen::Index> present;
    for (const Eigen::Index k : modes) {
      if (k < node.size()) present.push_back(k);
    }
    part.nodes_.emplace_back(node(present));
  }
  return part;
}
}  // namespace thicklens::calib

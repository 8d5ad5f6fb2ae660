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
  const Eigen::Vector2d part_origin_px = origin_px - Eigen::Vector2d(part.x, part.y);
  const cv::Size size(cv::getOptimalDFTSize(part.width + 2 * pad),
                      cv::getOptimalDFTSize(part.height + 2 * pad));
  cv::Mat padded, transform;
  // Pixels beyond the part are not read: the borders are mirrored instead.
  cv::copyMakeBorder(reference(part), padded, pad, size.height - part.height - pad, pad,
                     size.width - part.width - pad, cv::BORDER_REFLECT_101 | cv::BORDER_ISOLATED);
  cv::dft(padded, transform, cv::DFT_COMPLEX_OUTPUT);
  nodes_.resize(kLeakageNodes);
  nodes_[0] = Eigen::ArrayXcd::Zero(static_cast<Eigen::Index>(modes.size()));
  ParallelFor(kLeakageNodes - 1, threads, [&](int index) {
    const double sigma = step_px_ * (index + 1);
    // A blur along one axis leaves modes of every frequency in the band.
    std::size_t count = axes.minCoeff() > 0 ? 0 : modes.size();
    while (count < modes.size() &&
           kTwoPiSquared * sigma * sigma * ModeFrequency(modes[count], window).squaredNorm() <
               kLeakageBand)
      ++count;
    cv::Mat blurred = transform.clone();
    for (int v = 0; v < blurred.rows; ++v) {
      ThrowIfCancelled();
      const double fy =
          static_cast<double>(v <= blurred.rows / 2 ? v : v - blurred.rows) / blurred.rows;
      auto* row = blurred.ptr<cv::Vec2f>(v);
      for (int u = 0; u < blurred.cols; ++u) {
        const double fx =
            static_cast<double>(u <= blurred.cols / 2 ? u : u - blurred.cols) / blurred.cols;
        row[u] *=
            static_cast<float>(model::DefocusTransfer(psf, sigma, axes.x() * fx, axes.y() * fy));
      }
    }
    cv::Mat image;
    cv::dft(blurred, image, cv::DFT_INVERSE | cv::DFT_SCALE | cv::DFT_REAL_OUTPUT);
    const cv::Mat inner = image(cv::Rect(pad, pad, part.width, part.height));
    const auto seen = MeasureSpectrum(inner, part_origin_px, {}, window, modes, count);
    Eigen::ArrayXcd& node = nodes_[static_cast<std::size_t>(index + 1)];
    node = Eigen::ArrayXcd::Zero(static_cast<Eigen::Index>(count));
    if (!seen) return;
    for (std::size_t k = 0; k < count; ++k) {
      const Eigen::Vector2d nu = ModeFrequency(modes[k], window);
      const auto i = static_cast<Eigen::Index>(k);
      node[i] = seen->values[i] - spectrum.values[i] * model::DefocusTransfer(psf, sigma,
                                                                              axes.x() * nu.x(),
                                                                              axes.y() * nu.y());
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

#include "calib/spectrum/window_leakage.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <opencv2/core.hpp>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/pi.h"
#include "thicklens/model/blur_transfer.h"

namespace thicklens::calib {
namespace {

using Complex = std::complex<float>;

constexpr double kTwoPiSquared = 2 * kPi * kPi;
constexpr int kLeakageNodes = 12;
constexpr double kLeakageBand = 4;  // H below exp(-4): no frame uses such a mode
// Largest product of the distances along both axes, in orders of the window, at which a frequency
// leaks into a mode. The transform of the window falls with the third power of each distance.
constexpr double kReach = 64;
// Step of tabulated transfer functions in t = 2 pi f R. The error of the straight lines between the
// entries is at most 1/32 of its square, because the second derivative is at most 1/4.
constexpr double kStepOfTable = 0.01;
constexpr int kModesAtOnce = 64;

// The transfer functions of the defocus of all nodes but the first against |f|, as a table.
class TransferTable {
 public:
  using Entry = std::array<float, kLeakageNodes>;  // the last value is 0: whole vectors

  TransferTable(model::Psf psf, double step_px, double most, int threads)
      : per_step_(static_cast<float>(2 * kPi * 2 * step_px * (kLeakageNodes - 1) / kStepOfTable)),
        entries_(static_cast<std::size_t>(most * static_cast<double>(per_step_)) + 3) {
    ParallelFor(kLeakageNodes - 1, threads, [&](int node) {
      for (std::size_t i = 0; i < entries_.size(); ++i) {
        entries_[i][static_cast<std::size_t>(node)] = static_cast<float>(model::DefocusTransfer(
            psf, step_px * (node + 1), static_cast<double>(i) / static_cast<double>(per_step_), 0));
      }
    });
  }
  Entry At(float f) const {
    const float place = f * per_step_;
    const auto i = std::min(static_cast<std::size_t>(place), entries_.size() - 2);
    const float part = place - static_cast<float>(i);
    Entry value;
    for (std::size_t n = 0; n < value.size(); ++n)
      value[n] = entries_[i][n] + part * (entries_[i + 1][n] - entries_[i][n]);
    return value;
  }

 private:
  float per_step_;
  std::vector<Entry> entries_;
};

// The transform of the Hann window over its middle value at a distance in orders:
// sin(pi t)/(pi t (1 - t^2)). `sine` is sin(pi t).
double WindowAt(double t, double sine) {
  if (std::abs(t) < 1e-6) return 1;
  if (std::abs(std::abs(t) - 1) < 1e-6) return 0.5;
  return sine / (kPi * t * (1 - t * t));
}

// One axis of the transform of an image.
class TransformAxis {
 public:
  // `size_px` and `middle_px` are those of the window, in an image of `length` px.
  TransformAxis(int length, double size_px, double middle_px)
      : length_(length), orders_per_bin_(size_px / length) {
    for (int u = 0; u < length; ++u) {
      const double f = FrequencyOf(u);
      sines_.push_back(std::sin(kPi * f * size_px));
      phases_.emplace_back(std::polar(1.0F, static_cast<float>(2 * kPi * Fraction(f * middle_px))));
    }
  }

  // The frequencies that leak into an order of the window, from the lowest one on.
  struct Neighbours {
    int first_bin = 0;
    std::vector<int> indices;        // in the transform
    std::vector<float> frequencies;  // cycles per px
    std::vector<float> weights;      // of the window
    std::vector<double> distances;   // in orders, at least 1
  };
  Neighbours Of(int order) const {
    Neighbours found;
    const auto [first, last] = BinsWithin(order, kReach);
    found.first_bin = first;
    for (int bin = first; bin <= last; ++bin) {
      const int index = bin >= 0 ? bin : bin + length_;
      const double t = order - bin * orders_per_bin_;
      // sin(pi (j - a)) = -(-1)^j sin(pi a).
      const double sine = (order % 2 == 0 ? -1 : 1) * sines_[static_cast<std::size_t>(index)];
      found.indices.push_back(index);
      found.frequencies.push_back(static_cast<float>(static_cast<double>(bin) / length_));
      found.weights.push_back(static_cast<float>(WindowAt(t, sine)));
      found.distances.push_back(std::max(1.0, std::abs(t)));
    }
    return found;
  }

  // The first and the last bin within a distance of an order.
  std::pair<int, int> BinsWithin(int order, double distance) const {
    return {std::max(1 - length_ / 2,
                     static_cast<int>(std::ceil((order - distance) / orders_per_bin_))),
            std::min(length_ / 2 - 1,
                     static_cast<int>(std::floor((order + distance) / orders_per_bin_)))};
  }
  Complex PhaseOf(int index) const { return phases_[static_cast<std::size_t>(index)]; }

 private:
  static double Fraction(double value) { return value - std::floor(value); }
  double FrequencyOf(int index) const {
    return static_cast<double>(index <= length_ / 2 ? index : index - length_) / length_;
  }

  int length_;
  double orders_per_bin_;
  std::vector<double> sines_;    // sin(pi f size)
  std::vector<Complex> phases_;  // from the first pixel to the middle of the window
};

// The image around the window, less its mean.
struct Surroundings {
  Surroundings(const cv::Mat& reference, const Eigen::Vector2d& origin_px,
               const TargetWindow& window, double mean, int pad) {
    // Only the part that the window sees is used, and the surroundings that the blur moves into it.
    const Eigen::Vector2d first_px = origin_px + window.centre_px - 0.5 * window.size_px;
    const cv::Rect part = cv::Rect(cv::Point(static_cast<int>(first_px.x()) - pad - 1,
                                             static_cast<int>(first_px.y()) - pad - 1),
                                   cv::Size(static_cast<int>(window.size_px.x()) + 2 * pad + 3,
                                            static_cast<int>(window.size_px.y()) + 2 * pad + 3)) &
                          cv::Rect(cv::Point(0, 0), reference.size());
    const cv::Size size(EvenLength(part.width + 2 * pad), EvenLength(part.height + 2 * pad));
    // Pixels beyond the part are not read: the borders are mirrored instead.
    cv::copyMakeBorder(reference(part), pixels, pad, size.height - part.height - pad, pad,
                       size.width - part.width - pad, cv::BORDER_REFLECT_101 | cv::BORDER_ISOLATED);
    pixels -= mean;
    middle_px = origin_px + window.centre_px - Eigen::Vector2d(part.x, part.y) +
                Eigen::Vector2d::Constant(pad);
  }
  static int EvenLength(int length) { return 2 * cv::getOptimalDFTSize((length + 1) / 2); }

  cv::Mat pixels;             // CV_32F
  Eigen::Vector2d middle_px;  // of the window, in `pixels`
};

// [D176] The window sees at nu the transform G of the whole image, weighted by the transform w of
// the window around nu. What it sees of a blurred image is therefore H(nu) times what it sees of
// the image itself, plus the sum over f of (H(f) - H(nu)) w(nu - f) G(f), in which only the
// neighbours of nu count.
class LeakageSums {
 public:
  LeakageSums(const Surroundings& image, const TargetWindow& window)
      : window_(window),
        x_(image.pixels.cols, window.size_px.x(), image.middle_px.x()),
        y_(image.pixels.rows, window.size_px.y(), image.middle_px.y()) {
    ThrowIfCancelled();
    cv::dft(image.pixels, transform_, cv::DFT_COMPLEX_OUTPUT);
  }

  using Values = std::array<std::complex<double>, kLeakageNodes>;

  // The sums at a mode for all nodes but the first, over the sum of the window. `along` times a
  // frequency is its part along the axes of the blur.
  Values At(const Mode& mode, const TransferTable& transfer, const Eigen::Matrix2d& along) const {
    const TransformAxis::Neighbours of_x = x_.Of(mode.jx), of_y = y_.Of(mode.jy);
    const Eigen::Vector2d nu = ModeFrequency(mode, window_);
    const TransferTable::Entry here = transfer.At(static_cast<float>((along * nu).norm()));
    const Eigen::Matrix2f axes = along.cast<float>();
    Values sums{};
    for (std::size_t v = 0; v < of_y.indices.size(); ++v) {
      const auto* row = transform_.ptr<Complex>(of_y.indices[v]);
      const float fy = of_y.frequencies[v];
      const float row_a = axes(0, 1) * fy, row_b = axes(1, 1) * fy;
      const auto [first, last] = x_.BinsWithin(mode.jx, kReach / of_y.distances[v]);
      std::array<float, kLeakageNodes> real{}, imaginary{};
      for (int bin = first; bin <= last; ++bin) {
        const auto u = static_cast<std::size_t>(bin - of_x.first_bin);
        const float fx = of_x.frequencies[u];
        const float a = axes(0, 0) * fx + row_a, b = axes(1, 0) * fx + row_b;
        const Complex value =
            of_x.weights[u] * (row[of_x.indices[u]] * x_.PhaseOf(of_x.indices[u]));
        const TransferTable::Entry there = transfer.At(std::sqrt(a * a + b * b));
        for (std::size_t n = 0; n < here.size(); ++n) {
          real[n] += (there[n] - here[n]) * value.real();
          imaginary[n] += (there[n] - here[n]) * value.imag();
        }
      }
      const auto weight =
          static_cast<std::complex<double>>(of_y.weights[v] * y_.PhaseOf(of_y.indices[v]));
      for (std::size_t n = 0; n < here.size(); ++n)
        sums[n] += weight * std::complex<double>(real[n], imaginary[n]);
    }
    // The phases so far refer to the middle of the window.
    const auto phase = std::polar(1 / static_cast<double>(transform_.total()),
                                  -2 * kPi * nu.dot(window_.centre_px));
    for (std::complex<double>& sum : sums) sum *= phase;
    return sums;
  }

 private:
  TargetWindow window_;
  TransformAxis x_, y_;
  cv::Mat transform_;
};

// The leakage at all nodes.
std::vector<Eigen::ArrayXcd> Nodes(const LeakageSums& sums, const TransferTable& transfer,
                                   const TargetWindow& window, const std::vector<Mode>& modes,
                                   const FrameSpectrum& spectrum, model::Psf psf, double step_px,
                                   int threads, const Eigen::Matrix2d& axes) {
  std::vector<Eigen::ArrayXcd> nodes(kLeakageNodes);
  nodes[0] = Eigen::ArrayXcd::Zero(static_cast<Eigen::Index>(modes.size()));
  const auto highest_of = [&](std::size_t node) {
    return std::sqrt(kLeakageBand / kTwoPiSquared) / (step_px * static_cast<double>(node));
  };
  const auto along = [&](const Mode& mode) -> Eigen::Vector2d {
    return axes * ModeFrequency(mode, window);
  };
  for (std::size_t node = 1; node < nodes.size(); ++node) {
    // A blur along one axis leaves modes of every |nu|.
    const bool is_along_both = axes.row(0).squaredNorm() > 0 && axes.row(1).squaredNorm() > 0;
    std::size_t count = is_along_both ? 0 : modes.size();
    while (count < modes.size() && along(modes[count]).norm() < highest_of(node)) ++count;
    nodes[node] = Eigen::ArrayXcd::Zero(static_cast<Eigen::Index>(count));
  }
  // The mean that the window sees changes, too.
  const LeakageSums::Values of_mean = sums.At({0, 0}, transfer, axes);
  const auto pieces = static_cast<int>((modes.size() + kModesAtOnce - 1) / kModesAtOnce);
  ParallelFor(pieces, threads, [&](int piece) {
    const auto begin = static_cast<std::size_t>(piece) * kModesAtOnce;
    const std::size_t end = std::min(modes.size(), begin + kModesAtOnce);
    for (std::size_t k = begin; k < end; ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      const Eigen::Vector2d nu = along(modes[k]);
      if (i >= nodes[1].size() || !(nu.norm() < highest_of(1))) continue;
      const LeakageSums::Values leaks = sums.At(modes[k], transfer, axes);
      const double box = BoxTransfer(modes[k], window, 1);
      for (std::size_t node = 1; node < nodes.size(); ++node) {
        if (i >= nodes[node].size() || !(nu.norm() < highest_of(node))) break;
        const double mean = spectrum.mean + of_mean[node - 1].real();
        const double left =
            model::DefocusTransfer(psf, step_px * static_cast<double>(node), nu.x(), nu.y());
        nodes[node][i] =
            leaks[node - 1] / (mean * box) + left * spectrum.values[i] * (spectrum.mean / mean - 1);
      }
    }
  });
  return nodes;
}

}  // namespace

WindowLeakage::WindowLeakage(const cv::Mat& reference, const Eigen::Vector2d& origin_px,
                             const TargetWindow& window, const std::vector<Mode>& modes,
                             const FrameSpectrum& spectrum, model::Psf psf, double largest_sigma_px,
                             int threads, const Eigen::Vector2d& axes, double angle_rad) {
  *this = AlongAxes(reference, origin_px, window, modes, spectrum, psf, largest_sigma_px, threads,
                    {axes}, angle_rad)
              .front();
}

std::vector<WindowLeakage> WindowLeakage::AlongAxes(
    const cv::Mat& reference, const Eigen::Vector2d& origin_px, const TargetWindow& window,
    const std::vector<Mode>& modes, const FrameSpectrum& spectrum, model::Psf psf,
    double largest_sigma_px, int threads, const std::vector<Eigen::Vector2d>& axes,
    double angle_rad) {
  std::vector<WindowLeakage> found(axes.size());
  if (!(largest_sigma_px > 0)) return found;
  const double step_px = largest_sigma_px / (kLeakageNodes - 1);
  const LeakageSums sums(Surroundings(reference, origin_px, window, spectrum.mean,
                                      static_cast<int>(std::ceil(4 * largest_sigma_px))),
                         window);
  double highest = 0;
  for (const Mode& mode : modes) highest = std::max(highest, ModeFrequency(mode, window).norm());
  const TransferTable transfer(
      psf, step_px,
      std::min(std::sqrt(0.5), highest + std::sqrt(2.0) * kReach / window.size_px.minCoeff()),
      threads);
  const Eigen::Matrix2d turned = Eigen::Rotation2Dd(-angle_rad).toRotationMatrix();
  for (std::size_t a = 0; a < axes.size(); ++a) {
    const Eigen::Matrix2d along = axes[a].asDiagonal() * turned;
    found[a].step_px_ = step_px;
    found[a].nodes_ = Nodes(sums, transfer, window, modes, spectrum, psf, step_px, threads, along);
  }
  return found;
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

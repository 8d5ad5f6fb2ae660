#include "calib/spectrum/frame_spectrum.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "thicklens/base/pi.h"
#include "thicklens/model/blur_transfer.h"

namespace thicklens::calib {
namespace {

constexpr int kModeStep = 2;

// One axis of the separable sum: the pixels that the window covers, and w cos and w sin of every
// step-th order there.
struct Axis {
  int first = 0, count = 0;
  double weight_sum = 0, weight_square_sum = 0;
  Eigen::VectorXf weights;
  Eigen::MatrixXf waves;  // count x 2 (orders): w cos and w sin alternate
};

std::optional<Axis> MakeAxis(int pixels, double origin_px, double shift_px, double scale,
                             double centre_px, double size_px, int order, int step_of_orders) {
  const double middle = origin_px + shift_px + scale * centre_px;
  const double half = 0.5 * scale * size_px;
  Axis axis;
  axis.first = static_cast<int>(std::ceil(middle - half));
  const int last = static_cast<int>(std::floor(middle + half));
  axis.count = last - axis.first + 1;
  if (axis.first < 0 || last >= pixels || axis.count < 8) return std::nullopt;
  axis.weights.resize(axis.count);
  const int orders = order / step_of_orders + 1;
  axis.waves.resize(axis.count, 2 * orders);
  for (int i = 0; i < axis.count; ++i) {
    const double x = (axis.first + i - origin_px - shift_px) / scale;  // target px
    const double c = std::cos(kPi * (x - centre_px) / size_px);
    const double w = c * c;
    axis.weights[i] = static_cast<float>(w);
    axis.weight_sum += w;
    axis.weight_square_sum += w * w;
    // exp(-2 pi i j x/size) by recurrence, in double.
    const double angle = -2 * kPi * step_of_orders * x / size_px;
    const std::complex<double> step(std::cos(angle), std::sin(angle));
    std::complex<double> wave(w, 0);
    for (int j = 0; j < orders; ++j) {
      axis.waves(i, 2 * j) = static_cast<float>(wave.real());
      axis.waves(i, 2 * j + 1) = static_cast<float>(wave.imag());
      wave *= step;
    }
  }
  return axis;
}

}  // namespace

Eigen::Vector2d ModeFrequency(const Mode& mode, const TargetWindow& window) {
  return {mode.jx / window.size_px.x(), mode.jy / window.size_px.y()};
}

std::vector<Mode> ModesBetween(const TargetWindow& window, double low, double high) {
  std::vector<Mode> modes;
  const int order_x = static_cast<int>(high * window.size_px.x());
  const int order_y = static_cast<int>(high * window.size_px.y());
  for (int jx = 0; jx <= order_x; jx += kModeStep) {
    for (int jy = jx == 0 ? kModeStep : -(order_y / kModeStep) * kModeStep; jy <= order_y;
         jy += kModeStep) {
      const double nu = ModeFrequency({jx, jy}, window).norm();
      if (nu > low && nu < high) modes.push_back({jx, jy});
    }
  }
  std::stable_sort(modes.begin(), modes.end(), [&](const Mode& a, const Mode& b) {
    return ModeFrequency(a, window).squaredNorm() < ModeFrequency(b, window).squaredNorm();
  });
  return modes;
}

double BoxTransfer(const Mode& mode, const TargetWindow& window, double scale) {
  const Eigen::Vector2d nu = ModeFrequency(mode, window) / scale;
  return model::PixelBoxTransfer(nu.x(), nu.y());
}

std::optional<FrameSpectrum> MeasureSpectrum(const cv::Mat& grey, const Eigen::Vector2d& origin_px,
                                             const FramePlace& place, const TargetWindow& window,
                                             const std::vector<Mode>& modes, std::size_t count) {
  int order_x = 0, order_y = 0;
  int step = 0;  // common divisor of all requested orders
  for (std::size_t k = 0; k < count; ++k) {
    order_x = std::max(order_x, modes[k].jx);
    order_y = std::max(order_y, std::abs(modes[k].jy));
    step = std::gcd(step, std::gcd(modes[k].jx, modes[k].jy));
  }
  step = std::max(step, 1);
  const auto x = MakeAxis(grey.cols, origin_px.x(), place.shift_px.x(), place.scale,
                          window.centre_px.x(), window.size_px.x(), order_x, step);
  const auto y = MakeAxis(grey.rows, origin_px.y(), place.shift_px.y(), place.scale,
                          window.centre_px.y(), window.size_px.y(), order_y, step);
  if (!x || !y) return std::nullopt;

  using RowMajor = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Map<const RowMajor, 0, Eigen::OuterStride<>> pixels(
      grey.ptr<float>(y->first) + x->first, y->count, x->count,
      Eigen::OuterStride<>(static_cast<Eigen::Index>(grey.step1())));
  const double total = x->weight_sum * y->weight_sum;
  FrameSpectrum spectrum;
  spectrum.mean = (y->weights.transpose() * pixels * x->weights).cast<double>().value() / total;
  if (!(spectrum.mean > 0)) return std::nullopt;
  spectrum.noise_gain =
      x->weight_square_sum * y->weight_square_sum / (total * total * spectrum.mean * spectrum.mean);

  // The mean is subtracted before the sums, because a later subtraction would leave float rounding.
  const RowMajor centred = pixels.array() - static_cast<float>(spectrum.mean);
  const Eigen::MatrixXf rows = centred * x->waves;           // y pixels x 2 orders
  const Eigen::MatrixXf sums = y->waves.transpose() * rows;  // 2 orders x 2 orders
  const double scale = 1 / (total * spectrum.mean);
  spectrum.values.resize(static_cast<Eigen::Index>(count));
  for (std::size_t k = 0; k < count; ++k) {
    const int jx = modes[k].jx / step, jy = std::abs(modes[k].jy) / step;
    const double sign = modes[k].jy < 0 ? -1 : 1;  // conjugate wave along y
    const double cc = sums(2 * jy, 2 * jx), cs = sums(2 * jy, 2 * jx + 1);
    const double sc = sign * sums(2 * jy + 1, 2 * jx), ss = sign * sums(2 * jy + 1, 2 * jx + 1);
    const double box = BoxTransfer(modes[k], window, place.scale);
    spectrum.values[static_cast<Eigen::Index>(k)] =
        std::complex<double>(cc - ss, cs + sc) * (scale / box);
  }
  return spectrum;
}

}  // namespace thicklens::calib

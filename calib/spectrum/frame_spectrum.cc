#include "calib/spectrum/frame_spectrum.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdlib>
#include <numeric>
#include <utility>

#include "calib/spectrum/gridded_sum.h"
#include "thicklens/base/pi.h"
#include "thicklens/model/blur_transfer.h"

namespace thicklens::calib {
namespace {

constexpr int kModeStep = 2;

// One axis of the separable sum: the pixels that the window covers and the window's weights there.
struct Axis {
  int first = 0, count = 0;
  double weight_sum = 0, weight_square_sum = 0;
  Eigen::VectorXd weights;
  double origin_px = 0;  // of the target coordinates, in the frame
  double cycles = 0;     // of the first order per frame px
};

std::optional<Axis> MakeAxis(int pixels, double origin_px, double scale, double centre_px,
                             double size_px) {
  const double middle = origin_px + scale * centre_px;
  const double half = 0.5 * scale * size_px;
  Axis axis;
  axis.first = static_cast<int>(std::ceil(middle - half));
  const int last = static_cast<int>(std::floor(middle + half));
  axis.count = last - axis.first + 1;
  if (axis.first < 0 || last >= pixels || axis.count < 8) return std::nullopt;
  axis.origin_px = origin_px;
  axis.cycles = 1 / (scale * size_px);
  axis.weights.resize(axis.count);
  for (int i = 0; i < axis.count; ++i) {
    const double c = std::cos(kPi * (axis.first + i - middle) / (scale * size_px));
    axis.weights[i] = c * c;
  }
  axis.weight_sum = axis.weights.sum();
  axis.weight_square_sum = axis.weights.squaredNorm();
  return axis;
}

// Phases of the orders from -highest to highest, from the middle pixel to the origin of the target.
class Phases {
 public:
  Phases(const Axis& axis, int samples, int highest) : highest_(highest) {
    const double middle_px = axis.first + samples / 2 - axis.origin_px;
    for (int order = -highest; order <= highest; ++order)
      phases_.push_back(std::polar(1.0, -2 * kPi * order * axis.cycles * middle_px));
  }
  std::complex<double> Of(int order) const {
    return phases_[static_cast<std::size_t>(order + highest_)];
  }

 private:
  int highest_;
  std::vector<std::complex<double>> phases_;
};

// The orders of modes along one axis as multiples of their largest common divisor.
struct CommonSteps {
  int step = 0, highest = 0;  // in orders; the highest in steps
  void Add(int order) {
    step = std::gcd(step, order);
    highest = std::max(highest, std::abs(order));
  }
  void Finish() {
    step = std::max(step, 1);
    highest /= step;
  }
};

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

std::optional<FrameSpectrum> MeasureSums(const cv::Mat& image, const Eigen::Vector2d& origin_px,
                                         const Eigen::Vector2d& scale, const TargetWindow& window,
                                         const std::vector<Mode>& modes, std::size_t count) {
  const auto x =
      MakeAxis(image.cols, origin_px.x(), scale.x(), window.centre_px.x(), window.size_px.x());
  const auto y =
      MakeAxis(image.rows, origin_px.y(), scale.y(), window.centre_px.y(), window.size_px.y());
  if (!x || !y) return std::nullopt;
  const cv::Mat pixels = image(cv::Rect(x->first, y->first, x->count, y->count));
  const double total = x->weight_sum * y->weight_sum;
  double light = 0;
  const Eigen::VectorXf weights_x = x->weights.cast<float>();
  for (int row = 0; row < y->count; ++row) {
    const Eigen::Map<const Eigen::VectorXf> values(pixels.ptr<float>(row), x->count);
    light += y->weights[row] * static_cast<double>(weights_x.dot(values));
  }
  FrameSpectrum spectrum;
  spectrum.mean = light / total;
  if (!(spectrum.mean > 0)) return std::nullopt;
  spectrum.noise_gain =
      x->weight_square_sum * y->weight_square_sum / (total * total * spectrum.mean * spectrum.mean);

  CommonSteps steps_x, steps_y;
  for (std::size_t k = 0; k < count; ++k) {
    steps_x.Add(modes[k].jx);
    steps_y.Add(modes[k].jy);
  }
  steps_x.Finish();
  steps_y.Finish();
  std::vector<std::pair<int, int>> orders;
  orders.reserve(count);
  for (std::size_t k = 0; k < count; ++k)
    orders.emplace_back(modes[k].jx / steps_x.step, modes[k].jy / steps_y.step);
  // The mean is subtracted before the sums, because a later subtraction would leave float rounding.
  spectrum.values =
      GriddedSums(pixels, static_cast<float>(spectrum.mean),
                  GriddedAxis(x->weights, steps_x.step * x->cycles, steps_x.highest),
                  GriddedAxis(y->weights, steps_y.step * y->cycles, steps_y.highest), orders);
  const Phases phases_x(*x, x->count, steps_x.highest * steps_x.step);
  const Phases phases_y(*y, y->count, steps_y.highest * steps_y.step);
  for (std::size_t k = 0; k < count; ++k) {
    spectrum.values[static_cast<Eigen::Index>(k)] *=
        phases_x.Of(modes[k].jx) * phases_y.Of(modes[k].jy) / (total * spectrum.mean);
  }
  return spectrum;
}

std::optional<FrameSpectrum> MeasureSpectrum(const cv::Mat& grey, const Eigen::Vector2d& origin_px,
                                             const FramePlace& place, const TargetWindow& window,
                                             const std::vector<Mode>& modes, std::size_t count) {
  auto spectrum = MeasureSums(grey, origin_px + place.shift_px,
                              Eigen::Vector2d::Constant(place.scale), window, modes, count);
  if (!spectrum) return spectrum;
  for (std::size_t k = 0; k < count; ++k)
    spectrum->values[static_cast<Eigen::Index>(k)] /= BoxTransfer(modes[k], window, place.scale);
  return spectrum;
}

}  // namespace thicklens::calib

#include "model/simulate/sweep/periodic_image.h"

#include <algorithm>
#include <cmath>

#include "thicklens/base/pi.h"
#include "thicklens/model/blur_transfer.h"

namespace thicklens::model {
namespace {

// The evaluation is a non-uniform fast Fourier transform along each axis in turn: an FFT onto a
// grid that is kOversampling times finer than the band requires, then kTaps taps of a Kaiser-Bessel
// window at each pixel centre. The transform of the window is divided out beforehand. The error is
// about exp(-pi kTaps sqrt(1 - 1/kOversampling)) = 1e-11.
constexpr int kTaps = 14;
constexpr double kOversampling = 1.5;

// Frequencies whose Gaussian transfer is below this value are left out.
constexpr double kNegligibleTransfer = 1e-12;
// Ratio to its sigma of the sigma of a Gaussian that falls no faster than a Gaussian under a pupil
// law.
constexpr double kLawReach = 0.85;

// Number of rows that are transformed together: enough to share the set-up of the FFT, few enough
// for the cache.
constexpr int kBlock = 16;

// I0(x) by its power series, whose terms are all positive.
double BesselI0(double x) {
  const double quarter_square = x * x / 4;
  double term = 1;
  double sum = 1;
  for (int k = 1; term > 1e-17 * sum; ++k) {
    term *= quarter_square / (static_cast<double>(k) * k);
    sum += term;
  }
  return sum;
}

// The plan of one axis: from frequencies -limit..limit to `count` pixel centres.
struct AxisPlan {
  int limit = 0;
  int grid_size = 0;
  std::vector<double> factor;   // for frequency |a|: separable transfer over the window's transform
  std::vector<int> first_node;  // one per pixel
  std::vector<double> taps;     // kTaps per pixel
};

// `gaussian_sigma_px` is the separable blur. The total blur is at least `reach_sigma_px`.
AxisPlan PlanAxis(const AxisSampling& axis, int max_frequency, double gaussian_sigma_px,
                  double reach_sigma_px, bool pixel_box) {
  AxisPlan plan;
  while (plan.limit < max_frequency &&
         GaussianTransfer(reach_sigma_px, (plan.limit + 1) * axis.step, 0) >= kNegligibleTransfer) {
    ++plan.limit;
  }
  const int band = 2 * plan.limit + 1;
  const int wanted = std::max(static_cast<int>(std::ceil(kOversampling * band)), 2 * kTaps);
  plan.grid_size = 2 * cv::getOptimalDFTSize((wanted + 1) / 2);

  // The window is phi(t) = I0(beta sqrt(1 - (2t/w)^2)) on |t| <= w/2, t in grid nodes, with the
  // transform w sinh(q)/q, q = sqrt(beta^2 - (pi w xi)^2); beta is that of Beatty, Nishimura &
  // Pauly (2005) [L4].
  const double oversampling = static_cast<double>(plan.grid_size) / band;
  const double beta =
      kPi * std::sqrt(std::pow(kTaps / oversampling * (oversampling - 0.5), 2) - 0.8);
  plan.factor.resize(static_cast<std::size_t>(plan.limit) + 1);
  for (int a = 0; a <= plan.limit; ++a) {
    const double xi = static_cast<double>(a) / plan.grid_size;
    const double q = std::sqrt(beta * beta - std::pow(kPi * kTaps * xi, 2));
    const double window_transform = kTaps * std::sinh(q) / q;
    plan.factor[static_cast<std::size_t>(a)] =
        GaussianTransfer(gaussian_sigma_px, a * axis.step, 0) *
        (pixel_box ? PixelBoxTransfer(a * axis.step, 0) : 1) / window_transform;
  }

  plan.first_node.resize(static_cast<std::size_t>(axis.count));
  plan.taps.resize(static_cast<std::size_t>(axis.count) * kTaps);
  for (int j = 0; j < axis.count; ++j) {
    const double periods =
        axis.at.empty() ? axis.start + j * axis.step : axis.at[static_cast<std::size_t>(j)];
    const double position = (periods - std::floor(periods)) * plan.grid_size;
    const int first = static_cast<int>(std::ceil(position - kTaps / 2.0));
    plan.first_node[static_cast<std::size_t>(j)] =
        (first % plan.grid_size + plan.grid_size) % plan.grid_size;
    for (int k = 0; k < kTaps; ++k) {
      const double t = 2 * (first + k - position) / kTaps;
      plan.taps[static_cast<std::size_t>(j) * kTaps + static_cast<std::size_t>(k)] =
          BesselI0(beta * std::sqrt(std::max(0.0, 1 - t * t)));
    }
  }
  return plan;
}

// Returns the same positions with the step of one px, which has `pixel_steps` steps.
AxisSampling InPixels(AxisSampling axis, double pixel_steps) {
  if (pixel_steps == 1) return axis;
  if (axis.at.empty()) {
    for (int i = 0; i < axis.count; ++i) axis.at.push_back(axis.start + i * axis.step);
  }
  axis.step *= pixel_steps;
  return axis;
}

// A grid with its first kTaps nodes repeated behind the end, so that no tap wraps around. `grid` is
// the part that the FFT writes.
template <typename Value>
struct WrappedGrid {
  WrappedGrid(int grid_size, int type)
      : storage(kBlock, grid_size + kTaps, type), grid(storage.colRange(0, grid_size)) {}

  // Evaluates `row` of the grid at every pixel of the plan.
  template <typename Store>
  void Interpolate(const AxisPlan& plan, int row, const Store& store) {
    Value* nodes = storage.ptr<Value>(row);
    std::copy(nodes, nodes + kTaps, nodes + plan.grid_size);
    const double* taps = plan.taps.data();
    for (std::size_t j = 0; j < plan.first_node.size(); ++j, taps += kTaps) {
      const Value* node = nodes + plan.first_node[j];
      Value sum{};
      for (int k = 0; k < kTaps; ++k) sum += node[k] * taps[k];
      store(static_cast<int>(j), sum);
    }
  }

  cv::Mat storage;
  cv::Mat grid;
};

}  // namespace

PeriodicImage::PeriodicImage(const cv::Mat& samples)
    : max_x_((samples.cols - 1) / 2), max_y_((samples.rows - 1) / 2) {
  CV_Assert(samples.type() == CV_64F && !samples.empty());
  cv::Mat spectrum;
  cv::dft(samples, spectrum, cv::DFT_COMPLEX_OUTPUT | cv::DFT_SCALE);
  half_spectrum_.reserve(static_cast<std::size_t>(max_y_ + 1) *
                         static_cast<std::size_t>(2 * max_x_ + 1));
  for (int b = 0; b <= max_y_; ++b) {
    const auto* row = spectrum.ptr<std::complex<double>>(b);
    for (int a = -max_x_; a <= max_x_; ++a) {
      half_spectrum_.push_back(row[a < 0 ? a + samples.cols : a]);
    }
  }
}

std::complex<double> PeriodicImage::Coefficient(int a, int b) const {
  if (b < 0) return std::conj(Coefficient(-a, -b));
  return half_spectrum_[static_cast<std::size_t>(b) * static_cast<std::size_t>(2 * max_x_ + 1) +
                        static_cast<std::size_t>(a + max_x_)];
}

cv::Mat PeriodicImage::Evaluate(const AxisSampling& x_steps, const AxisSampling& y_steps,
                                const FrameBlur& blur) const {
  const AxisSampling x = InPixels(x_steps, blur.pixel_steps);
  const AxisSampling y = InPixels(y_steps, blur.pixel_steps);
  // Gaussians of both kinds combine to one Gaussian, which is separable. A disc and the light of a
  // pupil law are not.
  const bool separates =
      blur.defocus_sigma_px == 0 || (blur.psf == Psf::kGaussian && blur.profile == nullptr);
  const double gaussian_sigma_px =
      separates ? std::hypot(blur.floor_sigma_px, blur.defocus_sigma_px) : blur.floor_sigma_px;
  // The transfer function of a Gaussian under a pupil law falls nearly as fast as that of the
  // Gaussian.
  const double reach_sigma_px =
      separates || blur.psf == Psf::kDisc
          ? gaussian_sigma_px
          : std::hypot(blur.floor_sigma_px, kLawReach * blur.defocus_sigma_px);
  const AxisPlan x_plan = PlanAxis(x, max_x_, gaussian_sigma_px, reach_sigma_px, blur.pixel_box);
  const AxisPlan y_plan = PlanAxis(y, max_y_, gaussian_sigma_px, reach_sigma_px, blur.pixel_box);
  const auto defocus_transfer = [&](double fx, double fy) {
    return blur.profile == nullptr
               ? DefocusTransfer(blur.psf, blur.defocus_sigma_px, fx, fy)
               : blur.profile->Transfer(2 * kPi * blur.defocus_sigma_px * std::hypot(fx, fy));
  };

  // First axis: row b of the spectrum is evaluated at the pixels' columns and kept transposed for
  // the second axis.
  const int rows = y_plan.limit + 1;
  cv::Mat columns(x.count, rows, CV_64FC2);
  {
    cv::Mat padded(kBlock, x_plan.grid_size, CV_64FC2);
    WrappedGrid<cv::Vec2d> fine(x_plan.grid_size, CV_64FC2);
    for (int block = 0; block < rows; block += kBlock) {
      const int used = std::min(kBlock, rows - block);
      padded.setTo(0);
      for (int r = 0; r < used; ++r) {
        const int b = block + r;
        auto* nodes = padded.ptr<std::complex<double>>(r);
        const double row_factor = y_plan.factor[static_cast<std::size_t>(b)];
        for (int a = 0; a <= x_plan.limit; ++a) {
          double factor = row_factor * x_plan.factor[static_cast<std::size_t>(a)];
          if (!separates && !blur.shape) factor *= defocus_transfer(a * x.step, b * y.step);
          const auto node = [&](int sign) {
            const std::complex<double> value = Coefficient(sign * a, b) * factor;
            return blur.shape ? value * blur.shape({sign * a * x.step, b * y.step}) : value;
          };
          nodes[a] = node(1);
          if (a > 0) nodes[x_plan.grid_size - a] = node(-1);
        }
      }
      cv::dft(padded, fine.grid, cv::DFT_INVERSE | cv::DFT_ROWS);
      for (int r = 0; r < used; ++r) {
        fine.Interpolate(x_plan, r, [&](int j, const cv::Vec2d& value) {
          columns.at<cv::Vec2d>(j, block + r) = value;
        });
      }
    }
  }

  // Second axis: the half spectrum of each column is evaluated at its pixels. The rows of `packed`
  // have the format of cv::dft for the transform of real numbers: Re 0, Re 1, Im 1, Re 2, Im 2, ...
  cv::Mat image(y.count, x.count, CV_64F);
  cv::Mat packed(kBlock, y_plan.grid_size, CV_64F);
  WrappedGrid<double> fine(y_plan.grid_size, CV_64F);
  for (int block = 0; block < x.count; block += kBlock) {
    const int used = std::min(kBlock, x.count - block);
    packed.setTo(0);
    for (int r = 0; r < used; ++r) {
      const auto* column = columns.ptr<cv::Vec2d>(block + r);
      double* node = packed.ptr<double>(r);
      *node = column[0][0];
      for (int b = 1; b < rows; ++b) {
        *++node = column[b][0];
        *++node = column[b][1];
      }
    }
    cv::dft(packed, fine.grid, cv::DFT_INVERSE | cv::DFT_ROWS | cv::DFT_REAL_OUTPUT);
    for (int r = 0; r < used; ++r) {
      fine.Interpolate(y_plan, r,
                       [&](int j, double value) { image.at<double>(j, block + r) = value; });
    }
  }
  return image;
}

}  // namespace thicklens::model

#include "calib/response/light_exponent.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "calib/response/response_sums.h"

namespace thicklens::calib {
namespace {

constexpr int kWindowsPerSide = 30;   // sigmas of the window in the shorter side of the crop
constexpr double kWidest = 1.0 / 14;  // sigma of window and blur together, of the shorter side
constexpr double kReach = 2.5;        // sigmas of a window that lie within the crop
constexpr double kMinAddedBlurPx = 1.5;
constexpr std::size_t kMaxFrames = 12;
constexpr double kMaxClipped = 0.002;  // share of a window
constexpr int kParts = 4;              // of the field, per axis
constexpr int kNuisances = 9;
constexpr Eigen::Index kMinWindows = 60;
constexpr double kPixelsPerWindow = 4;  // windows are sampled so densely that 4 are one value
// The change of the variances must differ between the windows by this part of itself. In a
// chequerboard all windows have the same texture (0.002), and what differs is the raster of the
// windows; random textures have 0.03 to 0.4.
constexpr double kMinSpread = 0.015;
constexpr double kMinChange = 1e-6;  // of the variance over the mean, relative to the mean
constexpr int kMaxRounds = 14;
constexpr double kSmallSlope = 0.003, kSmallPart = 0.25;  // the part is one of its sigma

// Maps of one frame, shrunk by whole blocks: windowed mean and variance of the values, the clipped
// share, and the derivatives of the mean per shrunk px.
struct WindowMaps {
  cv::Mat mean, variance, clipped, by_x, by_y, laplacian;
};

class ExponentFit {
 public:
  ExponentFit(const ResponseFrames& frames, cv::Size whole)
      : frames_(frames), crop_(frames, whole) {
    const int side = std::min(crop_.size().width, crop_.size().height);
    window_px_ = static_cast<double>(side) / kWindowsPerSide;
    shrink_ = std::max(1, static_cast<int>(window_px_ / 4));
    const std::vector<std::size_t> order = BySharpness(frames);
    reference_ = order.front();
    std::vector<std::size_t> blurred;
    for (const std::size_t i : order) {
      const double added_px2 = crop_.AddedVariancePx2(i, reference_);
      if (added_px2 > kMinAddedBlurPx * kMinAddedBlurPx &&
          std::sqrt(window_px_ * window_px_ + added_px2) < kWidest * side)
        blurred.push_back(i);
    }
    blurred_ = Spread(blurred, kMaxFrames);
    for (const std::size_t i : blurred_) images_.push_back(crop_.Read(i));
    if (!blurred_.empty()) sharp_ = crop_.Read(reference_);
  }

  std::optional<model::Estimate> Run() const {
    double exponent = 1;
    for (int round = 0; round < kMaxRounds; ++round) {
      const std::optional<model::Estimate> slope = SlopeAt(exponent);
      if (!slope) return std::nullopt;
      // The slope is -(p - 1)/2 of the raised values, so that 1 - 2 slope is the power that is
      // left.
      exponent *= std::clamp(1 - 2 * slope->value, 0.6, 1.6);
      if (std::abs(slope->value) < std::max(kSmallSlope, kSmallPart * slope->sigma))
        return model::Estimate{exponent, 2 * slope->sigma * exponent};
    }
    return std::nullopt;
  }

 private:
  static cv::Mat Raised(const cv::Mat& image, double exponent) {
    if (exponent == 1) return image;
    cv::Mat raised;
    cv::pow(cv::max(image, 0), exponent, raised);
    return raised;
  }

  // A mean over whole blocks and a Gaussian that makes it a window of the given sigma, px.
  cv::Mat Windowed(const cv::Mat& image, double sigma_px) const {
    cv::Mat small;
    cv::resize(image, small, image.size() / shrink_, 0, 0, cv::INTER_AREA);
    const double variance_px2 = sigma_px * sigma_px - (shrink_ * shrink_ - 1) / 12.0;
    return GaussianOf(small, std::sqrt(variance_px2) / shrink_);
  }

  WindowMaps MapsOf(const cv::Mat& image, const ResponseFrame& frame, double exponent,
                    double sigma_px, double added_px2) const {
    WindowMaps maps;
    const cv::Mat values = Raised(image, exponent);
    const auto window = [&](const cv::Mat& of) {
      return Windowed(added_px2 > 0 ? BlurredByShape(of, added_px2, frames_.psf) : of, sigma_px);
    };
    maps.mean = window(values);
    maps.variance = window(values.mul(values)) - maps.mean.mul(maps.mean);
    const cv::Mat clipped = ClippedPixels(image, frame);
    maps.clipped = cv::countNonZero(clipped) > 0 ? Windowed(clipped, sigma_px)
                                                 : cv::Mat::zeros(maps.mean.size(), CV_32F);
    cv::Sobel(maps.mean, maps.by_x, CV_32F, 1, 0, 3, 0.125);
    cv::Sobel(maps.mean, maps.by_y, CV_32F, 0, 1, 3, 0.125);
    cv::Laplacian(maps.mean, maps.laplacian, CV_32F);
    return maps;
  }

  // The change of the means against the change of the variances, over all frames, of the values
  // raised to the exponent.
  std::optional<model::Estimate> SlopeAt(double exponent) const {
    ResponseSums sums;
    ChangeSpread spread;
    for (std::size_t i = 0; i < blurred_.size(); ++i) AddFrame(i, exponent, &sums, &spread);
    if (!(spread.after > kMinSpread * kMinSpread * spread.before)) return std::nullopt;
    return sums.Slope();
  }

  struct Windows {
    std::vector<cv::Point> in_frame;        // shrunk px of the frame
    std::vector<cv::Point2f> in_reference;  // and of the reference
  };

  // The windows that both frames show whole.
  Windows CommonWindows(std::size_t index, double total_px, double reference_px) const {
    Windows windows;
    const cv::Size size = crop_.size() / shrink_;
    const int step = std::max(1, static_cast<int>(window_px_ / 2 / shrink_));
    const int margin = static_cast<int>(std::ceil(kReach * total_px / shrink_));
    const double border = kReach * reference_px / shrink_;
    for (int y = margin; y < size.height - margin; y += step) {
      for (int x = margin; x < size.width - margin; x += step) {
        const Eigen::Vector2d p =
            shrink_ * Eigen::Vector2d(x + 0.5, y + 0.5) - Eigen::Vector2d::Constant(0.5);
        const Eigen::Vector2d q =
            (crop_.Place(index, reference_, p) + Eigen::Vector2d::Constant(0.5)) / shrink_ -
            Eigen::Vector2d::Constant(0.5);
        if (q.x() < border || q.y() < border || q.x() > size.width - 1 - border ||
            q.y() > size.height - 1 - border)
          continue;
        windows.in_frame.emplace_back(x, y);
        windows.in_reference.emplace_back(static_cast<float>(q.x()), static_cast<float>(q.y()));
      }
    }
    return windows;
  }

  static Eigen::VectorXd At(const cv::Mat& map, const std::vector<cv::Point2f>& places) {
    constexpr std::size_t kMost = 30000;  // OpenCV maps at most 32767 rows at once
    Eigen::VectorXd out(static_cast<Eigen::Index>(places.size()));
    for (std::size_t from = 0; from < places.size(); from += kMost) {
      const std::vector<cv::Point2f> some(
          places.begin() + static_cast<std::ptrdiff_t>(from),
          places.begin() + static_cast<std::ptrdiff_t>(std::min(places.size(), from + kMost)));
      cv::Mat values;
      cv::remap(map, values, cv::Mat(some, false), cv::noArray(), cv::INTER_CUBIC);
      for (int k = 0; k < values.rows; ++k)
        out[static_cast<Eigen::Index>(from) + k] = values.at<float>(k);
    }
    return out;
  }

  static Eigen::VectorXd At(const cv::Mat& map, const std::vector<cv::Point>& places) {
    Eigen::VectorXd out(static_cast<Eigen::Index>(places.size()));
    for (Eigen::Index k = 0; k < out.size(); ++k)
      out[k] = map.at<float>(places[static_cast<std::size_t>(k)]);
    return out;
  }

  int PartOf(const cv::Point2f& in_reference) const {
    const cv::Size size = crop_.size() / shrink_;
    const auto part = [](float at, int length) {
      return std::clamp(static_cast<int>(kParts * at / static_cast<float>(length)), 0, kParts - 1);
    };
    return kParts * part(in_reference.y, size.height) + part(in_reference.x, size.width);
  }

  // Sums of squares of the change of the variances over all windows, before and after what gain,
  // light and geometry may explain is removed.
  struct ChangeSpread {
    double before = 0, after = 0;
  };

  void AddFrame(std::size_t position, double exponent, ResponseSums* sums,
                ChangeSpread* spread) const {
    const std::size_t index = blurred_[position];
    const double scale = crop_.Scale(index, reference_);
    const double added_px2 = crop_.AddedVariancePx2(index, reference_);
    const double total_px = std::sqrt(window_px_ * window_px_ + added_px2);
    Windows windows = CommonWindows(index, total_px, total_px / scale);
    const WindowMaps own =
        MapsOf(images_[position], frames_.frames[index], exponent, window_px_, 0);
    const WindowMaps sharp = MapsOf(sharp_, frames_.frames[reference_], exponent,
                                    window_px_ / scale, added_px2 / (scale * scale));
    LeaveOutClipped(own, sharp, &windows);
    const auto n = static_cast<Eigen::Index>(windows.in_frame.size());
    if (n < kMinWindows) return;
    const Eigen::VectorXd mean = At(own.mean, windows.in_frame);
    const Eigen::VectorXd reference = At(sharp.mean, windows.in_reference);
    const double gain = mean.sum() / reference.sum();
    Eigen::VectorXd change = ((At(own.variance, windows.in_frame) -
                               gain * gain * At(sharp.variance, windows.in_reference))
                                  .array() /
                              mean.array())
                                 .matrix();
    Eigen::VectorXd rest = mean;
    const Eigen::MatrixXd nuisances = NuisancesOf(windows, sharp, reference);
    const Eigen::MatrixXd basis = Eigen::HouseholderQR<Eigen::MatrixXd>(nuisances).householderQ() *
                                  Eigen::MatrixXd::Identity(n, kNuisances);
    const double before2 = change.squaredNorm();
    for (Eigen::VectorXd* of : {&rest, &change}) *of -= basis * (basis.transpose() * *of);
    spread->before += before2;
    spread->after += change.squaredNorm();
    const double least = kMinChange * mean.mean();
    if (!(change.squaredNorm() > static_cast<double>(n) * least * least)) return;
    const double slope = rest.dot(change) / change.squaredNorm();
    const double freedom =
        std::max(1.0, static_cast<double>(n) / kPixelsPerWindow - kNuisances - 1);
    const double variance = (rest - slope * change).squaredNorm() / freedom;
    if (!(variance > 0) || !std::isfinite(slope)) return;
    for (Eigen::Index k = 0; k < n; ++k) {
      sums->Add(PartOf(windows.in_reference[static_cast<std::size_t>(k)]), index,
                rest[k] * change[k] / variance, change[k] * change[k] / variance);
    }
  }

  static void LeaveOutClipped(const WindowMaps& own, const WindowMaps& sharp, Windows* windows) {
    if (windows->in_frame.empty()) return;
    const Eigen::VectorXd here = At(own.clipped, windows->in_frame);
    const Eigen::VectorXd there = At(sharp.clipped, windows->in_reference);
    Windows kept;
    for (std::size_t k = 0; k < windows->in_frame.size(); ++k) {
      const auto row = static_cast<Eigen::Index>(k);
      if (here[row] > kMaxClipped || there[row] > kMaxClipped) continue;
      kept.in_frame.push_back(windows->in_frame[k]);
      kept.in_reference.push_back(windows->in_reference[k]);
    }
    *windows = std::move(kept);
  }

  // The columns are gain, black level or stray light, slopes of the light, vignetting, shifts,
  // scale, and blur.
  Eigen::MatrixXd NuisancesOf(const Windows& windows, const WindowMaps& sharp,
                              const Eigen::VectorXd& reference) const {
    const Eigen::VectorXd by_x = At(sharp.by_x, windows.in_reference);
    const Eigen::VectorXd by_y = At(sharp.by_y, windows.in_reference);
    const Eigen::VectorXd laplacian = At(sharp.laplacian, windows.in_reference);
    const cv::Size size = crop_.size() / shrink_;
    Eigen::MatrixXd columns(reference.size(), kNuisances);
    for (Eigen::Index k = 0; k < reference.size(); ++k) {
      const cv::Point& p = windows.in_frame[static_cast<std::size_t>(k)];
      const double x = 2.0 * p.x / size.width - 1, y = 2.0 * p.y / size.height - 1;
      columns.row(k) << reference[k], 1, x * reference[k], y * reference[k],
          (x * x + y * y) * reference[k], by_x[k], by_y[k], x * by_x[k] + y * by_y[k], laplacian[k];
    }
    return columns;
  }

  const ResponseFrames& frames_;
  ResponseCrop crop_;
  double window_px_ = 0;
  int shrink_ = 1;
  std::size_t reference_ = 0;
  std::vector<std::size_t> blurred_;
  std::vector<cv::Mat> images_;
  cv::Mat sharp_;
};

}  // namespace

std::optional<model::Estimate> MeasureLightExponent(const ResponseFrames& frames, cv::Size size) {
  if (frames.frames.size() < 4) return std::nullopt;
  return ExponentFit(frames, size).Run();
}

}  // namespace thicklens::calib

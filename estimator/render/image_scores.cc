#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/estimator/compare.h"

namespace thicklens::estimator {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

// Wang et al. 2004, section III.C; the range of the values is 1.
constexpr int kSsimWindowPx = 11;
constexpr double kSsimSigmaPx = 1.5;
constexpr double kSsimC1 = 0.01 * 0.01;
constexpr double kSsimC2 = 0.03 * 0.03;

// An edge pixel has at least this share of the gradient that one pixel in a hundred exceeds, ...
constexpr double kEdgeShare = 0.5;
constexpr double kStrongest = 0.01;
// ... and at least this gradient, per px: white noise of one step of 8 bits, whose Sobel gradients
// are 0.61 steps per px (root mean square), exceeds it at 2 of 100 000 pixels.
constexpr double kMinEdge = 2 / 255.0;

std::string SizeText(const model::EncodedValues& image) {
  return fmt::format("{}x{} px in {} channel(s)", image.width_px, image.height_px, image.channels);
}

void RequireComplete(const std::string& name, const model::EncodedValues& image) {
  const std::size_t count = static_cast<std::size_t>(std::max(0, image.width_px)) *
                            static_cast<std::size_t>(std::max(0, image.height_px)) *
                            static_cast<std::size_t>(std::max(0, image.channels));
  if (count == 0 || (image.channels != 1 && image.channels != 3) || image.values.size() != count) {
    throw Error(
        fmt::format("{}: {} values for {}: a grey or RGB image with all its values is expected",
                    name, image.values.size(), SizeText(image)));
  }
}

// Returns the image without its border; empty if nothing is left.
cv::Rect Inside(int width_px, int height_px, int border_px) {
  const int across = width_px - 2 * border_px;
  const int down = height_px - 2 * border_px;
  return across > 0 && down > 0 ? cv::Rect(border_px, border_px, across, down) : cv::Rect();
}

void RequireBorder(int width_px, int height_px, int border_px) {
  const int largest_px = (std::min(width_px, height_px) - 1) / 2;
  if (border_px >= 0 && border_px <= largest_px) return;
  throw Error(fmt::format("border of {} px: for a size of {}x{} px it must be from 0 to {} px",
                          border_px, width_px, height_px, largest_px));
}

const float* PixelAt(const model::EncodedValues& image, int x, int y) {
  return image.values.data() +
         (static_cast<std::ptrdiff_t>(y) * image.width_px + x) * image.channels;
}

Eigen::Vector3d ColourAt(const model::EncodedValues& image, int x, int y) {
  const float* value = PixelAt(image, x, y);
  if (image.channels == 1) return Eigen::Vector3d::Constant(value[0]);
  return {value[0], value[1], value[2]};
}

// Double is needed because the variances of SSIM are small differences of large sums.
cv::Mat1d GreyOf(const model::EncodedValues& image) {
  cv::Mat1d grey(image.height_px, image.width_px);
  for (int y = 0; y < image.height_px; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < image.width_px; ++x) {
      const float* value = PixelAt(image, x, y);
      grey(y, x) = image.channels == 1 ? value[0]
                                       : 0.2126 * value[0] + 0.7152 * value[1] + 0.0722 * value[2];
    }
  }
  return grey;
}

// PSNR, dB: -10 log10 of the mean squared difference; full scale is 1.
double PsnrDb(const model::EncodedValues& reference, const model::EncodedValues& other,
              const cv::Rect& inside) {
  double sum = 0;
  for (int y = inside.y; y < inside.y + inside.height; ++y) {
    ThrowIfCancelled();
    const float* a = PixelAt(reference, inside.x, y);
    const float* b = PixelAt(other, inside.x, y);
    for (int i = 0; i < inside.width * reference.channels; ++i) {
      const double difference = static_cast<double>(a[i]) - b[i];
      sum += difference * difference;
    }
  }
  return -10 * std::log10(sum / (static_cast<double>(inside.area()) * reference.channels));
}

cv::Mat1d WindowMean(const cv::Mat& values) {
  cv::Mat1d mean;
  cv::GaussianBlur(values, mean, cv::Size(kSsimWindowPx, kSsimWindowPx), kSsimSigmaPx,
                   kSsimSigmaPx);
  return mean;
}

// SSIM [L17], equation 13 of Wang et al. 2004: (2 mu_a mu_b + C1)(2 s_ab + C2)/((mu_a^2 + mu_b^2 +
// C1)(s_a^2 + s_b^2 + C2)) of each window, averaged; NaN if no window lies within the image.
double MeanSsim(const cv::Mat1d& a, const cv::Mat1d& b, int border_px) {
  const cv::Rect inside = Inside(a.cols, a.rows, std::max(border_px, kSsimWindowPx / 2));
  if (inside.empty()) return kNone;
  const cv::Mat1d mu_a = WindowMean(a);
  const cv::Mat1d mu_b = WindowMean(b);
  const cv::Mat1d square_a = WindowMean(a.mul(a));
  const cv::Mat1d square_b = WindowMean(b.mul(b));
  const cv::Mat1d product = WindowMean(a.mul(b));
  double sum = 0;
  for (int y = inside.y; y < inside.y + inside.height; ++y) {
    ThrowIfCancelled();
    for (int x = inside.x; x < inside.x + inside.width; ++x) {
      const double means = mu_a(y, x) * mu_b(y, x);
      const double squares = mu_a(y, x) * mu_a(y, x) + mu_b(y, x) * mu_b(y, x);
      const double covariance = product(y, x) - means;
      const double variances = square_a(y, x) + square_b(y, x) - squares;
      sum += (2 * means + kSsimC1) * (2 * covariance + kSsimC2) /
             ((squares + kSsimC1) * (variances + kSsimC2));
    }
  }
  return sum / inside.area();
}

double MeanDeltaE94(const model::EncodedValues& reference, const model::EncodedValues& other,
                    const cv::Rect& inside) {
  double sum = 0;
  for (int y = inside.y; y < inside.y + inside.height; ++y) {
    ThrowIfCancelled();
    for (int x = inside.x; x < inside.x + inside.width; ++x)
      sum += DeltaE94(LabOf(ColourAt(reference, x, y)), LabOf(ColourAt(other, x, y)));
  }
  return sum / inside.area();
}

// Change per px to the right and down.
struct Gradient {
  explicit Gradient(const cv::Mat1d& grey) {
    cv::Sobel(grey, right, CV_64F, 1, 0, 3, 1.0 / 8);
    cv::Sobel(grey, down, CV_64F, 0, 1, 3, 1.0 / 8);
  }
  double Magnitude(int y, int x) const { return std::hypot(right(y, x), down(y, x)); }

  cv::Mat1d right, down;
};

double EdgeThreshold(const Gradient& reference, const cv::Rect& inside) {
  std::vector<double> magnitudes;
  magnitudes.reserve(static_cast<std::size_t>(inside.area()));
  for (int y = inside.y; y < inside.y + inside.height; ++y) {
    ThrowIfCancelled();
    for (int x = inside.x; x < inside.x + inside.width; ++x)
      magnitudes.push_back(reference.Magnitude(y, x));
  }
  const auto strong = magnitudes.end() - 1 -
                      static_cast<std::ptrdiff_t>(kStrongest * static_cast<double>(inside.area()));
  std::nth_element(magnitudes.begin(), strong, magnitudes.end());
  return std::max(kMinEdge, kEdgeShare * *strong);
}

// Mean |cos| of the angle between the gradients, over the edge pixels of the reference.
std::optional<double> MacadeStandin(const cv::Mat1d& reference, const cv::Mat1d& other,
                                    int border_px) {
  // The gradient of an outermost pixel would be that of an extrapolated image.
  const cv::Rect inside = Inside(reference.cols, reference.rows, std::max(border_px, 1));
  if (inside.empty()) return std::nullopt;
  const Gradient a(reference);
  const Gradient b(other);
  const double threshold = EdgeThreshold(a, inside);
  double sum = 0;
  long edges = 0;
  for (int y = inside.y; y < inside.y + inside.height; ++y) {
    ThrowIfCancelled();
    for (int x = inside.x; x < inside.x + inside.width; ++x) {
      const double magnitude_a = a.Magnitude(y, x);
      if (!(magnitude_a >= threshold)) continue;
      ++edges;
      const double magnitude_b = b.Magnitude(y, x);
      if (magnitude_b == 0) continue;
      sum += std::abs(a.right(y, x) * b.right(y, x) + a.down(y, x) * b.down(y, x)) /
             (magnitude_a * magnitude_b);
    }
  }
  if (edges == 0) return std::nullopt;
  return sum / static_cast<double>(edges);
}

// The linear part of Lab below (6/29)^3 joins the cube root with equal slope.
double LabCurve(double relative) {
  constexpr double kEdge = 6.0 / 29;
  if (relative > kEdge * kEdge * kEdge) return std::cbrt(relative);
  return relative / (3 * kEdge * kEdge) + 4.0 / 29;
}

}  // namespace

ImageScores CompareImages(const model::EncodedValues& reference, const model::EncodedValues& other,
                          int border_px) {
  RequireComplete("reference", reference);
  RequireComplete("other image", other);
  if (reference.width_px != other.width_px || reference.height_px != other.height_px ||
      reference.channels != other.channels) {
    throw Error(fmt::format("the reference has {}, but the other image has {}: these must be equal",
                            SizeText(reference), SizeText(other)));
  }
  RequireBorder(reference.width_px, reference.height_px, border_px);
  const cv::Rect inside = Inside(reference.width_px, reference.height_px, border_px);
  const cv::Mat1d reference_grey = GreyOf(reference);
  const cv::Mat1d other_grey = GreyOf(other);
  ImageScores scores;
  scores.psnr_db = PsnrDb(reference, other, inside);
  scores.ssim = MeanSsim(reference_grey, other_grey, border_px);
  scores.delta_e94_mean = MeanDeltaE94(reference, other, inside);
  scores.macade_standin = MacadeStandin(reference_grey, other_grey, border_px);
  return scores;
}

// CIE 116-1995 [L18]: sqrt(dL^2 + (dC/(1 + 0.045 C1))^2 + (dH/(1 + 0.015 C1))^2), dH^2 = da^2 +
// db^2 - dC^2, where C1 is the chroma of the reference.
double DeltaE94(const Eigen::Vector3d& reference_lab, const Eigen::Vector3d& lab) {
  const double reference_chroma = std::hypot(reference_lab.y(), reference_lab.z());
  const Eigen::Vector3d change = lab - reference_lab;
  const double chroma_change = std::hypot(lab.y(), lab.z()) - reference_chroma;
  const double hue_change_squared =
      std::max(0.0, change.tail<2>().squaredNorm() - chroma_change * chroma_change);
  const double weighted_chroma = chroma_change / (1 + 0.045 * reference_chroma);
  const double hue_weight = 1 + 0.015 * reference_chroma;
  return std::sqrt(change.x() * change.x() + weighted_chroma * weighted_chroma +
                   hue_change_squared / (hue_weight * hue_weight));
}

// IEC 61966-2-1 to XYZ, then CIE 15. The white is that of the matrix, (1, 1, 1): D65 to the digits
// of the matrix. Greys have a* = b* = 0.
Eigen::Vector3d LabOf(const Eigen::Vector3d& srgb) {
  static const Eigen::Matrix3d to_xyz =
      (Eigen::Matrix3d() << 0.4124564, 0.3575761, 0.1804375, 0.2126729, 0.7151522, 0.0721750,
       0.0193339, 0.1191920, 0.9503041)
          .finished();
  static const Eigen::Vector3d white = to_xyz.rowwise().sum();
  const model::TransferCurve curve = model::TransferCurve::Srgb();
  const Eigen::Vector3d light(curve.Decode(srgb.x()), curve.Decode(srgb.y()),
                              curve.Decode(srgb.z()));
  const Eigen::Vector3d relative = (to_xyz * light).cwiseQuotient(white);
  const double fx = LabCurve(relative.x());
  const double fy = LabCurve(relative.y());
  const double fz = LabCurve(relative.z());
  return {116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)};
}

}  // namespace thicklens::estimator

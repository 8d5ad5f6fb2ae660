#include "calib/registration/coarse_registration.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "calib/sharpness/edge_pixels.h"
#include "thicklens/base/cancel.h"

namespace thicklens::calib {
namespace {

constexpr int kCoarseSizePx = 160;
constexpr int kAgreementSizePx = 100;
constexpr int kSmallestFieldPx = 24;  // px of shrunk images
constexpr int kPadding = 2;
constexpr int kIterations = 40;
constexpr double kPrecision = 1e-4;      // precision of the correlation
constexpr double kMinCorrelation = 0.3;  // blur alone may cost that much; later checks are stricter
// Width of the preference for small shifts, relative to the field.
constexpr double kLikelyShift = 0.1;

// Catmull-Rom weights for a position t in [0, 1) between the middle two of four samples.
inline void CubicWeights(float t, float* w) {
  const float t2 = t * t, t3 = t2 * t;
  w[0] = 0.5F * (-t3 + 2 * t2 - t);
  w[1] = 0.5F * (3 * t3 - 5 * t2 + 2);
  w[2] = 0.5F * (-3 * t3 + 4 * t2 + t);
  w[3] = 0.5F * (t3 - t2);
}

// Shift of the frame relative to the reference, both of one size, from the peak of the
// cross-correlation with half-whitened spectra. The peak is 1 where all phases agree.
struct PhasePeak {
  cv::Point2d shift{0, 0};
  double height = 0;
};
PhasePeak PeakByPhase(const cv::Mat& reference, const cv::Mat& frame) {
  cv::Mat window, spectra[2];
  cv::createHanningWindow(window, reference.size(), CV_32F);
  for (int i = 0; i < 2; ++i) {
    const cv::Mat& image = i == 0 ? reference : frame;
    cv::Mat windowed = (image - cv::mean(image)).mul(window);
    cv::dft(windowed, spectra[i], cv::DFT_COMPLEX_OUTPUT);
  }
  double amplitudes = 0;
  for (int y = 0; y < spectra[0].rows; ++y) {
    ThrowIfCancelled();
    auto* r = spectra[0].ptr<cv::Vec2f>(y);
    const auto* f = spectra[1].ptr<cv::Vec2f>(y);
    for (int x = 0; x < spectra[0].cols; ++x) {
      const float real = f[x][0] * r[x][0] + f[x][1] * r[x][1];
      const float imaginary = f[x][1] * r[x][0] - f[x][0] * r[x][1];
      const float root = std::sqrt(std::hypot(real, imaginary)) + 1e-12F;
      r[x] = cv::Vec2f(real / root, imaginary / root);
      amplitudes += static_cast<double>(root);
    }
  }
  cv::Mat correlation;
  cv::dft(spectra[0], correlation, cv::DFT_INVERSE | cv::DFT_REAL_OUTPUT);
  const double width = kLikelyShift * std::max(reference.cols, reference.rows);
  PhasePeak best;
  double highest = -1e300;
  for (int y = 0; y < correlation.rows; ++y) {
    ThrowIfCancelled();
    const int dy = y <= correlation.rows / 2 ? y : y - correlation.rows;
    for (int x = 0; x < correlation.cols; ++x) {
      const int dx = x <= correlation.cols / 2 ? x : x - correlation.cols;
      const double prior = 1 / (1 + (dx * dx + dy * dy) / (4 * width * width));
      const double value = static_cast<double>(correlation.at<float>(y, x)) * prior;
      if (value > highest) {
        highest = value;
        best.shift = cv::Point2d(dx, dy);
      }
    }
  }
  best.height = highest / amplitudes;
  return best;
}

// Information about the scale, independent of shift and rotation, relative to half the sum of
// |gradient|^2 |p|^2, and about the shift from the tensor of the gradients.
ImageInformation InformationOfShrunk(const cv::Mat& image) {
  const Gradient gradient = CentralGradient(Smoothed(image, 1));
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  double most = 0;
  for (int y = 1; y + 1 < image.rows; ++y) {
    ThrowIfCancelled();
    const double py = y - 0.5 * (image.rows - 1);
    const auto* row_x = gradient.x.ptr<float>(y);
    const auto* row_y = gradient.y.ptr<float>(y);
    for (int x = 1; x + 1 < image.cols; ++x) {
      const double px = x - 0.5 * (image.cols - 1);
      const auto gx = static_cast<double>(row_x[x]), gy = static_cast<double>(row_y[x]);
      const Eigen::Vector4d design(gx * px + gy * py, gx, gy, gy * px - gx * py);
      normal += design * design.transpose();
      most += 0.5 * (gx * gx + gy * gy) * (px * px + py * py);
    }
  }
  if (!(most > 0)) return {};
  const Eigen::Matrix3d other = normal.bottomRightCorner<3, 3>();
  const Eigen::Vector3d common = normal.bottomLeftCorner<3, 1>();
  const Eigen::Vector2d shift =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(normal.block<2, 2>(1, 1)).eigenvalues();
  return {(normal(0, 0) - common.dot(other.fullPivLu().solve(common))) / most,
          std::max(0.0, shift[0]) / shift[1]};
}

cv::Rect Inside(const cv::Rect2d& field, int factor) {
  // Pixels of the shrunk image that lie entirely in the field.
  const int left = static_cast<int>(std::ceil((field.x + 0.5) / factor));
  const int top = static_cast<int>(std::ceil((field.y + 0.5) / factor));
  const int right = static_cast<int>(std::floor((field.x + field.width + 0.5) / factor));
  const int bottom = static_cast<int>(std::floor((field.y + field.height + 0.5) / factor));
  return {left, top, std::max(0, right - left), std::max(0, bottom - top)};
}

// Both images shrunk, the reference brought to the frame's geometry by the scale and the centre
// alone.
struct Start {
  FrameMap map;
  int factor = 1;
  cv::Mat small;     // the frame, shrunk
  cv::Rect region;   // part of `small` that both images show
  cv::Mat expected;  // the reference in that region
};

int FactorFor(double field_px, int size_px) {
  return std::max(1, static_cast<int>(std::ceil(field_px / size_px)));
}

// The middle of a region, cut to sides that have fast transforms.
cv::Rect FastPart(const cv::Rect& region) {
  const auto fast = [](int side) {
    while (side > 1 && cv::getOptimalDFTSize(side) != side) --side;
    return side;
  };
  const cv::Size size(fast(region.width), fast(region.height));
  return {region.x + (region.width - size.width) / 2, region.y + (region.height - size.height) / 2,
          size.width, size.height};
}

std::optional<Start> StartFrom(const cv::Mat& reference, const cv::Mat& frame, double scale,
                               cv::Point2d centre, int size_px, bool is_for_phases) {
  Start start;
  start.map.linear *= scale;
  start.map.centre = Eigen::Vector2d(centre.x, centre.y);
  start.map.offset = (1 - scale) * start.map.centre;
  const cv::Rect2d field = SharedField(start.map, reference.size(), frame.size());
  start.factor = FactorFor(std::max(field.width, field.height), size_px);
  start.region = Inside(field, start.factor);
  if (is_for_phases) start.region = FastPart(start.region);
  if (std::min(start.region.width, start.region.height) < kSmallestFieldPx) return std::nullopt;
  start.small = Shrunk(frame, start.factor);
  start.expected = InFrameGeometry(reference, start.map, start.factor, start.region);
  return start;
}

}  // namespace

cv::Rect2d SharedField(const FrameMap& map, cv::Size reference, cv::Size frame) {
  const auto mapped = [&](double x, double y) -> Eigen::Vector2d {
    return map.linear * Eigen::Vector2d(x, y) + map.offset;
  };
  const double right = reference.width - 1, bottom = reference.height - 1;
  const Eigen::Vector2d a = mapped(0, 0), b = mapped(right, 0);
  const Eigen::Vector2d c = mapped(0, bottom), d = mapped(right, bottom);
  const double x0 = std::max({-0.5, a.x(), c.x()});
  const double y0 = std::max({-0.5, a.y(), b.y()});
  const double x1 = std::min({frame.width - 0.5, b.x(), d.x()});
  const double y1 = std::min({frame.height - 0.5, c.y(), d.y()});
  return {x0, y0, std::max(0.0, x1 - x0), std::max(0.0, y1 - y0)};
}

cv::Mat Shrunk(const cv::Mat& image, int factor) {
  if (factor <= 1) return image;
  const cv::Size size(image.cols / factor, image.rows / factor);
  cv::Mat shrunk;
  cv::resize(image(cv::Rect(0, 0, size.width * factor, size.height * factor)), shrunk, size, 0, 0,
             cv::INTER_AREA);
  return shrunk;
}

cv::Mat InFrameGeometry(const cv::Mat& reference, const FrameMap& map, int frame_factor,
                        cv::Rect region) {
  // The reference is first shrunk to about the requested resolution, so that sampling does not
  // alias.
  const double scale = std::sqrt(std::abs(map.linear.determinant()));
  const int factor = std::max(1, static_cast<int>(std::ceil(frame_factor / scale - 0.25)));
  const cv::Mat source = Shrunk(reference, factor);
  const Eigen::Matrix2d inverse = map.linear.inverse();
  // The pixel (x, y) of the frame moves the position in `source` by step (x, y) - bend |q|^2 q.
  const Eigen::Matrix2d step = inverse * frame_factor / factor;
  const Eigen::Matrix2d bend = inverse * map.cubic / factor;
  const Eigen::Vector2d half(0.5, 0.5);
  const auto place = [&](double x, double y) -> Eigen::Vector2d {
    const Eigen::Vector2d frame = frame_factor * (Eigen::Vector2d(x, y) + half) - half;
    return (inverse * (frame - map.offset) + half) / factor - half;
  };
  cv::Mat out(region.size(), CV_32F);
  const int last_column = source.cols - 1, last_row = source.rows - 1;
  for (int y = 0; y < out.rows; ++y) {
    ThrowIfCancelled();
    const Eigen::Vector2d start = place(region.x, region.y + y);
    const double qy = frame_factor * (region.y + y + 0.5) - 0.5 - map.centre.y();
    auto* row = out.ptr<float>(y);
    for (int x = 0; x < out.cols; ++x) {
      double px = start.x() + step(0, 0) * x;
      double py = start.y() + step(1, 0) * x;
      if (map.cubic != 0) {
        const double qx = frame_factor * (region.x + x + 0.5) - 0.5 - map.centre.x();
        const double squared = qx * qx + qy * qy;
        px -= squared * (bend(0, 0) * qx + bend(0, 1) * qy);
        py -= squared * (bend(1, 0) * qx + bend(1, 1) * qy);
      }
      px = std::clamp(px, 0.0, static_cast<double>(last_column));
      py = std::clamp(py, 0.0, static_cast<double>(last_row));
      const int ix = static_cast<int>(px), iy = static_cast<int>(py);
      float wx[4], wy[4];
      CubicWeights(static_cast<float>(px - ix), wx);
      CubicWeights(static_cast<float>(py - iy), wy);
      float sum = 0;
      if (ix >= 1 && iy >= 1 && ix + 2 <= last_column && iy + 2 <= last_row) {
        for (int j = 0; j < 4; ++j) {
          const float* from = source.ptr<float>(iy - 1 + j) + ix - 1;
          sum += wy[j] * (wx[0] * from[0] + wx[1] * from[1] + wx[2] * from[2] + wx[3] * from[3]);
        }
      } else {
        for (int j = 0; j < 4; ++j) {
          const float* from = source.ptr<float>(std::clamp(iy - 1 + j, 0, last_row));
          for (int i = 0; i < 4; ++i)
            sum += wy[j] * wx[i] * from[std::clamp(ix - 1 + i, 0, last_column)];
        }
      }
      row[x] = sum;
    }
  }
  return out;
}

ImageInformation InformationOf(const cv::Mat& image) {
  return InformationOfShrunk(
      Shrunk(image, FactorFor(std::max(image.cols, image.rows), kCoarseSizePx)));
}

std::optional<FrameMap> ShiftCoarsely(const cv::Mat& reference, const cv::Mat& frame, double scale,
                                      cv::Point2d centre) {
  const std::optional<Start> start =
      StartFrom(reference, frame, scale, centre, kCoarseSizePx, false);
  if (!start) return std::nullopt;
  const cv::Point2d shift = PeakByPhase(start->expected, start->small(start->region)).shift;
  FrameMap map = start->map;
  map.offset += start->factor * Eigen::Vector2d(shift.x, shift.y);
  return map;
}

double CoarseAgreement(const cv::Mat& reference, const cv::Mat& frame, double scale,
                       cv::Point2d centre) {
  const std::optional<Start> start =
      StartFrom(reference, frame, scale, centre, kAgreementSizePx, true);
  return start ? PeakByPhase(start->expected, start->small(start->region)).height : 0;
}

std::optional<FrameMap> RegisterCoarsely(const cv::Mat& reference, const cv::Mat& frame,
                                         double expected_scale, cv::Point2d centre) {
  const std::optional<Start> start =
      StartFrom(reference, frame, expected_scale, centre, kCoarseSizePx, false);
  if (!start || !(InformationOfShrunk(start->expected).scale > kMinScaleInformation))
    return std::nullopt;
  const cv::Mat& small = start->small;
  const cv::Mat& expected = start->expected;
  const cv::Rect region = start->region;
  const cv::Point2d shift = PeakByPhase(expected, small(region)).shift;
  // ECC treats everything outside an image as black, and mixes it into the outermost pixels.
  cv::Mat padded,
      mask = cv::Mat::zeros(small.rows + 2 * kPadding, small.cols + 2 * kPadding, CV_8U);
  cv::copyMakeBorder(small, padded, kPadding, kPadding, kPadding, kPadding, cv::BORDER_REPLICATE);
  mask(cv::Rect(kPadding, kPadding, small.cols, small.rows)).setTo(1);
  // The warp maps the pixels of `expected` to those of `padded`.
  const Eigen::Vector2d place(region.x + kPadding, region.y + kPadding);
  cv::Mat warp = (cv::Mat_<float>(2, 3) << 1, 0, place.x() + shift.x, 0, 1, place.y() + shift.y);
  try {
    const cv::TermCriteria criteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, kIterations,
                                    kPrecision);
    const double correlation =
        cv::findTransformECC(expected, padded, warp, cv::MOTION_AFFINE, criteria, mask, 5);
    if (!(correlation > kMinCorrelation)) return std::nullopt;
  } catch (const cv::Exception&) {
    return std::nullopt;  // ECC reports by an exception that it did not converge
  }
  Eigen::Matrix2d linear;
  Eigen::Vector2d offset;
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) linear(i, j) = static_cast<double>(warp.at<float>(i, j));
    offset[i] = static_cast<double>(warp.at<float>(i, 2));
  }
  // The map between expected and observed places in the shrunk frame.
  offset -= linear * Eigen::Vector2d(region.x, region.y) + Eigen::Vector2d(kPadding, kPadding);
  // Shrunk pixel w has the full-resolution coordinate f (w + 1/2) - 1/2.
  const Eigen::Vector2d half(0.5, 0.5);
  offset = start->factor * (offset + half - linear * half) - half + linear * half;
  FrameMap map = start->map;
  map.linear = linear * start->map.linear;
  map.offset = linear * start->map.offset + offset;
  if (!(map.linear.determinant() > 0)) return std::nullopt;
  return map;
}

}  // namespace thicklens::calib

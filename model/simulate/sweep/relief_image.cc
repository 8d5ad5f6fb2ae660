#include "model/simulate/sweep/relief_image.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "thicklens/base/cancel.h"
#include "thicklens/base/pi.h"

namespace thicklens::model {
namespace {

constexpr int kAperturePositions = 192;
// Covers closer to 0 or 1 than this have no outline within the aperture.
constexpr double kNoOutline = 1e-4;
constexpr int kGearTeeth = 12;
constexpr double kToothDepth = 0.2;  // of the radius
constexpr int kCellParts = 4;        // a cell is sampled so many times along each axis

// Positions on the aperture in units of their standard deviation along an axis, spread evenly by
// the golden angle.
std::vector<Eigen::Vector2d> AperturePositions(Psf psf) {
  const double golden_rad = kPi * (3 - std::sqrt(5.0));
  std::vector<Eigen::Vector2d> positions;
  for (int i = 0; i < kAperturePositions; ++i) {
    const double part = (i + 0.5) / kAperturePositions;
    const double radius =
        psf == Psf::kDisc ? 2 * std::sqrt(part) : std::sqrt(-2 * std::log(1 - part));
    positions.emplace_back(radius * std::cos(i * golden_rad), radius * std::sin(i * golden_rad));
  }
  return positions;
}

// Bilinear value at a place, in samples; the borders continue outward.
double ValueAt(const cv::Mat& image, double x, double y) {
  x = std::clamp(x, 0.0, image.cols - 1.001);
  y = std::clamp(y, 0.0, image.rows - 1.001);
  const int column = static_cast<int>(x), row = static_cast<int>(y);
  const double dx = x - column, dy = y - row;
  const double* upper = image.ptr<double>(row) + column;
  const double* lower = image.ptr<double>(std::min(row + 1, image.rows - 1)) + column;
  return (1 - dy) * ((1 - dx) * upper[0] + dx * upper[1]) +
         dy * ((1 - dx) * lower[0] + dx * lower[1]);
}

// The covariance of a part's cover and the target's light over the aperture, at each sample.
cv::Mat ApertureCovariance(const ReliefLayer& target, const ReliefLayer& part,
                           const cv::Mat& blurred_cover, double step_px,
                           const std::vector<Eigen::Vector2d>& positions) {
  cv::Mat covariance = cv::Mat::zeros(target.light.size(), CV_64F);
  const double target_reach = target.defocus_px / step_px;
  const double part_reach = part.defocus_px / step_px;
  const auto count = static_cast<double>(positions.size());
  for (int y = 0; y < covariance.rows; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < covariance.cols; ++x) {
      const double cover_here = blurred_cover.at<double>(y, x);
      if (!(cover_here > kNoOutline && cover_here < 1 - kNoOutline)) continue;
      double product = 0, covers = 0, lights = 0;
      for (const Eigen::Vector2d& a : positions) {
        const double cover = ValueAt(part.cover, x - part_reach * a.x(), y - part_reach * a.y());
        const double light =
            ValueAt(target.light, x - target_reach * a.x(), y - target_reach * a.y());
        product += cover * light;
        covers += cover;
        lights += light;
      }
      covariance.at<double>(y, x) = product / count - covers / count * (lights / count);
    }
  }
  return covariance;
}

bool Covers(const ReliefPartOptions& part, const Eigen::Vector2d& from_centre_mm) {
  const Eigen::Vector2d half_mm = 0.5 * part.size_mm;
  if (part.shape == ReliefPartOptions::Shape::kRectangle) {
    return std::abs(from_centre_mm.x()) <= half_mm.x() &&
           std::abs(from_centre_mm.y()) <= half_mm.y();
  }
  const double place = from_centre_mm.norm() / half_mm.x();
  if (part.shape == ReliefPartOptions::Shape::kDisc || place <= 1 - kToothDepth) return place <= 1;
  const double turn = std::atan2(from_centre_mm.y(), from_centre_mm.x()) * kGearTeeth / (2 * kPi);
  return place <= 1 && turn - std::floor(turn) < 0.5;
}

}  // namespace

double CoverAt(const ReliefPartOptions& part, const Eigen::Vector2d& place_mm, double cell_mm) {
  const Eigen::Vector2d from_centre_mm = place_mm - part.centre_mm;
  const double farthest_mm = 0.5 * part.size_mm.norm() + cell_mm;
  if (from_centre_mm.squaredNorm() > farthest_mm * farthest_mm) return 0;
  int covered = 0;
  for (int i = 0; i < kCellParts; ++i) {
    for (int j = 0; j < kCellParts; ++j) {
      const Eigen::Vector2d beside_mm =
          cell_mm / kCellParts *
          Eigen::Vector2d(j - 0.5 * (kCellParts - 1), i - 0.5 * (kCellParts - 1));
      covered += Covers(part, from_centre_mm + beside_mm) ? 1 : 0;
    }
  }
  return static_cast<double>(covered) / (kCellParts * kCellParts);
}

cv::Mat Filtered(const cv::Mat& image, double step_px,
                 const std::function<double(const Eigen::Vector2d& frequency)>& transfer) {
  // The border that a fast transform needs continues the image periodically.
  const cv::Size size(cv::getOptimalDFTSize(image.cols), cv::getOptimalDFTSize(image.rows));
  cv::Mat spectrum;
  cv::copyMakeBorder(image, spectrum, 0, size.height - image.rows, 0, size.width - image.cols,
                     cv::BORDER_WRAP);
  cv::dft(spectrum, spectrum, cv::DFT_COMPLEX_OUTPUT);
  const auto frequency = [step_px](int i, int count) {
    return static_cast<double>(2 * i <= count ? i : i - count) / (count * step_px);
  };
  for (int y = 0; y < size.height; ++y) {
    ThrowIfCancelled();
    auto* row = spectrum.ptr<cv::Vec2d>(y);
    for (int x = 0; x < size.width; ++x)
      row[x] *= transfer({frequency(x, size.width), frequency(y, size.height)});
  }
  cv::Mat filtered;
  cv::dft(spectrum, filtered, cv::DFT_INVERSE | cv::DFT_SCALE | cv::DFT_REAL_OUTPUT);
  return filtered(cv::Rect(0, 0, image.cols, image.rows)).clone();
}

cv::Mat ReliefImage(const ReliefLayer& target, const std::vector<ReliefLayer>& parts,
                    double step_px, Psf psf, const TransferOfDefocus& transfer) {
  const std::vector<Eigen::Vector2d> positions = AperturePositions(psf);
  cv::Mat image = target.blurred.clone();
  for (const ReliefLayer& part : parts) {
    const double sigma_px = std::abs(part.defocus_px);
    const auto blur = [&](const cv::Mat& of) {
      return Filtered(of, step_px, [&](const Eigen::Vector2d& f) { return transfer(sigma_px, f); });
    };
    const cv::Mat cover = blur(part.cover);
    image += blur(part.cover.mul(part.light));
    image -= cover.mul(target.blurred);
    image -= ApertureCovariance(target, part, cover, step_px, positions);
  }
  return image;
}

}  // namespace thicklens::model

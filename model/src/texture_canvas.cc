#include "texture_canvas.h"

#include <cmath>

namespace thicklens::model {
namespace {

constexpr double kPi = 3.14159265358979323846;

// Detail fades towards the limit of the band as behind a Gaussian of this width, so that edges do
// not ring.
constexpr double kSoftnessPx = 0.5;

int QuickCount(double samples) {
  const int needed = static_cast<int>(std::ceil(samples * (1 - 1e-12)));
  return std::min(cv::getOptimalDFTSize(std::max(needed, 4)), kMaxTileSamples);
}

double SincSquared(double x) {
  if (x == 0) return 1;
  const double sinc = std::sin(kPi * x) / (kPi * x);
  return sinc * sinc;
}

}  // namespace

TextureCanvas MakeTextureCanvas(const Eigen::Vector2d& low_mm, const Eigen::Vector2d& high_mm,
                                double coarsest_pixel_mm, double unit_mm) {
  Eigen::Vector2d size_mm = high_mm - low_mm;
  if (unit_mm > 0) size_mm = unit_mm * (size_mm / unit_mm).array().ceil().max(1);
  const double spacing_mm =
      std::max(coarsest_pixel_mm / kSamplesPerPixel, size_mm.maxCoeff() / kMaxTileSamples);
  TextureCanvas canvas;
  canvas.columns = QuickCount(size_mm.x() / spacing_mm);
  canvas.rows = QuickCount(size_mm.y() / spacing_mm);
  canvas.spacing_mm = {spacing_mm, spacing_mm};
  if (unit_mm > 0) {
    canvas.spacing_mm = {size_mm.x() / canvas.columns, size_mm.y() / canvas.rows};
  }
  canvas.origin_mm = low_mm;
  for (cv::Mat& channel : canvas.light) {
    channel = cv::Mat(canvas.rows, canvas.columns, CV_32F, cv::Scalar(0));
  }
  return canvas;
}

void LimitBand(double coarsest_pixel_mm, TextureCanvas* canvas) {
  // The lines between the samples have the transfer sinc^2(spacing f) on each axis.
  const auto gain = [&](double fx_per_mm, double fy_per_mm) {
    const double f2 =
        (fx_per_mm * fx_per_mm + fy_per_mm * fy_per_mm) * coarsest_pixel_mm * coarsest_pixel_mm;
    if (f2 >= kHighestFrequency * kHighestFrequency) return 0.0;
    return std::exp(-2 * kPi * kPi * kSoftnessPx * kSoftnessPx * f2) /
           (SincSquared(fx_per_mm * canvas->spacing_mm.x()) *
            SincSquared(fy_per_mm * canvas->spacing_mm.y()));
  };
  for (cv::Mat& channel : canvas->light) FilterChannel(*canvas, gain, &channel);
}

}  // namespace thicklens::model

#include "model/optics/airy.h"

#include <cmath>

#include "thicklens/base/pi.h"

namespace thicklens::model {
namespace {

constexpr double kFirstDark = 3.8317059702075125;  // first zero of J1
constexpr double kFarthest = 50;                   // Airy radii

double ShareWithin(double airy_radii) {
  const double v = kFirstDark * airy_radii;
  const double j0 = std::cyl_bessel_j(0.0, v);
  const double j1 = std::cyl_bessel_j(1.0, v);
  return 1 - j0 * j0 - j1 * j1;
}

}  // namespace

double AiryRadiusPx(const Camera& camera, double wavelength_mm) {
  const double sigma_mm = camera.blur_ratio() * camera.lens.aperture_radius_mm;
  if (!(sigma_mm > 0)) return 0;
  const double rear_distance_mm = camera.image_distance_mm() - camera.lens.lens_thickness_mm;
  const double radius_mm =
      camera.psf == Psf::kDisc
          ? kFirstDark / (2 * kPi) * wavelength_mm * rear_distance_mm / (2 * sigma_mm)
          : kGaussianAiryRadius * wavelength_mm * rear_distance_mm / (4 * kPi * sigma_mm);
  return radius_mm / camera.sensor.pixel_pitch_mm;
}

std::vector<double> AiryQuantiles(int count) {
  std::vector<double> quantiles;
  for (int i = 0; i < count; ++i) {
    double low = 0;
    double high = kFarthest;
    for (int step = 0; step < 50; ++step) {
      const double middle = (low + high) / 2;
      (ShareWithin(middle) < (i + 0.5) / count ? low : high) = middle;
    }
    quantiles.push_back((low + high) / 2);
  }
  return quantiles;
}

}  // namespace thicklens::model

#include "model/simulate/scene/ray_set.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

#include "support/blur_oracles.h"

namespace thicklens::model {
namespace {

using thicklens::testing::BoxTransfer;
using thicklens::testing::DiscTransfer;
using thicklens::testing::GaussianTransfer;

constexpr double kPi = 3.14159265358979323846;

TEST(RaySetTest, CarriesTheMomentsAndTransferOfPsfAndPixel) {
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    for (const double floor_px : {0.0, 0.7}) {
      const std::vector<PixelRay> rays = PhotographRays({psf, true, floor_px, 0}, 600);
      ASSERT_EQ(rays.size(), 600u);
      Eigen::Array2d mean(0, 0), square(0, 0), offset(0, 0), offset_square(0, 0);
      for (const PixelRay& ray : rays) {
        mean += ray.aperture.array() / 600;
        square += ray.aperture.array().square() / 600;
        offset += ray.offset_px.array() / 600;
        offset_square += ray.offset_px.array().square() / 600;
        EXPECT_LT(ray.aperture.norm(), psf == Psf::kDisc ? 2.02 : 6);
      }
      for (int axis = 0; axis < 2; ++axis) {
        EXPECT_NEAR(mean(axis), 0, 1e-12);
        EXPECT_NEAR(square(axis), 1, 1e-12);
        EXPECT_NEAR(offset(axis), 0, 1e-12);
        EXPECT_NEAR(offset_square(axis) / (1.0 / 12 + floor_px * floor_px), 1, 0.005);
      }
      for (const double f : {0.05, 0.13, 0.25, 0.4}) {
        std::complex<double> aperture = 0, pixel = 0;
        const Eigen::Vector2d direction(std::cos(0.7), std::sin(0.7));
        for (const PixelRay& ray : rays) {
          aperture += std::polar(1 / 600.0, 2 * kPi * f * direction.dot(ray.aperture));
          pixel += std::polar(1 / 600.0, 2 * kPi * f * ray.offset_px.x());
        }
        const double expected = psf == Psf::kGaussian ? GaussianTransfer(1, f) : DiscTransfer(2, f);
        EXPECT_LT(std::abs(aperture - expected), 0.006);
        EXPECT_LT(std::abs(pixel - BoxTransfer(f) * GaussianTransfer(floor_px, f)), 0.002);
      }
    }
  }
}

TEST(RaySetTest, ViewRaysFillThePixelAlone) {
  const std::vector<PixelRay> rays = ViewRays(true, 0);
  // Each of 8 x 8 cells of the pixel gets its share, 89/64 rays, to less than two.
  std::vector<int> cells(64, 0);
  for (const PixelRay& ray : rays) {
    EXPECT_EQ(ray.aperture, Eigen::Vector2d(0, 0));
    const Eigen::Vector2d in_pixel = 8 * (ray.offset_px.array() + 0.5);
    ++cells[static_cast<std::size_t>(in_pixel.y()) * 8 + static_cast<std::size_t>(in_pixel.x())];
  }
  EXPECT_GE(*std::min_element(cells.begin(), cells.end()), 0);
  EXPECT_LE(*std::max_element(cells.begin(), cells.end()), 3);
  for (const double f : {0.1, 0.3, 0.5}) {
    std::complex<double> sum = 0, floor = 0;
    for (const PixelRay& ray : rays) sum += std::polar(1 / 89.0, 2 * kPi * f * ray.offset_px.y());
    for (const PixelRay& ray : ViewRays(true, 0.6))
      floor += std::polar(1 / 89.0, 2 * kPi * f * ray.offset_px.y());
    EXPECT_LT(std::abs(sum - BoxTransfer(f)), 1e-3);
    EXPECT_LT(std::abs(floor - BoxTransfer(f) * GaussianTransfer(0.6, f)), 3e-3);
  }
}

}  // namespace
}  // namespace thicklens::model

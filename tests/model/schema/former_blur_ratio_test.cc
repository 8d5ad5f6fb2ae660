// The blur ratio of earlier camera files is compared with sums over the rays of an aperture.
#include "model/schema/former_blur_ratio.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <string>

#include "thicklens/model/camera_file.h"

namespace thicklens::model {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const ThickLens kWide = {12.5, 12.8, 3, 12.5 / 2.8};

// The second moment of the light on the axis by [S12], written out once more, over that of the
// aperture.
double VarianceRatio(Psf psf, double sigma_mm, double zf_mm, double d1_mm) {
  constexpr int kSide = 801;
  const double reach = psf == Psf::kDisc ? 2 : 7;
  double sum = 0, second = 0;
  for (int i = 0; i < kSide; ++i) {
    for (int j = 0; j < kSide; ++j) {
      const Eigen::Vector2d unit =
          reach * Eigen::Vector2d((2 * i + 1.0) / kSide - 1, (2 * j + 1.0) / kSide - 1);
      if (psf == Psf::kDisc && unit.norm() > 2) continue;
      const double away_mm = sigma_mm * unit.norm();
      const double weight = (psf == Psf::kDisc ? 1 : std::exp(-unit.squaredNorm() / 2)) *
                            std::cos(std::atan(away_mm / zf_mm)) *
                            std::pow(std::cos(std::atan(away_mm / d1_mm)), 3);
      sum += weight;
      second += weight * unit.x() * unit.x();
    }
  }
  return second / sum;
}

TEST(FormerBlurRatio, IsThatOfTheRaysOfItsAperture) {
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    for (const double zf_mm : {40.0, 400.0}) {
      const double expected =
          VarianceRatio(psf, 0.5 * kWide.aperture_radius_mm, zf_mm, ImageDistanceMm(kWide, zf_mm));
      EXPECT_NEAR(BlurRatioWithFalloff(kWide, psf, 0.5, zf_mm).squared / 0.25, expected,
                  psf == Psf::kDisc ? 5e-4 : 2e-5);
    }
  }
}

TEST(FormerBlurRatio, SlopesAreThoseOfItsValues) {
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    for (const double zf_mm : {30.0, 400.0}) {
      const auto squared = [&](double kappa, double zf) {
        return BlurRatioWithFalloff(kWide, psf, kappa, zf).squared;
      };
      const BlurRatioOfBlur ratio = BlurRatioWithFalloff(kWide, psf, 0.45, zf_mm);
      EXPECT_LT(ratio.squared, 0.45 * 0.45);
      EXPECT_NEAR(ratio.by_blur_ratio, (squared(0.4501, zf_mm) - squared(0.4499, zf_mm)) / 0.0002,
                  1e-6);
      EXPECT_NEAR(ratio.by_focus_depth,
                  (squared(0.45, zf_mm + 0.01) - squared(0.45, zf_mm - 0.01)) / 0.02, 1e-9);
    }
  }
}

// A file of the earlier schema, as that version wrote it.
std::string FormerFile(const std::string& method) {
  return R"(schema: thicklens/camera/1
name: wide
lens: {front_focal_length_mm: 12.5, rear_focal_length_mm: 12.8, lens_thickness_mm: 3, aperture_radius_mm: 4.46}
sensor: {width_px: 64, height_px: 64, pixel_pitch_mm: 0.006, principal_point_px: [31.5, 31.5], transfer: linear}
psf: gaussian
calibration:
  image_distance_mm: {value: 16.2129, sigma: 0.001}
  blur_ratio: {value: 0.5, sigma: 0.002}
  covariance: {order: [image_distance_mm, blur_ratio], rows: [[1e-06, 1e-06], [1e-06, 4e-06]]}
  evidence: {method: )" +
         method + "}\n";
}

TEST(FormerBlurRatio, IsConvertedWithItsErrorsAndANotice) {
  const Camera camera = ParseCamera(FormerFile("joint-blur-fit"), "old.yaml");
  const auto converted = [&](double kappa, double d1_mm) {
    return std::sqrt(
        BlurRatioWithFalloff(camera.lens, camera.psf, kappa, FocusDepthMm(camera.lens, d1_mm))
            .squared);
  };
  EXPECT_NEAR(camera.blur_ratio(), converted(0.5, 16.2129), 1e-12);
  EXPECT_LT(camera.blur_ratio(), 0.495);
  EXPECT_THAT(camera.notices, ElementsAre(HasSubstr("blur_ratio 0.5 described the aperture")));
  // The covariance by finite differences.
  const Eigen::Vector2d slope((converted(0.5, 16.2139) - converted(0.5, 16.2119)) / 0.002,
                              (converted(0.501, 16.2129) - converted(0.499, 16.2129)) / 0.002);
  Eigen::Matrix2d former;
  former << 1e-6, 1e-6, 1e-6, 4e-6;
  const Eigen::MatrixXd& covariance = camera.calibration->covariance;
  EXPECT_NEAR(covariance(1, 1) / slope.dot(former * slope), 1, 1e-4);
  EXPECT_NEAR(covariance(0, 1) / (former.row(0) * slope).value(), 1, 1e-4);
  EXPECT_NEAR(camera.calibration->blur_ratio->sigma, std::sqrt(covariance(1, 1)), 1e-12);
  EXPECT_EQ(covariance(0, 0), 1e-6);
  // A file of the present version is read without conversion.
  const Camera again = ParseCamera(CameraToYaml(camera), "new.yaml");
  EXPECT_EQ(again.blur_ratio(), camera.blur_ratio());
  EXPECT_TRUE(again.notices.empty());
}

// These values were ratios of the blur in the earlier schema.
TEST(FormerBlurRatio, OfTheRecipeAndAssumedOnesStay) {
  for (const std::string method : {"assumed", "source-recipe"}) {
    const Camera camera = ParseCamera(FormerFile(method), "old.yaml");
    EXPECT_EQ(camera.blur_ratio(), 0.5) << method;
    EXPECT_EQ(camera.calibration->blur_ratio->sigma, 0.002) << method;
    EXPECT_TRUE(camera.notices.empty()) << method;
  }
}

}  // namespace
}  // namespace thicklens::model

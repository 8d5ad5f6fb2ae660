#include "thicklens/model/lens_aberrations.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;

constexpr double kFocusMm = 300, kCornerPx = 200;

// Depth at which the blur along a direction is smallest.
double FocusAlong(const LensAberrations& aberrations, const Eigen::Vector2d& from_axis_px,
                  const Eigen::Vector2d& direction) {
  const Eigen::Matrix2d displacement =
      FocusDisplacement(aberrations, kFocusMm, from_axis_px, kCornerPx);
  return 1 / (1 / kFocusMm + direction.dot(displacement * direction));
}

TEST(LensAberrations, FociAreApartAsStated) {
  LensAberrations aberrations;
  aberrations.astigmatism_mm = -12;
  const Eigen::Vector2d x(1, 0), y(0, 1);
  for (const Eigen::Vector2d& place : {Eigen::Vector2d(0, 0), Eigen::Vector2d(90, -50)}) {
    const double along_x = FocusAlong(aberrations, place, x);
    const double along_y = FocusAlong(aberrations, place, y);
    EXPECT_NEAR(along_x - along_y, -12, 1e-9);
    EXPECT_NEAR(1 / along_x + 1 / along_y, 2 / kFocusMm, 1e-15);
  }

  aberrations = {};
  aberrations.field_astigmatism_mm = 8;
  aberrations.field_curvature_mm = -5;
  const Eigen::Vector2d corner = kCornerPx * Eigen::Vector2d(0.6, 0.8);
  const Eigen::Vector2d radius(0.6, 0.8), tangent(-0.8, 0.6);
  EXPECT_NEAR(FocusAlong(aberrations, corner, tangent) - FocusAlong(aberrations, corner, radius), 8,
              1e-9);
  EXPECT_NEAR(
      1 / FocusAlong(aberrations, corner, tangent) + 1 / FocusAlong(aberrations, corner, radius),
      2 / (kFocusMm - 5), 1e-15);
  // Both grow with the square of the distance.
  EXPECT_NEAR(
      FocusAlong(aberrations, corner / 2, tangent) - FocusAlong(aberrations, corner / 2, radius), 2,
      1e-9);
  EXPECT_DOUBLE_EQ(FocusAlong(aberrations, {0, 0}, x), kFocusMm);
}

TEST(LensAberrations, DistortionIsUndone) {
  for (const double distortion : {-0.14, -0.03, 0.0, 0.05, 0.3}) {
    for (const double r : {0.0, 0.2, 0.7, 1.0}) {
      const Eigen::Vector2d ideal = r * kCornerPx * Eigen::Vector2d(-0.6, 0.8);
      const Eigen::Vector2d seen = ideal * (1 + distortion * r * r);
      EXPECT_LT((WithoutDistortion(distortion, seen, kCornerPx) - ideal).norm(), 1e-9)
          << distortion << ", " << r;
    }
  }
}

TEST(LensAberrations, ImpossibleOnesAreNamed) {
  const ThickLens lens{50, 50, 0, 9};
  const auto why = [&](const LensAberrations& aberrations, double focus_mm) {
    std::string text;
    EXPECT_FALSE(aberrations.IsValid(lens, focus_mm, &text));
    return text;
  };
  LensAberrations aberrations;
  aberrations.distortion = -0.2;
  EXPECT_THAT(why(aberrations, kFocusMm), HasSubstr("aberrations.distortion is -0.2: it must be"));
  aberrations = {};
  aberrations.field_curvature_mm = -260;
  EXPECT_THAT(why(aberrations, kFocusMm), HasSubstr("in focus at 40 mm"));
  aberrations.field_curvature_mm = std::nan("");
  EXPECT_THAT(why(aberrations, kFocusMm), HasSubstr("field_curvature_mm is nan"));
  aberrations.field_curvature_mm = 3;
  EXPECT_THAT(why(aberrations, std::numeric_limits<double>::infinity()), HasSubstr("at infinity"));
  EXPECT_TRUE(aberrations.IsValid(lens, kFocusMm, nullptr));
}

TEST(LensAberrations, AxialColourDisplacesTheFocusOfAColour) {
  LensAberrations aberrations;
  EXPECT_EQ(ColourDisplacement(aberrations, kFocusMm, 0), 0);
  aberrations.axial_colour_mm.emplace(4, 0, -2);
  EXPECT_FALSE(aberrations.DisplaceFocus());
  EXPECT_NEAR(1 / (1 / kFocusMm + ColourDisplacement(aberrations, kFocusMm, 0)), kFocusMm + 4,
              1e-9);
  EXPECT_EQ(ColourDisplacement(aberrations, kFocusMm, 1), 0);
  EXPECT_NEAR(1 / (1 / kFocusMm + ColourDisplacement(aberrations, kFocusMm, 2)), kFocusMm - 2,
              1e-9);
  const ThickLens lens{50, 50, 0, 8};
  EXPECT_TRUE(aberrations.IsValid(lens, kFocusMm, nullptr));
  std::string why;
  aberrations.axial_colour_mm.emplace(0, 0, -kFocusMm + 40);
  EXPECT_FALSE(aberrations.IsValid(lens, kFocusMm, &why));
  EXPECT_THAT(why, HasSubstr("in focus at 40 mm"));
  aberrations.axial_colour_mm.emplace(0, std::nan(""), 0);
  EXPECT_FALSE(aberrations.IsValid(lens, kFocusMm, &why));
  EXPECT_THAT(why, HasSubstr("axial_colour_mm"));
}

}  // namespace
}  // namespace thicklens::model

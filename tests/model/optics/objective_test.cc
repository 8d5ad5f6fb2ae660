#include "thicklens/model/objective.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "support/error_message.h"

namespace thicklens::model {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using ::thicklens::testing::ErrorOf;

const Objective kObjectives[] = {
    {10, 0.25, 200}, {4, 0.1, 180}, {100, 0.9, 164.5}, {0.5, 0.02, 100}};

// Objective and tube lens as two thin lenses at any distance, with the sensor in the focal plane of
// the tube lens. The rays of a point in the front focal plane of the objective are parallel between
// them. Returns where a ray lands that starts at `height_mm` with `slope`, `beyond_mm` farther from
// the objective than its focal plane.
double LandingOfMicroscope(const Objective& objective, double height_mm, double beyond_mm,
                           double slope) {
  const auto gap = [](double mm) { return (Eigen::Matrix2d() << 1, mm, 0, 1).finished(); };
  const auto thin = [](double f_mm) {
    return (Eigen::Matrix2d() << 1, 0, -1 / f_mm, 1).finished();
  };
  constexpr double kBetweenMm = 87;
  const double tube_mm = objective.tube_lens_focal_length_mm;
  const double objective_mm = tube_mm / objective.magnification;
  const Eigen::Vector2d landing = gap(tube_mm) * thin(tube_mm) * gap(kBetweenMm) *
                                  thin(objective_mm) * gap(objective_mm + beyond_mm) *
                                  Eigen::Vector2d(height_mm, slope);
  return landing(0);
}

double FocusOfObjective(const ThickLens& lens, const Objective& objective) {
  return lens.front_focal_length_mm * (1 + 1 / objective.magnification);
}

TEST(LensOfObjective, HasMagnificationAndConeOfTheObjectiveInItsPlaneOfFocus) {
  for (const Objective& objective : kObjectives) {
    SCOPED_TRACE(objective.magnification);
    const ThickLens lens = LensOfObjective(objective);
    std::string why;
    EXPECT_TRUE(lens.IsValid(&why)) << why;
    EXPECT_EQ(lens.front_focal_length_mm, lens.rear_focal_length_mm);
    EXPECT_EQ(lens.lens_thickness_mm, 0);
    const double zf_mm = FocusOfObjective(lens, objective);
    const double d1_mm = ImageDistanceMm(lens, zf_mm);
    EXPECT_NEAR(ChiefRayMagnification(lens, d1_mm, zf_mm),
                LandingOfMicroscope(objective, 1, 0, 0.01), 1e-9 * objective.magnification);
    EXPECT_NEAR(std::sin(std::atan(lens.aperture_radius_mm / zf_mm)), objective.numerical_aperture,
                1e-12);
  }
}

TEST(LensOfObjective, BlursNearFocusAsObjectiveAndTubeLensDo) {
  for (const Objective& objective : kObjectives) {
    SCOPED_TRACE(objective.magnification);
    const ThickLens lens = LensOfObjective(objective);
    const double zf_mm = FocusOfObjective(lens, objective);
    const double d1_mm = ImageDistanceMm(lens, zf_mm);
    const double rim_slope = std::tan(std::asin(objective.numerical_aperture));
    for (const double beyond_mm : {-1e-5 * zf_mm, 1e-5 * zf_mm, 1e-4 * zf_mm}) {
      const double traced_mm = std::abs(LandingOfMicroscope(objective, 0, beyond_mm, rim_slope));
      EXPECT_NEAR(traced_mm, objective.magnification * rim_slope * std::abs(beyond_mm),
                  1e-9 * traced_mm);
      // The equivalent lens has perspective: its blur deviates by the share beyond/zf.
      const double share = 1.01 * std::abs(beyond_mm) / zf_mm;
      EXPECT_NEAR(BlurRadiusMm(lens, d1_mm, zf_mm + beyond_mm), traced_mm, share * traced_mm);
    }
  }
}

TEST(LensOfObjective, IsTheLensOfAKnownExample) {
  const ThickLens lens = LensOfObjective({10, 0.6, 200});
  EXPECT_DOUBLE_EQ(lens.front_focal_length_mm, 20);
  EXPECT_NEAR(lens.aperture_radius_mm, 22 * 0.75, 1e-12);
}

TEST(Objective, IsValidNamesFieldAndValue) {
  const double nan = std::nan(""), infinity = std::numeric_limits<double>::infinity();
  const struct {
    double Objective::*field;
    const char* name;
    std::vector<double> bad;
  } cases[] = {
      {&Objective::magnification, "magnification", {0, -10, nan, infinity}},
      {&Objective::numerical_aperture, "numerical_aperture", {0, -0.1, 1, 1.25, nan, infinity}},
      {&Objective::tube_lens_focal_length_mm,
       "tube_lens_focal_length_mm",
       {0, -200, nan, infinity}},
  };
  for (const Objective& objective : kObjectives) EXPECT_TRUE(objective.IsValid(nullptr));
  for (const auto& wrong : cases) {
    for (const double value : wrong.bad) {
      Objective objective = kObjectives[0];
      objective.*wrong.field = value;
      std::string why;
      EXPECT_FALSE(objective.IsValid(&why));
      EXPECT_THAT(why, StartsWith(wrong.name));
      EXPECT_FALSE(objective.IsValid(nullptr));
      EXPECT_EQ(ErrorOf([&] { LensOfObjective(objective); }), "objective: " + why);
    }
  }
  EXPECT_THAT(
      ErrorOf([&] {
        LensOfObjective({60, 1.25, 200});
      }),
      AllOf(HasSubstr("numerical_aperture is 1.25"), HasSubstr("immersion is not supported")));
}

}  // namespace
}  // namespace thicklens::model

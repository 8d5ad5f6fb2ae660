#include "thicklens/model/thick_lens.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "support/matrix_lens.h"
#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

using ::thicklens::testing::MatrixLens;
using ::thicklens::testing::MatrixLenses;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kApertureRadiusMm = 3.2;

// Depths in front of the lens, near to far, in its front focal lengths.
const double kDepthsInFocalLengths[] = {1.3, 2, 4.7, 20, 90, 1000};

double Tolerance(double value) { return 1e-10 * std::max(1.0, std::abs(value)); }

ThickLens BenchLens() { return {12.5, 12.8, 3.0, 4.46}; }

std::string MessageOf(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

class AgainstMatrixTrace : public ::testing::TestWithParam<MatrixLens> {
 protected:
  const MatrixLens& oracle() const { return GetParam(); }
  ThickLens lens() const { return GetParam().AsThickLens(kApertureRadiusMm); }
};

INSTANTIATE_TEST_SUITE_P(Lenses, AgainstMatrixTrace, ::testing::ValuesIn(MatrixLenses()),
                         [](const ::testing::TestParamInfo<MatrixLens>& lens) {
                           std::string name = lens.param.name();
                           for (char& c : name) {
                             if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
                           }
                           return name;
                         });

// Checks that the lenses are of the kinds that their names state. Otherwise the tests below would
// cover less.
TEST_P(AgainstMatrixTrace, LensIsOfItsSort) {
  std::string why;
  EXPECT_TRUE(lens().IsValid(&why)) << why;
  const bool crossed = oracle().name().find("crossed") == 0;
  EXPECT_EQ(lens().lens_thickness_mm < -0.1, crossed);
  EXPECT_GT(std::abs(lens().lens_thickness_mm), 0.1);
  const double media = oracle().index_after() / oracle().index_before();
  EXPECT_NEAR(lens().rear_focal_length_mm / lens().front_focal_length_mm, media, 1e-12);
  const bool in_air = oracle().index_before() == 1 && oracle().index_after() == 1;
  EXPECT_EQ(std::abs(media - 1) < 0.05, in_air);
}

TEST_P(AgainstMatrixTrace, Conjugates) {
  for (const double depth_in_f : kDepthsInFocalLengths) {
    const double depth_mm = depth_in_f * lens().front_focal_length_mm;
    const double image_distance_mm = oracle().ConjugateMm(depth_mm);
    EXPECT_NEAR(ImageDistanceMm(lens(), depth_mm), image_distance_mm, Tolerance(image_distance_mm));
    EXPECT_NEAR(FocusDepthMm(lens(), image_distance_mm), depth_mm, Tolerance(depth_mm));
  }
}

TEST_P(AgainstMatrixTrace, FocusAtInfinity) {
  const double image_distance_mm = ImageDistanceMm(lens(), kInfinity);
  EXPECT_NEAR(image_distance_mm, oracle().rear_focal_point_mm() - oracle().front_principal_mm(),
              1e-10);
  EXPECT_EQ(FocusDepthMm(lens(), image_distance_mm), kInfinity);
}

TEST_P(AgainstMatrixTrace, MagnificationOfTheConjugate) {
  for (const double depth_in_f : kDepthsInFocalLengths) {
    const double depth_mm = depth_in_f * lens().front_focal_length_mm;
    const double image_distance_mm = oracle().ConjugateMm(depth_mm);
    // Any ray can be used; a ray through the rim differs from the chief ray.
    const double traced = oracle().Landing(1, depth_mm, kApertureRadiusMm, image_distance_mm);
    EXPECT_NEAR(ChiefRayMagnification(lens(), image_distance_mm, depth_mm), traced, 1e-10);
    EXPECT_LT(traced, 0) << "the image is inverted";
  }
}

TEST_P(AgainstMatrixTrace, BlurAndChiefRayOutOfFocus) {
  for (const double focus_in_f : {2.0, 20.0, 1000.0, kInfinity}) {
    const double image_distance_mm =
        ImageDistanceMm(lens(), focus_in_f * lens().front_focal_length_mm);
    for (const double depth_in_f : kDepthsInFocalLengths) {
      const double depth_mm = depth_in_f * lens().front_focal_length_mm;
      const double chief_mm = oracle().Landing(1, depth_mm, 0, image_distance_mm);
      EXPECT_NEAR(ChiefRayMagnification(lens(), image_distance_mm, depth_mm), chief_mm, 1e-10);
      // The disc around an axial point's image has the rim's ray on its edge.
      const double rim_mm = oracle().Landing(0, depth_mm, kApertureRadiusMm, image_distance_mm);
      EXPECT_NEAR(BlurRadiusMm(lens(), image_distance_mm, depth_mm), std::abs(rim_mm), 1e-10);
      // Sign: a ray through the right half of Ap, from a point nearer than zf, has not yet crossed
      // the axis.
      EXPECT_NEAR(DefocusPerAperture(lens(), image_distance_mm, depth_mm),
                  rim_mm / kApertureRadiusMm, 1e-10);
      EXPECT_EQ(rim_mm > 1e-12, depth_in_f < focus_in_f);
    }
  }
}

TEST_P(AgainstMatrixTrace, RayThroughFrontNodalPointLeavesParallelFromTheRearOne) {
  for (const double slope : {-0.3, 0.01, 0.2}) {
    const double aperture_mm = slope * FrontNodalDepthMm(lens());
    const Eigen::Vector2d behind = oracle().TraceSlope(aperture_mm, slope);
    EXPECT_NEAR(behind(1), slope, 1e-12);
    EXPECT_NEAR(behind(0) + behind(1) * RearNodalDistanceMm(lens()), 0, 1e-10);
  }
}

TEST_P(AgainstMatrixTrace, DepthOfFieldEndsWhereTheTracedBlurIsTheLimit) {
  const double limit_mm = 0.01;
  for (const double focus_in_f : {3.0, 15.0, 60.0}) {
    const double focus_mm = focus_in_f * lens().front_focal_length_mm;
    const double image_distance_mm = ImageDistanceMm(lens(), focus_mm);
    const DepthOfField field = DepthOfFieldMm(lens(), image_distance_mm, limit_mm);
    EXPECT_LT(field.near_mm, focus_mm);
    EXPECT_GT(field.far_mm, focus_mm);
    ASSERT_TRUE(std::isfinite(field.far_mm));
    for (const double end_mm : {field.near_mm, field.far_mm}) {
      const double rim_mm = oracle().Landing(0, end_mm, kApertureRadiusMm, image_distance_mm);
      EXPECT_NEAR(std::abs(rim_mm), limit_mm, 1e-10);
    }
  }
}

TEST(ThickLens, BecomesThinWithoutThicknessAndWithEqualFocalLengths) {
  const ThickLens thin{25, 25, 0, 5};
  for (const double focus_mm : {40.0, 300.0, 1e5}) {
    // Gauss: 1/f = 1/zf + 1/d1, and the textbook blur of a thin lens, r |d1/v - 1|, with v the
    // image distance of the point.
    const double image_distance_mm = 1 / (1 / 25.0 - 1 / focus_mm);
    EXPECT_NEAR(ImageDistanceMm(thin, focus_mm), image_distance_mm, 1e-10);
    for (const double depth_mm : {31.0, 310.0, 5e4}) {
      const double point_image_mm = 1 / (1 / 25.0 - 1 / depth_mm);
      EXPECT_NEAR(BlurRadiusMm(thin, image_distance_mm, depth_mm),
                  5 * std::abs(image_distance_mm / point_image_mm - 1), 1e-10);
      EXPECT_NEAR(ChiefRayMagnification(thin, image_distance_mm, depth_mm),
                  -image_distance_mm / depth_mm, 1e-12);
    }
  }
  EXPECT_EQ(FrontNodalDepthMm(thin), 0);
  EXPECT_EQ(RearNodalDistanceMm(thin), 0);
}

TEST(ThickLens, ThinLensEquivalentKeepsFrontFocalLengthAndAperture) {
  const ThickLens thin = ThinLensEquivalent(BenchLens());
  EXPECT_EQ(thin.front_focal_length_mm, 12.5);
  EXPECT_EQ(thin.rear_focal_length_mm, 12.5);
  EXPECT_EQ(thin.lens_thickness_mm, 0);
  EXPECT_EQ(thin.aperture_radius_mm, 4.46);
}

TEST(ThickLens, ScalingEveryLengthChangesNothingButTheUnit) {
  const ThickLens lens = BenchLens();
  const double focus_mm = 640;
  const double depth_mm = 210;
  const double image_distance_mm = ImageDistanceMm(lens, focus_mm);
  for (const double scale : {1e-3, 1e3}) {
    const ThickLens scaled{12.5 * scale, 12.8 * scale, 3.0 * scale, 4.46 * scale};
    const double d1 = image_distance_mm * scale;
    const auto same = [scale](double value, double wanted, double power) {
      wanted *= std::pow(scale, power);
      EXPECT_NEAR(value, wanted, 1e-12 * std::abs(wanted));
    };
    same(ImageDistanceMm(scaled, focus_mm * scale), image_distance_mm, 1);
    // (D - f2) is a hundredth of d1: two digits of d1's rounding are lost with it.
    EXPECT_NEAR(FocusDepthMm(scaled, d1) / scale, focus_mm, 1e-11 * focus_mm);
    same(ImageDistanceSlope(scaled, focus_mm * scale), ImageDistanceSlope(lens, focus_mm), 0);
    same(DefocusScaleMm(scaled, d1), DefocusScaleMm(lens, image_distance_mm), 1);
    same(DefocusPerAperture(scaled, d1, depth_mm * scale),
         DefocusPerAperture(lens, image_distance_mm, depth_mm), 0);
    same(BlurRadiusMm(scaled, d1, depth_mm * scale),
         BlurRadiusMm(lens, image_distance_mm, depth_mm), 1);
    same(ChiefRayMagnification(scaled, d1, depth_mm * scale),
         ChiefRayMagnification(lens, image_distance_mm, depth_mm), 0);
    const DepthOfField field = DepthOfFieldMm(lens, image_distance_mm, 0.01);
    const DepthOfField scaled_field = DepthOfFieldMm(scaled, d1, 0.01 * scale);
    EXPECT_NEAR(scaled_field.near_mm / scale, field.near_mm, 1e-11 * field.near_mm);
    EXPECT_NEAR(scaled_field.far_mm / scale, field.far_mm, 1e-11 * field.far_mm);
  }
}

TEST(ThickLens, SlopeIsTheDerivativeOfTheImageDistance) {
  const ThickLens lens = BenchLens();
  for (const double focus_mm : {20.0, 640.0}) {
    const double step_mm = focus_mm * 1e-5;
    const double difference =
        (ImageDistanceMm(lens, focus_mm + step_mm) - ImageDistanceMm(lens, focus_mm - step_mm)) /
        (2 * step_mm);
    const double slope = ImageDistanceSlope(lens, focus_mm);
    EXPECT_NEAR(slope, difference, 1e-6 * std::abs(slope));
  }
  EXPECT_EQ(ImageDistanceSlope(lens, kInfinity), 0);
}

TEST(ThickLens, DefocusScaleIsTheFocusDepthForm) {
  const ThickLens lens = BenchLens();
  for (const double focus_mm : {20.0, 640.0, 1e6}) {
    const double expected_mm = 12.5 * focus_mm / (focus_mm - 12.5);
    EXPECT_NEAR(DefocusScaleMm(lens, ImageDistanceMm(lens, focus_mm)), expected_mm, 1e-11);
  }
  EXPECT_NEAR(DefocusScaleMm(lens, ImageDistanceMm(lens, kInfinity)), 12.5, 1e-12);
}

TEST(ThickLens, BlurIsZeroInThePlaneOfFocusAndFiniteAtInfinity) {
  const ThickLens lens = BenchLens();
  const double focus_mm = 640;
  const double image_distance_mm = ImageDistanceMm(lens, focus_mm);
  EXPECT_NEAR(BlurRadiusMm(lens, image_distance_mm, focus_mm), 0, 1e-13);
  const double at_infinity = DefocusPerAperture(lens, image_distance_mm, kInfinity);
  EXPECT_NEAR(at_infinity, -12.5 / (focus_mm - 12.5), 1e-12);
  EXPECT_NEAR(DefocusPerAperture(lens, image_distance_mm, 1e15), at_infinity, 1e-12);
  // Focused at infinity, a point there is sharp.
  EXPECT_EQ(BlurRadiusMm(lens, ImageDistanceMm(lens, kInfinity), kInfinity), 0);
}

// d1 - rho takes back an addition and so does not give f2 to the last bit.
TEST(ThickLens, FocusAtInfinitySurvivesTheRoundingOfThickness) {
  for (int i = 0; i < 2000; ++i) {
    ThickLens lens = BenchLens();
    lens.rear_focal_length_mm = 4 + 0.0371 * i;
    lens.lens_thickness_mm = -2 + 0.0173 * i;
    const double image_distance_mm = ImageDistanceMm(lens, kInfinity);
    EXPECT_EQ(FocusDepthMm(lens, image_distance_mm), kInfinity) << lens.rear_focal_length_mm;
    EXPECT_EQ(DefocusPerAperture(lens, image_distance_mm, kInfinity), 0);
  }
}

TEST(ThickLens, FocusBarelyBeyondTheFocalPoint) {
  const ThickLens lens = BenchLens();
  const double focus_mm = 12.5 * (1 + 1e-12);
  const double image_distance_mm = ImageDistanceMm(lens, focus_mm);
  EXPECT_TRUE(std::isfinite(image_distance_mm));
  EXPECT_NEAR(FocusDepthMm(lens, image_distance_mm), focus_mm, 1e-12);
}

TEST(ThickLens, RefusesWhatHasNoRealImage) {
  const ThickLens lens = BenchLens();
  EXPECT_THROW(ImageDistanceMm(lens, 12.5), Error);
  EXPECT_THROW(ImageDistanceMm(lens, 3), Error);
  EXPECT_THROW(ImageDistanceMm(lens, -640), Error);
  EXPECT_THROW(ImageDistanceSlope(lens, 12.5), Error);
  EXPECT_THROW(FocusDepthMm(lens, 15.79), Error);
  EXPECT_THROW(FocusDepthMm(lens, 2), Error);
  const std::string message = MessageOf([&] { FocusDepthMm(lens, 15.5); });
  EXPECT_NE(message.find("image_distance_mm is 15.5"), std::string::npos) << message;
  EXPECT_NE(message.find("15.8"), std::string::npos) << message;
}

TEST(ThickLens, RefusesNan) {
  const ThickLens lens = BenchLens();
  EXPECT_THROW(ImageDistanceMm(lens, kNan), Error);
  EXPECT_THROW(ImageDistanceSlope(lens, kNan), Error);
  EXPECT_THROW(FocusDepthMm(lens, kNan), Error);
  EXPECT_THROW(FocusDepthMm(lens, kInfinity), Error);
  EXPECT_THROW(DefocusScaleMm(lens, kNan), Error);
  EXPECT_THROW(DefocusPerAperture(lens, 16, kNan), Error);
  EXPECT_THROW(DefocusPerAperture(lens, kNan, 640), Error);
  EXPECT_THROW(DefocusPerAperture(lens, 16, 0), Error);
  EXPECT_THROW(BlurRadiusMm(lens, 16, -1), Error);
  EXPECT_THROW(ChiefRayMagnification(lens, 16, kNan), Error);
  EXPECT_THROW(DepthOfFieldMm(lens, 16, kNan), Error);
  EXPECT_THROW(DepthOfFieldMm(lens, 16, -0.1), Error);
  EXPECT_THROW(DepthOfFieldMm(lens, kNan, 0.1), Error);
}

TEST(ThickLens, DepthOfFieldLimits) {
  const ThickLens lens = BenchLens();
  const double image_distance_mm = ImageDistanceMm(lens, 640);
  const DepthOfField none = DepthOfFieldMm(lens, image_distance_mm, 0);
  EXPECT_NEAR(none.near_mm, 640, 1e-9);
  EXPECT_EQ(none.near_mm, none.far_mm);
  // A limit above the blur of a point at infinity reaches to infinity.
  const double at_infinity_mm = BlurRadiusMm(lens, image_distance_mm, kInfinity);
  EXPECT_TRUE(std::isfinite(DepthOfFieldMm(lens, image_distance_mm, at_infinity_mm * 0.99).far_mm));
  EXPECT_EQ(DepthOfFieldMm(lens, image_distance_mm, at_infinity_mm * 1.01).far_mm, kInfinity);
  // Focused at infinity: near is the hyperfocal depth r K/r_max with K = f1.
  const DepthOfField far = DepthOfFieldMm(lens, ImageDistanceMm(lens, kInfinity), 0.01);
  EXPECT_NEAR(far.near_mm, 4.46 * 12.5 / 0.01, 1e-8);
  EXPECT_EQ(far.far_mm, kInfinity);
}

TEST(ThickLens, IsValidNamesFieldAndValue) {
  std::string why;
  EXPECT_TRUE(BenchLens().IsValid(&why)) << why;
  EXPECT_TRUE(BenchLens().IsValid(nullptr));
  const struct {
    double ThickLens::*field;
    const char* name;
    std::vector<double> bad;
  } cases[] = {
      {&ThickLens::front_focal_length_mm, "front_focal_length_mm", {0, -3, kNan, kInfinity}},
      {&ThickLens::rear_focal_length_mm, "rear_focal_length_mm", {0, -3, kNan, kInfinity}},
      {&ThickLens::lens_thickness_mm, "lens_thickness_mm", {kNan, kInfinity, -kInfinity}},
      {&ThickLens::aperture_radius_mm, "aperture_radius_mm", {0, -3, kNan, kInfinity}},
  };
  for (const auto& wrong : cases) {
    for (const double value : wrong.bad) {
      ThickLens lens = BenchLens();
      lens.*wrong.field = value;
      why.clear();
      EXPECT_FALSE(lens.IsValid(&why));
      EXPECT_EQ(why.find(wrong.name), 0U) << why;
      EXPECT_FALSE(lens.IsValid(nullptr));
    }
  }
  ThickLens crossed = BenchLens();
  crossed.lens_thickness_mm = -3;
  EXPECT_TRUE(crossed.IsValid(&why)) << why;
}

}  // namespace
}  // namespace thicklens::model

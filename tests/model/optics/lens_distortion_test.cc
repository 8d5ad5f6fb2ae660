#include "thicklens/model/lens_distortion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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

LensDistortion WithCoefficients(std::vector<double> coefficients,
                                DistortionModel model = DistortionModel::kOpenCv) {
  LensDistortion d;
  d.model = model;
  d.width_px = 1000;
  d.height_px = 700;
  d.focal_length_px = {900, 905};
  d.principal_point_px = {505.5, 340.25};
  d.coefficients = std::move(coefficients);
  return d;
}

// The published formula of OpenCV's documentation ("Camera Calibration and 3D Reconstruction"),
// written term by term; the tilt is its matrix product with the rotations about x and y.
Eigen::Vector2d ByFormula(const LensDistortion& d, const Eigen::Vector2d& px) {
  std::vector<double> c = d.coefficients;
  c.resize(14, 0);
  const double k1 = c[0], k2 = c[1], p1 = c[2], p2 = c[3], k3 = c[4], k4 = c[5], k5 = c[6],
               k6 = c[7], s1 = c[8], s2 = c[9], s3 = c[10], s4 = c[11], tx = c[12], ty = c[13];
  const double x = (px.x() - d.principal_point_px.x()) / d.focal_length_px.x();
  const double y = (px.y() - d.principal_point_px.y()) / d.focal_length_px.y();
  const double r = std::sqrt(x * x + y * y);
  Eigen::Vector3d out;
  if (d.model == DistortionModel::kFisheye) {
    const double a = std::atan(r);
    const double t = a + c[0] * std::pow(a, 3) + c[1] * std::pow(a, 5) + c[2] * std::pow(a, 7) +
                     c[3] * std::pow(a, 9);
    const double grow = r > 0 ? t / r : 1;
    out = {x * grow, y * grow, 1};
  } else {
    const double q = (1 + k1 * std::pow(r, 2) + k2 * std::pow(r, 4) + k3 * std::pow(r, 6)) /
                     (1 + k4 * std::pow(r, 2) + k5 * std::pow(r, 4) + k6 * std::pow(r, 6));
    const double xd =
        x * q + 2 * p1 * x * y + p2 * (r * r + 2 * x * x) + s1 * r * r + s2 * std::pow(r, 4);
    const double yd =
        y * q + p1 * (r * r + 2 * y * y) + 2 * p2 * x * y + s3 * r * r + s4 * std::pow(r, 4);
    Eigen::Matrix3d about_x, about_y, shear;
    about_x << 1, 0, 0, 0, std::cos(tx), std::sin(tx), 0, -std::sin(tx), std::cos(tx);
    about_y << std::cos(ty), 0, -std::sin(ty), 0, 1, 0, std::sin(ty), 0, std::cos(ty);
    const Eigen::Matrix3d turn = about_y * about_x;
    shear << turn(2, 2), 0, -turn(0, 2), 0, turn(2, 2), -turn(1, 2), 0, 0, 1;
    out = shear * turn * Eigen::Vector3d(xd, yd, 1);
  }
  return {d.focal_length_px.x() * out.x() / out.z() + d.principal_point_px.x(),
          d.focal_length_px.y() * out.y() / out.z() + d.principal_point_px.y()};
}

std::vector<LensDistortion> AllModels() {
  const std::vector<double> all = {-0.21, 0.07, 0.0011, -0.0007, 0.013, 0.05,  -0.02,
                                   0.004, 6e-4, -3e-4,  2e-4,    -1e-4, 0.012, -0.008};
  std::vector<LensDistortion> models;
  for (const std::ptrdiff_t count : {4, 5, 8, 12, 14})
    models.push_back(WithCoefficients({all.begin(), all.begin() + count}));
  models.push_back(WithCoefficients({-0.03, 0.011, -0.004, 0.0007}, DistortionModel::kFisheye));
  return models;
}

TEST(LensDistortion, PointsLieWhereThePublishedFormulaPutsThem) {
  for (const LensDistortion& d : AllModels()) {
    SCOPED_TRACE(d.Description());
    std::string why;
    ASSERT_TRUE(d.IsValid(&why)) << why;
    const SourcePositions all = SourcesOf(d, 0, 0, d.width_px, d.height_px);
    for (const auto& [x, y] :
         {std::pair(0, 0), {999, 0}, {0, 699}, {999, 699}, {505, 340}, {700, 90}}) {
      const Eigen::Vector2d px(x, y), expected = ByFormula(d, px);
      EXPECT_LT((d.Distorted(px) - expected).norm(), 1e-9) << px.transpose();
      const auto i = static_cast<std::size_t>(y * d.width_px + x);
      const bool is_inside = expected.x() >= -0.5 && expected.x() <= 999.5 &&
                             expected.y() >= -0.5 && expected.y() <= 699.5;
      ASSERT_EQ(!std::isnan(all.x[i]), is_inside) << expected.transpose();
      if (!is_inside) continue;
      EXPECT_NEAR(all.x[i], expected.x(), 2e-4) << px.transpose();
      EXPECT_NEAR(all.y[i], expected.y(), 2e-4) << px.transpose();
    }
    // A rectangle of the map is that part of the whole.
    const SourcePositions part = SourcesOf(d, 612, 77, 3, 2);
    for (int j = 0; j < 2; ++j) {
      for (int i = 0; i < 3; ++i) {
        EXPECT_NEAR(part.x[static_cast<std::size_t>(3 * j + i)],
                    all.x[static_cast<std::size_t>((77 + j) * d.width_px + 612 + i)], 2e-4);
      }
    }
  }
}

// In the middle of the image nothing moves, and the displacement of a single coefficient is k1 r^3.
TEST(LensDistortion, LimitCases) {
  const LensDistortion none = WithCoefficients({0, 0, 0, 0});
  EXPECT_LT(none.LargestShiftPx(), 1e-9);
  EXPECT_LT((none.Distorted({13, 42}) - Eigen::Vector2d(13, 42)).norm(), 1e-9);
  LensDistortion barrel = WithCoefficients({-0.1, 0, 0, 0});
  barrel.focal_length_px = {900, 900};
  EXPECT_EQ(barrel.Distorted(barrel.principal_point_px), barrel.principal_point_px);
  const double r = 0.3;
  const Eigen::Vector2d at = barrel.principal_point_px + Eigen::Vector2d(900 * r, 0);
  EXPECT_NEAR(barrel.Distorted(at).x() - at.x(), -0.1 * r * r * r * 900, 1e-9);
  const double corner = Eigen::Vector2d(505.5 / 900, 358.75 / 900).norm();
  EXPECT_NEAR(barrel.LargestShiftPx(), 0.1 * std::pow(corner, 3) * 900, 0.05);
}

// An image that was binned by 2 shows the same field: the edges of the pixels coincide, at -0.5.
TEST(LensDistortion, ScalesWithTheSizeOfTheImage) {
  for (const LensDistortion& d : AllModels()) {
    const LensDistortion half = d.ScaledTo(500, 350);
    for (const Eigen::Vector2d& px : {Eigen::Vector2d(31, 600), Eigen::Vector2d(900.25, 17)}) {
      const auto binned = [](const Eigen::Vector2d& at) {
        return Eigen::Vector2d((at.array() + 0.5) / 2 - 0.5);
      };
      EXPECT_LT((half.Distorted(binned(px)) - binned(d.Distorted(px))).norm(), 1e-9);
    }
  }
  const LensDistortion d = WithCoefficients({-0.1, 0, 0, 0});
  EXPECT_EQ(d.ScaledTo(333, 233).width_px, 333);  // sizes are rounded
  EXPECT_THAT(
      ErrorOf([&] { static_cast<void>(d.ScaledTo(640, 480)); }),
      AllOf(HasSubstr("1000 x 700 px"), HasSubstr("640 x 480 px"), HasSubstr("same aspect ratio")));
  EXPECT_THAT(ErrorOf([&] { static_cast<void>(d.ScaledTo(700, 1000)); }), HasSubstr("turned"));
}

TEST(LensDistortion, APartHasTheSameField) {
  const LensDistortion d = WithCoefficients({-0.2, 0.03, 0.001, 0.002, 0.01});
  const LensDistortion part = d.OfPart(40, 50, 300, 200);
  EXPECT_EQ(part.width_px, 300);
  const Eigen::Vector2d shift(40, 50), at(210, 120);
  EXPECT_LT((part.Distorted(at) + shift - d.Distorted(at + shift)).norm(), 1e-9);
}

// r (1 - 0.4 r^2) turns back at r = sqrt(1/1.2); beyond, the formula would show the inside again.
TEST(LensDistortion, HasNoSourceBeyondTheTurnOfItsPolynomial) {
  LensDistortion d = WithCoefficients({-0.4, 0, 0, 0});
  d.focal_length_px = {450, 450};
  std::string why;
  ASSERT_TRUE(d.IsValid(&why)) << why;
  const double turn_px = 450 * std::sqrt(1 / 1.2);
  const auto at = [&](double r) {
    return Eigen::Vector2d(d.principal_point_px.x() - r, d.principal_point_px.y());
  };
  EXPECT_FALSE(std::isnan(d.Distorted(at(turn_px - 2)).x()));
  EXPECT_TRUE(std::isnan(d.Distorted(at(turn_px + 2)).x()));
  const SourcePositions row = SourcesOf(d, 0, 340, 1000, 1);
  EXPECT_TRUE(std::isnan(row.x[static_cast<std::size_t>(505 - turn_px - 3)]));
  EXPECT_FALSE(std::isnan(row.x[static_cast<std::size_t>(505 - turn_px + 4)]));
}

TEST(LensDistortion, IsValidNamesWhatIsWrong) {
  const LensDistortion good = WithCoefficients({-0.2, 0.03, 0.001, 0.002, 0.01});
  const auto why = [&](auto change) {
    LensDistortion d = good;
    change(&d);
    std::string reason;
    return d.IsValid(&reason) ? std::string("valid") : reason;
  };
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  EXPECT_EQ(why([](LensDistortion*) {}), "valid");
  EXPECT_THAT(why([](LensDistortion* d) { d->width_px = 0; }), StartsWith("width_px"));
  EXPECT_THAT(why([](LensDistortion* d) { d->height_px = 100001; }), StartsWith("height_px"));
  EXPECT_THAT(why([](LensDistortion* d) { d->focal_length_px.y() = kNan; }),
              StartsWith("focal_length_px"));
  EXPECT_THAT(why([](LensDistortion* d) { d->focal_length_px.x() = -900; }),
              StartsWith("focal_length_px"));
  EXPECT_THAT(why([](LensDistortion* d) { d->focal_length_px.x() = 9000; }),
              HasSubstr("differ by more than 4 times"));
  EXPECT_THAT(why([](LensDistortion* d) { d->principal_point_px.x() = 2500; }),
              StartsWith("principal_point_px: cx"));
  EXPECT_THAT(why([](LensDistortion* d) { d->principal_point_px.y() = kInfinite; }),
              StartsWith("principal_point_px: cy"));
  EXPECT_THAT(why([](LensDistortion* d) { d->coefficients.pop_back(); }), "valid");
  EXPECT_THAT(why([](LensDistortion* d) { d->coefficients.resize(6); }),
              AllOf(HasSubstr("4, 5, 8, 12, 14"), HasSubstr("found 6")));
  EXPECT_THAT(why([](LensDistortion* d) { d->model = DistortionModel::kFisheye; }),
              HasSubstr("the fisheye model has 4"));
  EXPECT_THAT(why([](LensDistortion* d) { d->coefficients[2] = kNan; }),
              StartsWith("coefficients[2]"));
  EXPECT_THAT(why([](LensDistortion* d) { d->coefficients.resize(14, 3); }),
              HasSubstr("tilted sensor"));
  // The coefficients of another order: k2 where k1 is expected.
  EXPECT_THAT(why([](LensDistortion* d) {
                d->coefficients = {-25, 0, 0, 0};
              }),
              HasSubstr("turns back"));
}

}  // namespace
}  // namespace thicklens::model

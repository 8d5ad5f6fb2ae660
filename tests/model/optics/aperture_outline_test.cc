#include "thicklens/model/aperture_outline.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <complex>

#include "support/error_message.h"
#include "thicklens/base/pi.h"
#include "thicklens/model/blur_transfer.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;

// A hexagon in a circle of radius R: area 3 sqrt(3)/2 R^2, second moment per axis 5 R^2/24 in any
// direction.
TEST(ApertureOutline, AHexagonHasItsMomentsInClosedForm) {
  for (const double rotation_deg : {0.0, 17.0}) {
    ApertureOutline hexagon;
    hexagon.blades = 6;
    hexagon.rotation_deg = rotation_deg;
    const PolygonMoments moments = MomentsOf(hexagon.Corners());
    EXPECT_NEAR(moments.area, 1.5 * std::sqrt(3.0), 1e-12);
    EXPECT_NEAR(moments.centroid.norm(), 0, 1e-12);
    EXPECT_NEAR(moments.second(0, 0), 5.0 / 24, 1e-12);
    EXPECT_NEAR(moments.second(1, 1), 5.0 / 24, 1e-12);
    EXPECT_NEAR(moments.second(0, 1), 0, 1e-12);
    EXPECT_NEAR(moments.Sigma(), std::sqrt(5.0 / 24), 1e-12);
  }
}

// A corner is in the stated direction, and bent blades reach from the polygon to the circle.
TEST(ApertureOutline, IsTurnedAndBentAsStated) {
  ApertureOutline outline;
  outline.blades = 5;
  outline.rotation_deg = 90;
  EXPECT_NEAR(outline.Corners()[0].y(), 1, 1e-12);
  EXPECT_FALSE(outline.IsRound());
  double before = MomentsOf(outline.Corners()).area;
  EXPECT_NEAR(before, 2.5 * std::sin(2 * kPi / 5), 1e-12);
  for (const double roundness : {0.5, 1.0}) {
    outline.roundness = roundness;
    const double area = MomentsOf(outline.Corners()).area;
    EXPECT_GT(area, before + 0.1);
    before = area;
  }
  EXPECT_NEAR(before, kPi, 2e-3);
  EXPECT_TRUE(outline.IsRound());
  EXPECT_NEAR(MomentsOf(ApertureOutline().Corners()).Sigma(), 0.5, 1e-3);
}

// The transform is the mean of the wave over the polygon, by points, and near 0 continuous with its
// series.
TEST(ApertureOutline, TheTransferIsTheMeanOfTheWave) {
  ApertureOutline outline;
  outline.blades = 5;
  outline.rotation_deg = 10;
  const auto corners = outline.Corners();
  const PolygonMoments moments = MomentsOf(corners);
  const auto is_inside = [&](const Eigen::Vector2d& at) {
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const Eigen::Vector2d side = corners[(i + 1) % corners.size()] - corners[i];
      const Eigen::Vector2d to = at - corners[i];
      if (side.x() * to.y() - side.y() * to.x() < 0) return false;
    }
    return true;
  };
  for (const Eigen::Vector2d& f :
       {Eigen::Vector2d(0.3, 0.1), Eigen::Vector2d(-0.8, 0.6), Eigen::Vector2d(0, 1.1)}) {
    std::complex<double> sum = 0;
    double count = 0;
    constexpr int kSide = 600;
    for (int j = 0; j < kSide; ++j) {
      for (int i = 0; i < kSide; ++i) {
        const Eigen::Vector2d at(2 * (i + 0.5) / kSide - 1, 2 * (j + 0.5) / kSide - 1);
        if (!is_inside(at)) continue;
        sum += std::polar(1.0, -2 * kPi * f.dot(at));
        ++count;
      }
    }
    EXPECT_LT(std::abs(PolygonTransfer(corners, moments, f) - sum / count), 1e-3);
  }
  EXPECT_EQ(PolygonTransfer(corners, moments, {0, 0}), std::complex<double>(1, 0));
  const Eigen::Vector2d along(0.6, 0.8);
  const double edge = 1e-4 / (2 * kPi * moments.Sigma());
  EXPECT_LT(std::abs(PolygonTransfer(corners, moments, 0.999 * edge * along) -
                     PolygonTransfer(corners, moments, 1.001 * edge * along)),
            1e-10);
}

// A round outline has the transfer of a disc.
TEST(ApertureOutline, ACircleHasTheTransferOfADisc) {
  const auto corners = ApertureOutline().Corners();
  const PolygonMoments moments = MomentsOf(corners);
  for (const double f : {0.1, 0.4, 1.0}) {
    const std::complex<double> found = PolygonTransfer(corners, moments, {0.6 * f, 0.8 * f});
    EXPECT_NEAR(found.real(), DiscTransfer(1, f, 0), 2e-3);
    EXPECT_NEAR(found.imag(), 0, 1e-9);
  }
}

TEST(ApertureOutline, RefusesWhatIsNoAperture) {
  std::string why;
  ApertureOutline outline;
  EXPECT_TRUE(outline.IsValid(&why));
  outline.blades = 2;
  EXPECT_FALSE(outline.IsValid(&why));
  EXPECT_THAT(why, HasSubstr("aperture.blades is 2: it must be from 3 to 30"));
  outline.blades = 6;
  outline.roundness = 1.1;
  EXPECT_FALSE(outline.IsValid(&why));
  EXPECT_THAT(why, HasSubstr("aperture.roundness is 1.1"));
  EXPECT_THAT(testing::ErrorOf([] { MomentsOf({{0, 0}, {1, 0}}); }), HasSubstr("at least 3"));
}

}  // namespace
}  // namespace thicklens::model

#include "thicklens/estimator/view_geometry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/test_cameras.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::estimator {
namespace {

using ::testing::AllOf;
using testing::ErrorOf;
using ::testing::HasSubstr;
using thicklens::testing::TestCameraFocusedAt;
using thicklens::testing::TestSensor;
using thicklens::testing::WideLens;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

std::size_t At(int x, int y, int width) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
         static_cast<std::size_t>(x);
}

DisparityMap MapOf(int width, int height, const std::function<double(int, int)>& disparity,
                   const Eigen::Vector2d& step = {1, 1}) {
  DisparityMap map{width, height, {}, step};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) map.disparity.push_back(static_cast<float>(disparity(x, y)));
  }
  return map;
}

model::LinearImage ImageFrom(int width, int height, int channels,
                             const std::function<double(int, int, int)>& value) {
  model::LinearImage image{width, height, channels, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < channels; ++c) {
        image.values.push_back(static_cast<float>(value(x, y, c)));
      }
    }
  }
  return image;
}

// Position of a sample's source in the centre view.
Eigen::Vector2d SourceOf(const ViewDisparity& view, int x, int y) {
  const std::size_t i = At(x, y, view.width_px);
  return {x + double{view.source_x[i]}, y + double{view.source_y[i]}};
}

model::Camera BenchCamera() {
  return TestCameraFocusedAt(640, "bench", WideLens(), TestSensor(21, 17, 0.05, {10, 7}));
}

// --- From depths and maps to disparities.

struct PlanesCase {
  const char* name;
  model::LightFieldPlanes planes;
  int u_count, v_count;
};

class DisparityOnGridTest : public ::testing::TestWithParam<PlanesCase> {};

// A point of the scene is followed from the centre view to another by the geometry of its rays.
TEST_P(DisparityOnGridTest, FollowsTheRaysOfAPoint) {
  const PlanesCase& planes_case = GetParam();
  const model::LightFieldGrid grid = model::GridOnPlanes(BenchCamera(), planes_case.planes,
                                                         planes_case.u_count, planes_case.v_count);
  const std::vector<float> depth_mm = {450, 640, 3000};
  const DisparityMap map = DisparityOnGrid(grid, depth_mm, 3, 1);
  EXPECT_GT(map.disparity[0], map.disparity[1]);
  EXPECT_GT(map.disparity[1], map.disparity[2]);

  for (std::size_t n = 0; n < depth_mm.size(); ++n) {
    const double z = depth_mm[n];
    const model::Ray centre{3.0, -2.0, 0, 0};
    const Eigen::Vector2d point = model::PositionAtDepthMm(grid.planes, centre, z);
    const double a = 2;
    const double b = -1;
    model::Ray other{0, 0, a * grid.u_step_mm, b * grid.v_step_mm};
    const Eigen::Vector2d by_uv = model::PositionAtDepthMm(grid.planes, other, z);
    const double st_share = (z - grid.planes.uv_depth_mm) / grid.planes.plane_spacing_mm;
    const double moved_s = ((point.x() - by_uv.x()) / st_share - centre.s_mm) / grid.s_step_mm;
    const double moved_t = ((point.y() - by_uv.y()) / st_share - centre.t_mm) / grid.t_step_mm;
    EXPECT_NEAR(moved_s, -a * map.step.x() * map.disparity[n], 2e-5);
    EXPECT_NEAR(moved_t, -b * map.step.y() * map.disparity[n], 2e-5);
  }
}

INSTANTIATE_TEST_SUITE_P(Planes, DisparityOnGridTest,
                         ::testing::Values(PlanesCase{"Default", {0, 640}, 5, 5},
                                           PlanesCase{"NotSquare", {0, 640}, 3, 7},
                                           PlanesCase{"OneColumn", {0, 640}, 1, 5},
                                           PlanesCase{"UvInFront", {120, 300}, 5, 5},
                                           PlanesCase{"StBeforeUv", {300, -100}, 5, 5}),
                         [](const auto& tested) { return tested.param.name; });

TEST(DisparityOnGrid, KeepsHolesAndRefusesDepthsThatAreNotBeyondTheUvPlane) {
  const model::LightFieldGrid grid = model::GridOnPlanes(BenchCamera(), {120, 300}, 3, 3);
  const DisparityMap map = DisparityOnGrid(grid, {500, kNan, 121}, 3, 1);
  EXPECT_FALSE(std::isnan(map.disparity[0]));
  EXPECT_TRUE(std::isnan(map.disparity[1]));
  EXPECT_FALSE(std::isnan(map.disparity[2]));
  EXPECT_THAT(ErrorOf([&] {
                DisparityOnGrid(grid, {500, 120}, 2, 1);
              }),
              AllOf(HasSubstr("120 mm"), HasSubstr("UV plane")));
  EXPECT_THAT(ErrorOf([&] { DisparityOnGrid(grid, {500, -3}, 2, 1); }), HasSubstr("-3 mm"));
  EXPECT_THAT(ErrorOf([&] {
                DisparityOnGrid(grid, {500, 600}, 3, 1);
              }),
              AllOf(HasSubstr("2 values"), HasSubstr("3x1")));
}

// Similar triangles make the disparity linear in 1/(depth beyond the UV plane), so two depths
// determine that of infinity.
TEST(DisparityOnGrid, TendsToThatOfInfinity) {
  const model::LightFieldGrid grid = model::GridOnPlanes(BenchCamera(), {120, 300}, 3, 3);
  const DisparityMap map = DisparityOnGrid(grid, {500, 1000, 1e7F}, 3, 1);
  const double near = 1.0 / (500 - 120), far = 1.0 / (1000 - 120);
  const double d_near = map.disparity[0], d_far = map.disparity[1];
  const double at_infinity = d_far - (d_near - d_far) / (near - far) * far;
  EXPECT_NEAR(DisparityAtInfinity(grid), at_infinity, 1e-5 * std::abs(d_near - d_far));
  EXPECT_GT(map.disparity[2], DisparityAtInfinity(grid) - 1e-6);
  EXPECT_GT(d_far, DisparityAtInfinity(grid));
}

TEST(DisparityFromMap, ScalesMovesAndMarksHoles) {
  const DisparityMap map =
      DisparityFromMap({4, 1, {1, 0, kNan, kInfinity}, /*integer=*/false}, -2, 0.5);
  EXPECT_EQ(map.disparity[0], -1.5F);
  EXPECT_EQ(map.disparity[1], 0.5F);  // 0 is the plane of focus
  EXPECT_TRUE(std::isnan(map.disparity[2]));
  EXPECT_TRUE(std::isnan(map.disparity[3]));
  EXPECT_EQ(map.step, Eigen::Vector2d(1, 1));
  EXPECT_TRUE(std::isnan(DisparityFromMap({2, 1, {0, 3}, true}, 1, 1).disparity[0]));
}

TEST(DisparityFromMap, RefusesWhatIsNoMap) {
  EXPECT_THAT(ErrorOf([] { DisparityFromMap({2, 1, {0, 0}, true}, 1, 0); }), HasSubstr("holes"));
  EXPECT_THAT(ErrorOf([] { DisparityFromMap({1, 1, {kNan}, false}, 1, 0); }), HasSubstr("holes"));
  EXPECT_THAT(ErrorOf([] { DisparityFromMap({2, 1, {1}, false}, 1, 0); }), HasSubstr("1 values"));
  EXPECT_THAT(ErrorOf([] { DisparityFromMap({1, 1, {1}, false}, 0, 0); }), HasSubstr("scale"));
  EXPECT_THAT(ErrorOf([] { DisparityFromMap({1, 1, {1}, false}, 1, kNan); }), HasSubstr("offset"));
}

// --- Views of known geometry.

TEST(RenderDisparity, GivesTheMapItselfWhereNothingMoves) {
  std::mt19937 engine(5);
  std::uniform_real_distribution<double> uniform(-2, 2);
  const auto noise = [&](int, int) { return uniform(engine); };
  const DisparityMap map = MapOf(9, 6, noise);
  const DisparityMap still = MapOf(9, 6, noise, {0, 1});
  for (const auto& [shown, a, b] : {std::tuple{&map, 0.0, 0.0}, std::tuple{&still, 3.0, 0.0}}) {
    const ViewDisparity view = RenderDisparity(*shown, a, b);
    EXPECT_EQ(view.disparity, shown->disparity);
    EXPECT_EQ(view.source_x, std::vector<float>(54, 0));
    EXPECT_EQ(view.source_y, std::vector<float>(54, 0));
    EXPECT_EQ(std::count(view.visibility.begin(), view.visibility.end(), Visibility::kVisible), 54);
  }
}

struct PlaneCase {
  const char* name;
  double at_origin, per_x, per_y;
  double a, b;
  Eigen::Vector2d step;
};

class SlantedPlaneTest : public ::testing::TestWithParam<PlaneCase> {};

// The plane d = d0 + g x appears at x' = x - A d(x), A = (a step.x, b step.y), so that x = (Id - A
// g^T)^-1 (x' + A d0).
TEST_P(SlantedPlaneTest, HasItsClosedForm) {
  const PlaneCase& plane = GetParam();
  const int width = 40;
  const int height = 30;
  const Eigen::Vector2d gradient(plane.per_x, plane.per_y);
  const Eigen::Vector2d shift(plane.a * plane.step.x(), plane.b * plane.step.y());
  const DisparityMap map = MapOf(
      width, height,
      [&](int x, int y) { return plane.at_origin + gradient.dot(Eigen::Vector2d(x, y)); },
      plane.step);
  const ViewDisparity view = RenderDisparity(map, plane.a, plane.b);
  const Eigen::Matrix2d inverse =
      (Eigen::Matrix2d::Identity() - shift * gradient.transpose()).inverse();
  int visibility = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::size_t i = At(x, y, width);
      const Eigen::Vector2d source = inverse * (Eigen::Vector2d(x, y) + shift * plane.at_origin);
      // Distance from the border of the centre image, positive inside.
      const double inside =
          std::min({source.x(), width - 1 - source.x(), source.y(), height - 1 - source.y()});
      if (std::abs(inside) < 1e-3) continue;  // on its rim
      ASSERT_EQ(view.visibility[i], inside > 0 ? Visibility::kVisible : Visibility::kOccluded)
          << x << ", " << y;
      const Eigen::Vector2d found = SourceOf(view, x, y);
      if (inside > 0) {
        ++visibility;
        EXPECT_NEAR(view.disparity[i], plane.at_origin + gradient.dot(source), 3e-5);
        EXPECT_NEAR((found - source).norm(), 0, 1e-4);
      } else {
        EXPECT_NEAR(view.disparity[i], plane.at_origin + gradient.dot(found), 1e-4);
        EXPECT_GE(found.minCoeff(), -1e-3);
        EXPECT_LE(found.x(), width - 1 + 1e-3);
        EXPECT_LE(found.y(), height - 1 + 1e-3);
      }
    }
  }
  EXPECT_GT(visibility, 100);
}

INSTANTIATE_TEST_SUITE_P(
    Planes, SlantedPlaneTest,
    ::testing::Values(PlaneCase{"Fronto", 1.3, 0, 0, 2, 0, {1, 1}},
                      PlaneCase{"FrontoByWholePixels", 1, 0, 0, 2, -3, {1, 1}},
                      PlaneCase{"AlongX", -1.7, 0.08, 0, 3, 0, {1, 1}},
                      PlaneCase{"AlongY", 0.7, 0, -0.06, 0, 3, {1, 1}},
                      PlaneCase{"Both", -1.1, 0.05, 0.03, 2, -3, {1, 1}},
                      PlaneCase{"HalfSteps", -1.1, 0.05, 0.03, -1.5, 0.5, {1, 1}},
                      PlaneCase{"StepsInMm", -11, 0.5, 0.3, -1.5, 2.5, {0.11, 0.07}},
                      PlaneCase{"StepsOfOneAxis", -11, 0.5, 0.3, -1.5, 2.5, {0.11, 0}},
                      // Left and right are exchanged, so the back of the plane is visible.
                      PlaneCase{"TurnedOver", -3.5, 0.18, 0, 9, 0, {1, 1}}),
    [](const auto& tested) { return tested.param.name; });

// A rectangle before a wall, both parallel to the image.
struct TwoLayers {
  static constexpr int kWidth = 48, kHeight = 36;
  int left = 17, right = 26, top = 12, bottom = 20;  // pixels of the rectangle, inclusive
  double near_px = 1.9, far_px = -0.6;

  // A position of the centre view. A pixel extends half a pixel beyond its centre.
  bool IsNear(double x, double y) const {
    return x >= left - 0.5 && x <= right + 0.5 && y >= top - 0.5 && y <= bottom + 0.5;
  }
  DisparityMap Map() const {
    return MapOf(kWidth, kHeight, [this](int x, int y) { return IsNear(x, y) ? near_px : far_px; });
  }
  bool NearCovers(double x, double y, double a, double b) const {
    return IsNear(x + a * near_px, y + b * near_px);
  }
  bool FarCovers(double x, double y, double a, double b) const {
    const double source_x = x + a * far_px;
    const double source_y = y + b * far_px;
    return source_x >= 0 && source_x <= kWidth - 1 && source_y >= 0 && source_y <= kHeight - 1 &&
           !IsNear(source_x, source_y);
  }
};

TEST(RenderDisparity, SeesTwoLayersInTheirClosedForm) {
  const TwoLayers scene;
  for (const auto& [a, b] : {std::pair{2.0, 0.0},
                             {-3.0, 0.0},
                             {0.0, 2.0},
                             {0.0, -1.0},
                             {2.0, 2.0},
                             {-1.0, 3.0},
                             {1.5, -2.2}}) {
    const ViewDisparity view = RenderDisparity(scene.Map(), a, b);
    int near = 0;
    int occluded = 0;
    for (int y = 0; y < TwoLayers::kHeight; ++y) {
      for (int x = 0; x < TwoLayers::kWidth; ++x) {
        const std::size_t i = At(x, y, TwoLayers::kWidth);
        const bool is_near = scene.NearCovers(x, y, a, b);
        const bool is_visible = is_near || scene.FarCovers(x, y, a, b);
        ASSERT_EQ(view.visibility[i], is_visible ? Visibility::kVisible : Visibility::kOccluded)
            << x << ", " << y << " of view " << a << ", " << b;
        // Hidden samples show the background, also at the border of the image.
        const double disparity = is_near ? scene.near_px : scene.far_px;
        ASSERT_NEAR(view.disparity[i], disparity, 1e-6) << x << ", " << y;
        if (is_visible) {
          EXPECT_NEAR(view.source_x[i], a * disparity, 1e-5);
          EXPECT_NEAR(view.source_y[i], b * disparity, 1e-5);
        } else {
          const Eigen::Vector2d source = SourceOf(view, x, y);
          EXPECT_FALSE(scene.IsNear(source.x(), source.y()));
        }
        near += is_near ? 1 : 0;
        occluded += is_visible ? 0 : 1;
      }
    }
    EXPECT_GT(near, 70);
    EXPECT_GT(occluded, 20);
  }
}

// In the view to the right the rectangle is farther left, and the background that appears behind
// its right edge is hidden from the centre; in the view to the left it is that behind its left
// edge.
TEST(RenderDisparity, FillsFromTheBackgroundSide) {
  const TwoLayers scene;
  for (const int a : {3, -3}) {
    const ViewDisparity view = RenderDisparity(scene.Map(), a, 0);
    for (int y = scene.top; y <= scene.bottom; ++y) {
      int occluded = 0;
      for (int x = 4; x < TwoLayers::kWidth - 4; ++x) {
        const std::size_t i = At(x, y, TwoLayers::kWidth);
        if (view.visibility[i] == Visibility::kVisible) continue;
        ++occluded;
        int background = x;
        while (!scene.FarCovers(background, y, a, 0)) background += a > 0 ? 1 : -1;
        EXPECT_NEAR(view.source_x[i], background - x + a * scene.far_px, 1e-5) << x;
        EXPECT_EQ(view.source_y[i], 0);
      }
      EXPECT_GE(occluded, 6);  // (near - far) * |a| = 7.5 px
    }
  }
}

TEST(RenderDisparity, FillsBordersFromTheOneSideAndCornersFromWhatIsClosest) {
  const int width = 20;
  const int height = 16;
  const DisparityMap map = MapOf(width, height, [](int, int) { return 1.5; });
  const ViewDisparity right = RenderDisparity(map, 2, 0);  // all moves 3 px to the left
  EXPECT_EQ(right.visibility[At(16, 5, width)], Visibility::kVisible);
  for (int x = 17; x < width; ++x) {
    EXPECT_EQ(right.visibility[At(x, 5, width)], Visibility::kOccluded);
    EXPECT_EQ(right.source_x[At(x, 5, width)], 16 - x + 3);
    EXPECT_EQ(right.source_y[At(x, 5, width)], 0);
  }
  // 3 px to the left and up: along the diagonal, the corners at the top right and bottom left meet
  // nothing.
  const ViewDisparity diagonal = RenderDisparity(map, 2, 2);
  EXPECT_EQ(diagonal.source_x[At(19, 15, width)], -3 + 3);
  EXPECT_EQ(diagonal.source_y[At(19, 15, width)], -3 + 3);
  EXPECT_EQ(diagonal.source_x[At(18, 0, width)], -2 + 3);
  EXPECT_EQ(diagonal.source_y[At(18, 0, width)], 0 + 3);
  EXPECT_EQ(diagonal.source_x[At(0, 14, width)], 0 + 3);
  EXPECT_EQ(diagonal.source_y[At(0, 14, width)], -2 + 3);
}

// A bar was removed from the front of a wall, and the wall to its left and to its right is equally
// far.
TEST(RenderDisparity, FillsFromTheCloserOfTwoEquallyFarSides) {
  const DisparityMap map = MapOf(40, 3, [](int x, int) { return x >= 20 && x <= 22 ? 2.0 : 0.0; });
  const ViewDisparity view = RenderDisparity(map, 3, 0);
  for (const auto& [x, source] : {std::pair{20, 19}, {21, 23}, {22, 23}}) {
    EXPECT_EQ(view.visibility[At(x, 1, 40)], Visibility::kOccluded);
    EXPECT_EQ(SourceOf(view, x, 1).x(), source) << x;
  }
}

// Rounding puts the last pixel 1.5e-8 px to the left of a sample.
TEST(RenderDisparity, DoesNotLoseTheBorderToRounding) {
  const DisparityMap map = MapOf(10, 8, [](int, int) { return 0.1; }, {10, 10});
  ASSERT_GT(10 * double{map.disparity[0]}, 1);
  const ViewDisparity view = RenderDisparity(map, 1, 1);
  EXPECT_EQ(view.visibility[At(8, 6, 10)], Visibility::kVisible);
  EXPECT_EQ(view.visibility[At(9, 6, 10)], Visibility::kOccluded);
}

TEST(RenderDisparity, TakesTheCentreViewWhereNothingAtAllIsCovered) {
  const DisparityMap map = MapOf(6, 5, [](int x, int) { return 1e9 + 1e6 * x; });
  const ViewDisparity view = RenderDisparity(map, 3, 1);
  EXPECT_EQ(view.disparity, map.disparity);
  EXPECT_EQ(view.source_x, std::vector<float>(30, 0));
  EXPECT_EQ(std::count(view.visibility.begin(), view.visibility.end(), Visibility::kOccluded), 30);
}

// Two surfaces separate, while one surface is stretched. The limit is 0.2 px per view step, for the
// larger of the two steps.
TEST(RenderDisparity, JoinsNeighboursOfOneSurfaceOnly) {
  for (const double step : {1.0, 0.5}) {
    for (const double jump_px : {0.19, 0.21}) {
      const DisparityMap map = MapOf(
          30, 4, [&](int x, int) { return x < 15 ? 0.0 : -jump_px / step; }, {step, step / 3});
      const ViewDisparity view = RenderDisparity(map, 20, 0);  // 3.8 or 4.2 px apart
      const bool one_surface = jump_px < 0.2;
      EXPECT_EQ(view.visibility[At(16, 1, 30)],
                one_surface ? Visibility::kVisible : Visibility::kOccluded);
      EXPECT_EQ(view.visibility[At(14, 1, 30)], Visibility::kVisible);
    }
  }
}

TEST(RenderDisparity, KeepsWhatIsOnePixelWide) {
  const DisparityMap map =
      MapOf(25, 7, [](int x, int y) { return x == 12 || y == 3 ? 1.3 : -0.2; });
  const ViewDisparity view = RenderDisparity(map, 1, 0);
  // 12 - 1.3 = 10.7: sample 11 and no other.
  for (int x = 5; x < 20; ++x) {
    EXPECT_NEAR(view.disparity[At(x, 0, 25)], x == 11 ? 1.3 : -0.2, 1e-6) << x;
    EXPECT_NEAR(view.disparity[At(x, 3, 25)], 1.3, 1e-6) << x;
  }
  const DisparityMap row = MapOf(9, 1, [](int, int) { return 1.0; });
  EXPECT_EQ(RenderDisparity(row, 1, 0).visibility[3], Visibility::kVisible);
}

// --- A slow reference: every sample asks every triangle and square by itself.

struct Point {
  Eigen::Vector2d position;
  double disparity;
};

// The disparity of the triangle at the position, or -infinity. By solving for its two edges.
double OfTriangle(const Point& p, const Point& q, const Point& r, const Eigen::Vector2d& position) {
  Eigen::Matrix2d edges;
  edges << q.position - p.position, r.position - p.position;
  if (std::abs(edges.determinant()) < 1e-9) return -kInfinity;
  const Eigen::Vector2d share = edges.inverse() * (position - p.position);
  if (share.minCoeff() < -1e-5 || share.sum() > 1 + 1e-5) return -kInfinity;
  return p.disparity + share.x() * (q.disparity - p.disparity) +
         share.y() * (r.disparity - p.disparity);
}

double SlowDisparity(const DisparityMap& map, double a, double b, int x, int y) {
  const auto point = [&](int px, int py) {
    const double d = map.disparity[At(px, py, map.width_px)];
    return Point{{px - a * map.step.x() * d, py - b * map.step.y() * d}, d};
  };
  const Eigen::Vector2d position(x, y);
  double nearest = -kInfinity;
  std::vector<bool> alone(map.disparity.size(), false);
  for (int cy = 0; cy + 1 < map.height_px; ++cy) {
    for (int cx = 0; cx + 1 < map.width_px; ++cx) {
      const std::array<Point, 4> corner = {point(cx, cy), point(cx + 1, cy), point(cx, cy + 1),
                                           point(cx + 1, cy + 1)};
      double spread = 0;
      for (const Point& p : corner) {
        for (const Point& q : corner) spread = std::max(spread, p.disparity - q.disparity);
      }
      if (spread * map.step.cwiseAbs().maxCoeff() <= 0.2) {
        nearest = std::max({nearest, OfTriangle(corner[0], corner[1], corner[3], position),
                            OfTriangle(corner[0], corner[2], corner[3], position)});
        continue;
      }
      for (const Point& p : corner) {
        if ((p.position - position).cwiseAbs().maxCoeff() <= 0.5) {
          nearest = std::max(nearest, p.disparity);
        }
      }
    }
  }
  return nearest;
}

TEST(RenderDisparity, AgreesWithASlowReference) {
  std::mt19937 engine(11);
  std::uniform_real_distribution<double> uniform(-0.08, 0.08);
  const int width = 27;
  const int height = 19;
  for (const Eigen::Vector2d& step : {Eigen::Vector2d(1, 1), Eigen::Vector2d(-0.4, 0.9)}) {
    const DisparityMap map = MapOf(
        width, height,
        [&](int x, int y) {
          const bool is_near = (x - 9) * (x - 9) + (y - 8) * (y - 8) < 30;
          const bool is_ridge = x > 19 && y > 4;
          return (is_near ? 1.6 : is_ridge ? 0.12 * std::abs(x - 23) : -0.9) + uniform(engine);
        },
        step);
    for (const auto& [a, b] : {std::pair{1.37, -2.21}, {-3.13, 0.59}, {4.71, 3.83}}) {
      const ViewDisparity view = RenderDisparity(map, a, b);
      int occluded = 0;
      for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
          const std::size_t i = At(x, y, width);
          const double expected = SlowDisparity(map, a, b, x, y);
          const bool visibility = std::isfinite(expected);
          ASSERT_EQ(view.visibility[i] == Visibility::kVisible, visibility) << x << ", " << y;
          if (visibility) {
            EXPECT_NEAR(view.disparity[i], expected, 1e-5) << x << ", " << y;
            EXPECT_NEAR(view.source_x[i], a * step.x() * expected, 1e-4);
            EXPECT_NEAR(view.source_y[i], b * step.y() * expected, 1e-4);
          } else {
            ++occluded;
          }
        }
      }
      EXPECT_GT(occluded, 10);
    }
  }
}

// A screen with a slit before a wall. Through the slit, the view to the right shows a part of the
// wall that the screen's left part hides from the centre, and nothing that the centre shows. The
// screen is on both sides of the hole.
TEST(RenderDisparity, SeesTheWallBehindASlitThatIsNarrowerThanTheHole) {
  constexpr int kWidth = 40, kFirst = 20, kLast = 21;
  const auto of = [](int x, int) { return x >= kFirst && x <= kLast ? -0.5 : 2.0; };
  for (const bool upright : {true, false}) {
    const DisparityMap map =
        upright ? MapOf(kWidth, 5, of) : MapOf(5, kWidth, [&](int x, int y) { return of(y, x); });
    for (const int a : {3, -3}) {
      const ViewDisparity view = RenderDisparity(map, upright ? a : 0, upright ? 0 : a);
      for (int along = 8; along < kWidth - 8; ++along) {
        const int x = upright ? along : 2, y = upright ? 2 : along;
        const std::size_t i = At(x, y, map.width_px);
        const bool in_slit = along >= kFirst - 2 * a && along <= kLast - 2 * a;
        ASSERT_EQ(view.visibility[i], in_slit ? Visibility::kOccluded : Visibility::kVisible)
            << along;
        EXPECT_FLOAT_EQ(view.disparity[i], in_slit ? -0.5F : 2.0F) << along;
        if (!in_slit) continue;
        const Eigen::Vector2d source = SourceOf(view, x, y);
        EXPECT_EQ(upright ? source.x() : source.y(), a > 0 ? kFirst : kLast);
        EXPECT_EQ(upright ? source.y() : source.x(), 2);
      }
    }
  }
}

// Depth sensors have large errors at single pixels. A ray that passes before such a pixel does not
// determine a surface.
TEST(RenderDisparity, IsNotLedByASinglePixelThatIsFarTooFar) {
  constexpr int kFirst = 14, kLast = 25;
  DisparityMap map =
      MapOf(40, 9, [](int x, int) { return x >= kFirst && x <= kLast ? 2.0 : -0.5; });
  const ViewDisparity clean = RenderDisparity(map, 3, 0);
  for (const int x : {6, 17, 22, 30}) map.disparity[At(x, 4, map.width_px)] = -9;
  const ViewDisparity view = RenderDisparity(map, 3, 0);
  int compared = 0;
  for (int x = 2; x < map.width_px - 2; ++x) {
    const std::size_t i = At(x, 4, map.width_px);
    if (clean.visibility[i] == Visibility::kVisible || view.visibility[i] == Visibility::kVisible)
      continue;
    ++compared;
    EXPECT_EQ(view.disparity[i], clean.disparity[i]) << x;
  }
  EXPECT_GT(compared, 4);
}

bool HasTwoOfItsSurface(const DisparityMap& map, int x, int y) {
  int found = -1;  // itself
  for (int v = std::max(0, y - 1); v <= std::min(map.height_px - 1, y + 1); ++v) {
    for (int u = std::max(0, x - 1); u <= std::min(map.width_px - 1, x + 1); ++u) {
      const float difference =
          map.disparity[At(u, v, map.width_px)] - map.disparity[At(x, y, map.width_px)];
      if (std::abs(difference) <= 0.3F) ++found;
    }
  }
  return found >= 2;
}

// For any map, the ray of an occluded sample crosses the centre view: at n px along the
// displacement its disparity is n over the px per unit. The last pixel before which it passes gives
// the surface behind whose edge it disappears.
TEST(RenderDisparity, ShowsTheSurfaceThatTheOccludedRayPassedLast) {
  std::mt19937 engine(12);
  std::uniform_real_distribution<double> uniform(-1.5, 1.5);
  const int width = 31;
  const int height = 23;
  const DisparityMap map = MapOf(width, height, [&](int, int) { return uniform(engine); });
  const ViewDisparity view = RenderDisparity(map, 2, 1);  // one sample down for two to the right
  int compared = 0, passed_alone = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::size_t i = At(x, y, width);
      if (view.visibility[i] == Visibility::kVisible) continue;
      for (int n = -4; n <= width; ++n) {
        const int xx = x + n;
        const int yy = static_cast<int>(std::floor(y + 0.5 * n + 0.5));
        if (xx < 0 || yy < 0 || xx >= width || yy >= height) continue;
        const float there = map.disparity[At(xx, yy, width)];
        if (!(there < n / 2.0) || !HasTwoOfItsSurface(map, xx, yy)) continue;
        ++compared;
        EXPECT_NEAR(view.disparity[i], there, 0.3) << x << ", " << y;
        if (view.disparity[i] == there && SourceOf(view, x, y) == Eigen::Vector2d(xx, yy)) {
          ++passed_alone;
        }
        break;
      }
    }
  }
  EXPECT_GT(compared, 50);
  EXPECT_GT(passed_alone, 20);
}

TEST(RenderDisparity, RefusesHolesAndWrongSizes) {
  DisparityMap map = MapOf(3, 2, [](int, int) { return 1; });
  EXPECT_THAT(ErrorOf([&] { RenderDisparity(map, kNan, 0); }), HasSubstr("finite"));
  map.disparity[4] = kNan;
  EXPECT_THAT(ErrorOf([&] { RenderDisparity(map, 1, 0); }), HasSubstr("holes"));
  map.disparity.pop_back();
  EXPECT_THAT(ErrorOf([&] { RenderDisparity(map, 1, 0); }), HasSubstr("5 values"));
}

// --- Images.

// Catmull-Rom is exact for polynomials of the second degree.
TEST(WarpImage, IsExactForAQuadraticTexture) {
  const int width = 30;
  const int height = 24;
  const auto texture = [](double x, double y, int c) {
    return 0.3 + 0.01 * x - 0.02 * y + 0.001 * (c + 1) * x * x + 0.0007 * x * y - 0.0004 * y * y;
  };
  const model::LinearImage image = ImageFrom(width, height, 3, texture);
  const double per_x = 0.04;
  const DisparityMap map =
      MapOf(width, height, [&](int x, int) { return -0.5 + per_x * x; }, {1, 0.8});
  for (const auto& [a, b] : {std::pair{2.0, 0.0}, {-2.0, 1.0}, {0.0, 3.0}, {0.5, -0.5}}) {
    const model::LinearImage warped = WarpImage(image, map, RenderDisparity(map, a, b));
    int compared = 0;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const double source_x = (x + a * -0.5) / (1 - a * per_x);
        const double source_y = y + b * 0.8 * (-0.5 + per_x * source_x);
        if (!(source_x >= 1 && source_x <= width - 2 && source_y >= 1 && source_y <= height - 2)) {
          continue;  // taps beyond the border are repeated
        }
        ++compared;
        for (int c = 0; c < 3; ++c) {
          EXPECT_NEAR(warped.at(x, y, c), texture(source_x, source_y, c), 1e-5) << x << ", " << y;
        }
      }
    }
    EXPECT_GT(compared, 350);
  }
}

TEST(WarpImage, FollowsASineTexture) {
  const int width = 64;
  const auto texture = [](double x) { return 0.5 + 0.4 * std::sin(2 * std::acos(-1.0) * x / 12); };
  const model::LinearImage image =
      ImageFrom(width, 5, 1, [&](int x, int, int) { return texture(x); });
  const DisparityMap map = MapOf(width, 5, [](int x, int) { return 0.9 - 0.03 * x; });
  const model::LinearImage warped = WarpImage(image, map, RenderDisparity(map, 3, 0));
  for (int x = 4; x < width - 4; ++x) {
    const double source = (x + 3 * 0.9) / (1 + 3 * 0.03);
    if (source < 1 || source > width - 2) continue;
    // Error of the cubic convolution at 12 samples a period, at most: amplitude times
    // (2 pi/12)^3/(4 sqrt(27)).
    EXPECT_NEAR(warped.at(x, 2, 0), texture(source), 0.4 * 0.0071) << x;
  }
}

// A sample is a square; so much of it as the rectangle covers is the rectangle's.
TEST(WarpImage, MixesSurfacesByTheAreaThatEachCovers) {
  const TwoLayers scene;
  const DisparityMap map = scene.Map();
  const model::LinearImage image = ImageFrom(
      TwoLayers::kWidth, TwoLayers::kHeight, 3,
      [&](int x, int y, int c) { return scene.IsNear(x, y) ? 0.9 - 0.1 * c : 0.1 + 0.05 * c; });
  const auto overlap = [](double at, double first, double last) {
    return std::max(0.0, std::min(at + 0.5, last + 0.5) - std::max(at - 0.5, first - 0.5));
  };
  int boundary = 0;
  for (const auto& [a, b] : {std::pair{2.0, 0.0}, {-1.0, 3.0}, {1.5, -2.2}, {-0.3, 0.4}}) {
    const model::LinearImage warped = WarpImage(image, map, RenderDisparity(map, a, b));
    for (int y = 0; y < TwoLayers::kHeight; ++y) {
      for (int x = 0; x < TwoLayers::kWidth; ++x) {
        const double near = overlap(x + a * scene.near_px, scene.left, scene.right) *
                            overlap(y + b * scene.near_px, scene.top, scene.bottom);
        if (near > 0.01 && near < 0.99) ++boundary;
        // Less than a hundredth is left out.
        const double tolerance =
            near == 0 || near > 0.9999 || (near > 0.0101 && near < 0.9899) ? 1e-5 : 0.01;
        for (int c = 0; c < 3; ++c) {
          const double expected = near * (0.9 - 0.1 * c) + (1 - near) * (0.1 + 0.05 * c);
          ASSERT_NEAR(warped.at(x, y, c), expected, tolerance)
              << x << ", " << y << " of view " << a << ", " << b;
        }
      }
    }
  }
  EXPECT_GT(boundary, 100);
}

// The surface behind may be a hole. Its occluded background is used then.
TEST(RenderDisparity, MixesInTheOccludedBackgroundWhereNothingElseIsBehind) {
  const TwoLayers scene;
  // The near surface moves 4.18 px to the left, the far one 1.32 px to the right
  const double a = 2.2;
  const ViewDisparity view = RenderDisparity(scene.Map(), a, 0);
  int found = 0;
  for (const kernels::BoundarySample& boundary : view.boundary) {
    const auto i = static_cast<std::size_t>(boundary.index);
    const int x = boundary.index % TwoLayers::kWidth;
    if (x < 20) continue;  // the left edge, before visible background
    if (boundary.index / TwoLayers::kWidth != 15) continue;
    ++found;
    // 26.5 - 4.18 = 22.32: the sample at 22 is covered except for 0.18 px.
    EXPECT_EQ(x, 22);
    EXPECT_NEAR(boundary.share, 0.18, 1e-5);
    EXPECT_NEAR(view.disparity[i], scene.near_px, 1e-6);
    EXPECT_EQ(view.visibility[i + 1], Visibility::kOccluded);
    EXPECT_EQ(boundary.other.index, boundary.index + 1);
    // The centre view shows the rectangle there, so the position of the neighbour is read.
    EXPECT_EQ(boundary.other.source_x, view.source_x[i + 1] + 1);
    EXPECT_EQ(boundary.other.disparity, view.disparity[i + 1]);
  }
  EXPECT_EQ(found, 1);
}

double SharedAt(const ViewDisparity& view, std::size_t i) {
  for (const kernels::BoundarySample& boundary : view.boundary) {
    if (static_cast<std::size_t>(boundary.index) == i) return double{boundary.share};
  }
  return 0;
}

// The texture of the wall is linear, so taps of the wall on both sides give it exactly. If the
// other tap shows the rectangle, the remaining one replaces it. Hidden samples show their
// background.
TEST(WarpImage, UsesTheTapsOfTheSurfaceAlone) {
  const TwoLayers scene;
  const DisparityMap map = scene.Map();
  const auto wall = [](double x) { return 0.1 + 0.01 * x; };
  const model::LinearImage image =
      ImageFrom(TwoLayers::kWidth, TwoLayers::kHeight, 1,
                [&](int x, int y, int) { return scene.IsNear(x, y) ? 5.0 : wall(x); });
  const double a = 2;  // wall: source x - 1.2
  const ViewDisparity view = RenderDisparity(map, a, 0);
  const model::LinearImage warped = WarpImage(image, map, view);
  const int y = 15;
  int cut = 0;
  int occluded = 0;
  for (int x = 3; x < TwoLayers::kWidth - 3; ++x) {
    if (scene.NearCovers(x, y, a, 0)) continue;
    double source = x + a * scene.far_px;
    if (view.visibility[At(x, y, TwoLayers::kWidth)] == Visibility::kOccluded) {
      ++occluded;
      source = SourceOf(view, x, y).x();
    }
    const bool right_is_near = scene.IsNear(std::ceil(source), y);
    const bool left_is_near = scene.IsNear(std::floor(source), y);
    cut += right_is_near || left_is_near ? 1 : 0;
    const double of_wall = wall(right_is_near  ? std::floor(source)
                                : left_is_near ? std::ceil(source)
                                               : source);
    const double near = SharedAt(view, At(x, y, TwoLayers::kWidth));
    EXPECT_NEAR(warped.at(x, y, 0), (1 - near) * of_wall + near * 5, 1e-6) << x;
  }
  EXPECT_GT(cut, 0);
  EXPECT_GT(occluded, 3);
}

// The limit between one surface and two is 0.3 px per view step, for the larger of the steps.
TEST(WarpImage, SurfacesAreSeparatedByTheLargerStep) {
  for (const double difference_px : {0.28, 0.32}) {
    const double step = 0.25;
    const DisparityMap map = MapOf(
        12, 6, [&](int x, int) { return x < 6 ? 0.0 : difference_px / step; }, {step, step / 9});
    const model::LinearImage image =
        ImageFrom(12, 6, 1, [](int x, int, int) { return x < 6 ? 0.0 : 1.0; });
    ViewDisparity view = RenderDisparity(map, 0, 0);
    view.source_x[At(5, 3, 12)] = 0.5F;  // half way to the other part
    const float value = WarpImage(image, map, view).at(5, 3, 0);
    if (difference_px < 0.3) {
      EXPECT_NEAR(value, 0.5, 1e-6);
    } else {
      EXPECT_EQ(value, 0);
    }
  }
}

TEST(WarpImage, RepeatsTheBorder) {
  const DisparityMap map = MapOf(5, 4, [](int, int) { return 0.0; });
  const model::LinearImage image = ImageFrom(5, 4, 1, [](int x, int y, int) { return x + 10 * y; });
  ViewDisparity view = RenderDisparity(map, 0, 0);
  EXPECT_EQ(WarpImage(image, map, view).values, image.values);
  std::fill(view.source_x.begin(), view.source_x.end(), -100.0F);
  std::fill(view.source_y.begin(), view.source_y.end(), 100.0F);
  for (const float value : WarpImage(image, map, view).values) EXPECT_EQ(value, 30);
}

TEST(WarpImage, RefusesSizesThatDiffer) {
  const DisparityMap map = MapOf(5, 4, [](int, int) { return 0.0; });
  const ViewDisparity view = RenderDisparity(map, 0, 0);
  const auto flat = [](int, int, int) { return 0.5; };
  EXPECT_THAT(ErrorOf([&] { WarpImage(ImageFrom(4, 5, 1, flat), map, view); }),
              AllOf(HasSubstr("4x5"), HasSubstr("5x4")));
  const DisparityMap other = MapOf(4, 4, [](int, int) { return 0.0; });
  EXPECT_THAT(
      ErrorOf([&] { WarpImage(ImageFrom(5, 4, 1, flat), map, RenderDisparity(other, 0, 0)); }),
      HasSubstr("4x4"));
}

}  // namespace
}  // namespace thicklens::estimator

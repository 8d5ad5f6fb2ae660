// Tests how a depth map becomes the disparity of a photograph's pixels.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "support/error_message.h"
#include "support/test_cameras.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/thick_lens.h"
#include "tools/interface/problem.h"

namespace thicklens {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;
using thicklens::testing::ErrorOf;

constexpr float kHole = std::numeric_limits<float>::quiet_NaN();
constexpr int kMapWidth = 3, kMapHeight = 2;

model::Camera MapCamera() {
  return thicklens::testing::SmallCamera(kMapWidth, kMapHeight, {1, 0.5});
}

model::RawDepthMap MapOf(std::vector<float> values) {
  return {kMapWidth, kMapHeight, std::move(values), false};
}

// Tells nothing about surfaces.
model::LinearImage GreyImage(int width_px = kMapWidth) {
  return {width_px, kMapHeight, 1,
          std::vector<float>(static_cast<std::size_t>(width_px * kMapHeight))};
}

DepthMeaning KindAndUnit(const std::string& kind, const std::string& unit) {
  DepthMeaning meaning;
  meaning.kind = model::DepthKindFromName(kind);
  if (!unit.empty()) meaning.unit = LengthUnit::kMillimetre;
  return meaning;
}

PreparedDepth Prepared(const model::RawDepthMap& map, const std::string& source,
                       const DepthMeaning& meaning, const model::LinearImage& image,
                       const model::Camera* camera, const model::LightFieldGrid* grid) {
  return PrepareDepth({map.width_px, map.height_px, map.values, map.integer, meaning, source},
                      image, camera, grid);
}

TEST(PrepareDepth, WithoutACameraADisparityIsScaledAndFilled) {
  DepthMeaning options = KindAndUnit("disparity", "");
  options.disparity_scale = 2;
  options.disparity_offset_px = -1;
  // Around the hole there are 1 and 0 on the left, and 3, -2 and 0.25 elsewhere, each of which is a
  // surface of its own.
  const PreparedDepth prepared =
      Prepared(MapOf({1, kHole, 3, 0, -2, 0.25F}), "d.pfm", options, GreyImage(), nullptr, nullptr);
  EXPECT_THAT(prepared.disparity.disparity, ElementsAre(1, -5, 5, -1, -5, -0.5F));
  EXPECT_EQ(prepared.disparity.step, Eigen::Vector2d(1, 1));
  EXPECT_EQ(prepared.holes, 1U);
  EXPECT_FALSE(prepared.depth);
}

TEST(PrepareDepth, HolesAreCountedByReason) {
  DepthMap map{kMapWidth, kMapHeight, {0, 7, 9, 4, 5, 6}, true, KindAndUnit("disparity", ""),
               "d.png"};
  map.holes.hole_values = {9};
  const PreparedDepth prepared = PrepareDepth(map, GreyImage(), nullptr, nullptr);
  EXPECT_EQ(prepared.holes, 2U);
  EXPECT_EQ(prepared.found_holes.zero, 1U);
  EXPECT_EQ(prepared.found_holes.listed, 1U);
  EXPECT_THAT(prepared.was_hole, ElementsAre(true, false, true, false, false, false));
  map.holes = {};
  map.holes.zero_is_value = true;
  EXPECT_EQ(PrepareDepth(map, GreyImage(), nullptr, nullptr).holes, 0U);
}

TEST(PrepareDepth, TheLargestValueOfTheTypeIsNoDepth) {
  const model::Camera camera = MapCamera();
  const model::LightFieldGrid grid = model::DefaultGrid(camera, 3, 3);
  DepthMap map{
      kMapWidth, kMapHeight, {400, 500, 600, 700, 800, 65535}, true, KindAndUnit("z", "mm"),
      "d.png"};
  map.largest_of_type = 65535;
  const PreparedDepth prepared = PrepareDepth(map, GreyImage(), &camera, &grid);
  EXPECT_EQ(prepared.found_holes.largest, 1U);
  ASSERT_TRUE(prepared.depth);
  EXPECT_EQ(prepared.depth->max_mm, 800);
}

// The mark is why the map is refused: a depth of 9999000 mm beside others of 0.5 m.
TEST(PrepareDepth, HolesAndMarksAreReportedWhereTheMapIsRefused) {
  const model::Camera camera = thicklens::testing::SmallCamera(8, 8, {1, 0.5});
  const model::LightFieldGrid grid = model::DefaultGrid(camera, 3, 3);
  DepthMap map;
  map.width_px = map.height_px = 8;
  for (int i = 0; i < 64; ++i)
    map.values.push_back(i < 32 ? 9999 : 1 + 0.01F * static_cast<float>(i));
  map.values[63] = -1;
  map.meaning = KindAndUnit("z", "mm");
  map.source = "d.npy";
  const RunControl control;
  RunScope run(control);
  const model::LinearImage image{8, 8, 1, std::vector<float>(64)};
  EXPECT_THAT(ErrorOf([&] { PrepareDepth(map, image, &camera, &grid, &run); }),
              StartsWith("d.npy"));
  std::string notices;
  for (const Notice& notice : run.notices()) notices += notice.text + "\n";
  EXPECT_THAT(notices, AllOf(HasSubstr("32 pixels (50.0 %) have exactly the value 9999"),
                             HasSubstr("are negative and taken as 'no depth'")));
}

// A cause in the map is no reason for an error of another step.
TEST(PrepareDepth, OnlyImpossibleDepthsNameACauseInTheMap) {
  DepthMap map{
      kMapWidth, kMapHeight, {0, 0.01F, 0.5F, 0.7F, 0.9F, 1}, false, KindAndUnit("z", "mm"),
      "d.npy"};
  const model::Camera camera = MapCamera();
  const model::LightFieldGrid grid = model::DefaultGrid(camera, 3, 3);
  const RunControl control;
  RunScope run(control);
  EXPECT_THAT(ErrorOf([&] { PrepareDepth(map, GreyImage(), &camera, &grid, &run); }),
              HasSubstr("relative map"));
  EXPECT_THAT(ErrorOf([&] { PrepareDepth(map, GreyImage(5), &camera, &grid, &run); }),
              AllOf(HasSubstr("the sizes must be equal"), Not(HasSubstr("relative map"))));
}

TEST(PrepareDepth, InverseDepthIsThatOfItsDepth) {
  const model::Camera camera = MapCamera();
  const model::LightFieldGrid grid = model::DefaultGrid(camera, 3, 3);
  DepthMap map{kMapWidth, kMapHeight, {2.5F, 2, 1, 1.25F, 2, 0}, false, {}, "d.npy"};
  map.meaning.kind = DepthKind::kInverse;  // dioptres
  const PreparedDepth inverse = PrepareDepth(map, GreyImage(), &camera, &grid);
  EXPECT_EQ(inverse.holes, 1U);  // 0 is at infinity
  map.values = {400, 500, 1000, 800, 500, kHole};
  map.meaning = KindAndUnit("z", "mm");
  const PreparedDepth z = PrepareDepth(map, GreyImage(), &camera, &grid);
  for (std::size_t i = 0; i + 1 < map.values.size(); ++i)
    EXPECT_NEAR(inverse.disparity.disparity[i], z.disparity.disparity[i], 1e-6) << i;
}

TEST(PrepareDepth, WithoutACameraMillimetresMeanNothing) {
  EXPECT_THAT(ErrorOf([] {
                Prepared(MapOf(std::vector<float>(6, 500)), "d.pfm", KindAndUnit("z", "mm"),
                         GreyImage(), nullptr, nullptr);
              }),
              AllOf(StartsWith("depth.meaning.kind: "), HasSubstr("z needs a camera"),
                    HasSubstr("disparity")));
}

TEST(PrepareDepth, TheMapIsNamedWhereItIsWrong) {
  const model::Camera camera = MapCamera();
  const model::LightFieldGrid grid = model::DefaultGrid(camera, 3, 3);
  const model::RawDepthMap holes = MapOf(std::vector<float>(6, kHole));
  for (const model::Camera* used : {static_cast<const model::Camera*>(nullptr), &camera}) {
    const auto message = [&](const model::RawDepthMap& map, int width_px) {
      return ErrorOf([&] {
        Prepared(map, "d.pfm", KindAndUnit("disparity", ""), GreyImage(width_px), used, &grid);
      });
    };
    EXPECT_THAT(message(holes, kMapWidth), AllOf(StartsWith("d.pfm: "), HasSubstr("hole")));
    EXPECT_THAT(message(MapOf(std::vector<float>(6, 0)), 7),
                AllOf(StartsWith("d.pfm: "), HasSubstr("3x2"), HasSubstr("7x2")));
  }
}

// The UV plane is in the scene, so nearer points have no disparity.
TEST(PrepareDepth, DepthsNearerThanTheUvPlaneAreRefused) {
  const model::Camera camera = MapCamera();
  const model::LightFieldGrid grid = model::GridOnPlanes(camera, {100, 1000}, 3, 3);
  EXPECT_THAT(ErrorOf([&] {
                Prepared(MapOf({500, 500, 500, 500, 500, 90}), "d.pfm", KindAndUnit("z", "mm"),
                         GreyImage(), &camera, &grid);
              }),
              StartsWith("d.pfm: "));
}

TEST(PrepareDepth, WithACameraADepthBecomesItsDisparity) {
  const model::Camera camera = MapCamera();
  const model::LightFieldGrid grid = model::DefaultGrid(camera, 3, 3);
  const std::vector<float> depth_mm = {400, 800, 1200, 400, 0, 5000};
  const PreparedDepth prepared =
      Prepared(MapOf(depth_mm), "d.pfm", KindAndUnit("z", "mm"), GreyImage(), &camera, &grid);
  EXPECT_EQ(prepared.holes, 1U);
  ASSERT_TRUE(prepared.depth);
  EXPECT_EQ(prepared.depth->min_mm, 400);
  EXPECT_EQ(prepared.depth->max_mm, 5000);
  for (std::size_t i = 0; i < depth_mm.size(); ++i) {
    if (depth_mm[i] == 0) continue;
    const double expected_px = model::DisparityPx(camera, grid.u_step_mm, depth_mm[i]);
    EXPECT_NEAR(prepared.disparity.disparity[i] * prepared.disparity.step.x(), expected_px,
                1e-5 * std::abs(expected_px) + 1e-5);
  }
}

// A disparity per step of the grid's own views is converted to depth and back without a change,
// also if u has one view.
TEST(PrepareDepth, WithACameraADisparityIsPerViewStepOfItsGrid) {
  const model::Camera camera = MapCamera();
  const std::vector<float> disparity_px = {-0.5F, 0, 0.5F, 0.25F, 0.125F, -0.25F};
  for (const auto& [u_count, v_count] : {std::pair{3, 3}, std::pair{1, 5}}) {
    const model::LightFieldGrid grid = model::DefaultGrid(camera, u_count, v_count);
    const PreparedDepth prepared = Prepared(
        MapOf(disparity_px), "d.pfm", KindAndUnit("disparity", ""), GreyImage(), &camera, &grid);
    const Eigen::Vector2d step = prepared.disparity.step;
    for (std::size_t i = 0; i < disparity_px.size(); ++i) {
      const double found_px = prepared.disparity.disparity[i] * (u_count > 1 ? step.x() : step.y());
      EXPECT_NEAR(found_px, disparity_px[i], 1e-5);
    }
  }
}

// UV off the aperture: the views' step on the aperture is not du.
TEST(PrepareDepth, TheStepOfADisparityIsTakenOnTheAperture) {
  const model::Camera camera = MapCamera();
  const double st_depth_mm = camera.focus_depth_mm();
  const model::LightFieldGrid grid = model::GridOnPlanes(camera, {-800, st_depth_mm + 800}, 3, 3);
  const double aperture_step_mm = grid.u_step_mm * st_depth_mm / (st_depth_mm + 800);  // [S10]
  const double depth_mm = 700;
  const auto disparity_px =
      static_cast<float>(model::DisparityPx(camera, aperture_step_mm, depth_mm));
  const PreparedDepth prepared =
      Prepared(MapOf(std::vector<float>(6, disparity_px)), "d.pfm", KindAndUnit("disparity", ""),
               GreyImage(), &camera, &grid);
  EXPECT_NEAR(prepared.disparity.disparity[0] * prepared.disparity.step.x(),
              -model::SlopeOnGrid(grid, depth_mm), 1e-4);
}

}  // namespace
}  // namespace thicklens

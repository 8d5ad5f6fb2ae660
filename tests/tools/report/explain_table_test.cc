#include "tools/report/explain_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/special_numbers.h"

namespace thicklens::tools {
namespace {

using ::testing::HasSubstr;

using thicklens::testing::kInfinity;

// f1 = 50, f2 = 52, rho = 4 focused at 1000 mm: d1 = 4 + 52 * 1000/950.
model::Camera ExplainedCamera() {
  model::Camera camera;
  camera.name = "thick";
  camera.lens = {50, 52, 4, 10};
  camera.sensor.width_px = 601;
  camera.sensor.height_px = 801;
  camera.sensor.pixel_pitch_mm = 0.005;
  camera.sensor.principal_point_px = {300, 400};
  camera.calibration.emplace();
  camera.calibration->image_distance_mm = model::Estimate{4 + 52 * 1000 / 950.0, 0.001};
  camera.calibration->blur_ratio = model::Estimate{0.45, 0.009};
  camera.calibration->blur_floor_px = model::Estimate{0.5, 0};
  return camera;
}

TEST(ExplanationText, SaysWhereTheThinLensHasNoPlaneOfFocus) {
  model::Camera camera = ExplainedCamera();
  camera.lens = {50, 50, -4, 10};  // d1 of infinity is 46, less than f1
  camera.calibration->image_distance_mm->value = 46.5;
  const model::Explanation known = model::ExplainCamera(camera, {500, 2000}, 2);
  EXPECT_THAT(ExplanationText(known), HasSubstr("nowhere"));
  EXPECT_TRUE(ExplanationJson(known)["thin_counterpart"]["focus_depth_mm"].is_null());
}

TEST(ExplanationText, SaysUpToWhichDepthThinIsAsGoodAsThick) {
  model::Explanation known = model::ExplainCamera(ExplainedCamera(), {500, 2000}, 2);
  known.thin.alike_up_to_mm = 123.4;
  EXPECT_THAT(ExplanationText(known), HasSubstr("within 0.1 px of that of thick up to 123.4 mm"));
}

TEST(ExplanationText, NamesTheDepthOfFieldAndTheInFocusDistance) {
  const std::string near = ExplanationText(model::ExplainCamera(ExplainedCamera(), {500, 2000}, 2));
  EXPECT_THAT(near, HasSubstr("in-focus object distance zf  1000 mm\n"));
  EXPECT_THAT(near, HasSubstr("depth of field (blur radius up to 1.0 px): from "));
  model::Explanation known = model::ExplainCamera(ExplainedCamera(), {500, 2000}, 2);
  known.depth_of_field = {{0.5, 299.1, kInfinity}};
  EXPECT_THAT(ExplanationText(known),
              HasSubstr("depth of field (blur radius up to 0.5 px): from 299.1 mm to infinity\n"));
}

TEST(ExplanationText, HasAColumnOfTheThinLensOnlyWhereTheLensIsThick) {
  model::Camera camera = ExplainedCamera();
  EXPECT_THAT(ExplanationText(model::ExplainCamera(camera, {500, 2000}, 2)),
              HasSubstr("thin: radius"));
  camera.lens = {50, 50, 0, 10};
  EXPECT_THAT(ExplanationText(model::ExplainCamera(camera, {500, 2000}, 2)),
              ::testing::Not(HasSubstr("thin: radius")));
}

TEST(ExplanationText, ShowsErrorsOnlyWhereThereAreSome) {
  model::Camera camera = ExplainedCamera();
  EXPECT_THAT(ExplanationText(model::ExplainCamera(camera, {500, 2000}, 3)),
              HasSubstr("0.45 +- 0.009"));
  camera.calibration->blur_ratio->sigma = 0;
  camera.calibration->image_distance_mm->sigma = 0;
  EXPECT_THAT(ExplanationText(model::ExplainCamera(camera, {500, 2000}, 3)),
              ::testing::Not(HasSubstr("+-")));
}

TEST(ExplanationJson, HasNullForInfinity) {
  const auto json = ExplanationJson(model::ExplainCamera(ExplainedCamera(), {500, kInfinity}, 3));
  EXPECT_EQ(json["status"], "ok");
  EXPECT_EQ(json["depths"].size(), 3U);
  EXPECT_EQ(json["depths"][0]["depth_mm"], 500);
  EXPECT_TRUE(json["depths"][2]["depth_mm"].is_null());
  EXPECT_GT(json["depths"][2]["blur_radius_mm"], 0);
}

}  // namespace
}  // namespace thicklens::tools

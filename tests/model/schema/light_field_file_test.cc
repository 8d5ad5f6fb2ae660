#include "thicklens/model/light_field_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;
using ::thicklens::testing::ErrorOf;
using ::thicklens::testing::TemporaryFolder;

constexpr char kRelative[] =
    "schema: thicklens/light-field/1\n"
    "views: [3, 2]\n"
    "size: [640, 480]\n"
    "channels: 3\n"
    "view_format: png\n"
    "transfer: srgb\n"
    "disparity: px per view step, near positive\n"
    "weights:\n"
    "  - [0.125, 0.25, 0.125]\n"
    "  - [0.125, 0.25, 0.125]\n";
constexpr char kWithCamera[] =
    "camera: camera.yaml\n"
    "planes: {uv_depth_mm: 0, plane_spacing_mm: 1500}\n"
    "steps: {s_step_mm: 0.5, t_step_mm: 0.25, u_step_mm: 1.5, v_step_mm: 2}\n"
    "st_origin_index: [319.5, 239.25]\n";

std::string Replaced(std::string text, const std::string& what, const std::string& by) {
  const std::size_t place = text.find(what);
  if (place == std::string::npos) throw std::logic_error("not in the text: " + what);
  return text.replace(place, what.size(), by);
}

std::string ErrorOfText(const std::string& text) {
  return ErrorOf([&] { ParseLightFieldDescription(text, "l.yaml"); });
}

std::string ErrorWith(const std::string& what, const std::string& by) {
  return ErrorOfText(Replaced(std::string(kRelative) + kWithCamera, what, by));
}

std::string ErrorWithMore(const std::string& more) {
  return ErrorOfText(std::string(kRelative) + more);
}

bool SameBits(double a, double b) { return std::memcmp(&a, &b, sizeof a) == 0; }

TEST(LightFieldFile, ReadsWhatIsThere) {
  const LightFieldDescription relative = ParseLightFieldDescription(kRelative, "l.yaml");
  const LightField& light_field = relative.light_field;
  EXPECT_EQ(light_field.u_count, 3);
  EXPECT_EQ(light_field.v_count, 2);
  EXPECT_EQ(light_field.s_count, 640);
  EXPECT_EQ(light_field.t_count, 480);
  EXPECT_EQ(light_field.channels, 3);
  EXPECT_EQ(light_field.transfer, TransferCurve::Srgb());
  EXPECT_EQ(light_field.weights(1, 1), 0.25);
  EXPECT_EQ(light_field.weights(0, 2), 0.125);
  EXPECT_EQ(light_field.landing_step_px, Eigen::Vector2d(0, 0));
  EXPECT_FALSE(light_field.grid);
  EXPECT_THAT(light_field.values, IsEmpty());
  EXPECT_THAT(light_field.present, IsEmpty());
  EXPECT_EQ(relative.view_format, "png");
  EXPECT_FALSE(relative.has_confidence);
  EXPECT_THAT(relative.camera_file, IsEmpty());

  const LightFieldDescription described =
      ParseLightFieldDescription(std::string(kRelative) + kWithCamera, "l.yaml");
  EXPECT_EQ(described.camera_file, "camera.yaml");
  ASSERT_TRUE(described.light_field.grid);
  const LightFieldGrid& grid = *described.light_field.grid;
  EXPECT_EQ(grid.planes.plane_spacing_mm, 1500);
  EXPECT_EQ(grid.s_step_mm, 0.5);
  EXPECT_EQ(grid.t_step_mm, 0.25);
  EXPECT_EQ(grid.u_step_mm, 1.5);
  EXPECT_EQ(grid.v_step_mm, 2);
  EXPECT_EQ(grid.st_origin_index, Eigen::Vector2d(319.5, 239.25));
  EXPECT_EQ(grid.u_count, 3);
  EXPECT_EQ(grid.v_count, 2);
  EXPECT_EQ(grid.s_count, 640);
  EXPECT_EQ(grid.t_count, 480);
}

TEST(LightFieldFile, AScene) {
  std::string text = Replaced(kRelative, "light-field/1", "light-field/2");
  text = Replaced(text, "view_format: png\n",
                  "scene: {radiance: scene/radiance.tiff, radiance_bits: 16, disparity: "
                  "scene/disparity.tiff, disparity_step: [0.5, 2]}\n");
  const LightFieldDescription scene = ParseLightFieldDescription(text, "l.yaml");
  EXPECT_THAT(scene.view_format, IsEmpty());
  EXPECT_FALSE(scene.has_confidence);
  ASSERT_TRUE(scene.scene);
  EXPECT_EQ(scene.scene->radiance_bits, 16);
  EXPECT_EQ(scene.scene->disparity_step, Eigen::Vector2d(0.5, 2));
  EXPECT_FALSE(scene.scene->has_colour_profile);
  const std::string written = LightFieldDescriptionToYaml(scene);
  const LightFieldDescription again = ParseLightFieldDescription(written, "again.yaml");
  EXPECT_EQ(again.scene->disparity_step, scene.scene->disparity_step);
  EXPECT_EQ(LightFieldDescriptionToYaml(again), written);
  EXPECT_THAT(ErrorOfText(Replaced(text, "radiance_bits: 16, ", "")),
              HasSubstr("'radiance_bits' is missing"));
  EXPECT_THAT(ErrorOfText(Replaced(text, "scene/radiance.tiff", "/etc/passwd")),
              HasSubstr("scene.radiance"));
  EXPECT_THAT(ErrorOfText(text + "missing_views: [[0, 0]]\n"), HasSubstr("missing_views"));
}

TEST(LightFieldFile, KnowsMissingViews) {
  const auto present = ParseLightFieldDescription(
                           std::string(kRelative) + "missing_views: [[2, 0], [0, 1]]\n", "l.yaml")
                           .light_field.present;
  EXPECT_THAT(present, ElementsAre(true, true, false, false, true, true));
}

TEST(LightFieldFile, EveryErrorNamesItsPlace) {
  EXPECT_THAT(ErrorWithMore("confidence_format: tiff\n"), HasSubstr("png"));
  EXPECT_THAT(ErrorWith("view_format", "view_fromat"),
              AllOf(StartsWith("l.yaml:5:1"), HasSubstr("did you mean 'view_format'")));
  EXPECT_THAT(ErrorWith("light-field/1", "light-field/3"), StartsWith("l.yaml:1:9"));
  EXPECT_THAT(ErrorWith("light-field/1", "light-field/2"),
              AllOf(StartsWith("l.yaml:5:1"), HasSubstr("view_format")));
  EXPECT_THAT(ErrorWith("[3, 2]", "[3]"), AllOf(StartsWith("l.yaml:2:"), HasSubstr("views")));
  EXPECT_THAT(ErrorWith("[3, 2]", "[3, 0]"), HasSubstr("views[1]"));
  EXPECT_THAT(ErrorWith("[3, 2]", "[4, 2]"),
              AllOf(StartsWith("l.yaml:9:"), HasSubstr("a list of 4"), HasSubstr("weights[0]")));
  EXPECT_THAT(ErrorWith("[3, 2]", "[3, 3]"), AllOf(HasSubstr("weights"), HasSubstr("a list of 3")));
  EXPECT_THAT(ErrorWith("[640, 480]", "[640, 480.5]"), HasSubstr("size[1]"));
  EXPECT_THAT(ErrorWith("channels: 3", "channels: 2"), HasSubstr("l.yaml:4:11: channels"));
  EXPECT_THAT(ErrorWith("channels: 3", "channels: 4"), HasSubstr("l.yaml:4:11: channels"));
  EXPECT_THAT(ErrorWith("format: png", "format: jpg"), HasSubstr("png, tiff"));
  EXPECT_THAT(ErrorWith("srgb", "bt709"), AllOf(StartsWith("l.yaml:6:"), HasSubstr("transfer")));
  EXPECT_THAT(ErrorWith("near positive", "far positive"),
              AllOf(StartsWith("l.yaml:7:"), HasSubstr("near positive")));
  EXPECT_THAT(ErrorWith("disparity: px per view step, near positive\n", ""),
              HasSubstr("'disparity' is missing"));
  EXPECT_THAT(ErrorWith("0.25", "0.5"), AllOf(StartsWith("l.yaml:9:"), HasSubstr("found 1.25")));
  EXPECT_THAT(ErrorWith("0.25", "-0.25"), HasSubstr("weights[0][1]"));
  EXPECT_THAT(ErrorWith("0.25", "nan"), HasSubstr("weights[0][1]"));
  EXPECT_THAT(ErrorWith("plane_spacing_mm", "plane_spacing_um"), HasSubstr("wrong unit"));
  EXPECT_THAT(ErrorWith("1500", "0"), HasSubstr("plane_spacing_mm"));
  EXPECT_THAT(ErrorWith("s_step_mm: 0.5", "s_step_mm: 0"),
              HasSubstr("steps.s_step_mm: must be > 0"));
  EXPECT_THAT(ErrorWith("[319.5, 239.25]", "[319.5]"), HasSubstr("st_origin_index"));
}

TEST(LightFieldFile, ACameraAndItsGridGoTogether) {
  EXPECT_THAT(ErrorWith("camera: camera.yaml\n", ""),
              AllOf(HasSubstr("planes"), HasSubstr("'camera' is missing")));
  EXPECT_THAT(ErrorWithMore("camera: camera.yaml\n"), HasSubstr("'planes' is missing"));
  EXPECT_THAT(ErrorWithMore("st_origin_index: [1, 2]\n"), HasSubstr("'camera' is missing"));
}

TEST(LightFieldFile, MissingViewsAreChecked) {
  EXPECT_THAT(ErrorWithMore("missing_views: [[3, 0]]\n"), HasSubstr("missing_views[0][0]"));
  EXPECT_THAT(ErrorWithMore("missing_views: [[0, 2]]\n"), HasSubstr("missing_views[0][1]"));
  EXPECT_THAT(ErrorWithMore("missing_views: [[0, 1], [0, 1]]\n"), HasSubstr("twice"));
  EXPECT_THAT(ErrorWithMore("missing_views: [[0,0],[1,0],[2,0],[0,1],[1,1],[2,1]]\n"),
              HasSubstr("all views are missing"));
}

TEST(LightFieldFile, TheOriginIsChecked) {
  EXPECT_THAT(ErrorWithMore("origin: {metod: blocks}\n"), HasSubstr("did you mean 'method'"));
  EXPECT_THAT(ErrorWithMore("origin: {gamma: -1}\n"), HasSubstr("origin.gamma: must be >= 0"));
  EXPECT_THAT(ErrorWithMore("origin: {block_px: 0}\n"), HasSubstr("origin.block_px"));
  EXPECT_THAT(ErrorWithMore("origin: {seconds: inf}\n"), HasSubstr("origin.seconds"));
  EXPECT_THAT(ErrorWithMore("origin: {strength: -1}\n"), HasSubstr("origin.strength"));
  EXPECT_THAT(ErrorWithMore("origin: {iterations: 1.5}\n"), HasSubstr("origin.iterations"));
  EXPECT_THAT(ErrorWithMore("origin: {effects: defocus}\n"), HasSubstr("a list"));
}

// Numbers without a short decimal form, and every field set to something of its own.
LightFieldDescription Everything() {
  LightFieldDescription description;
  LightField& light_field = description.light_field;
  light_field.s_count = 31;
  light_field.t_count = 17;
  light_field.u_count = 3;
  light_field.v_count = 2;
  light_field.channels = 1;
  light_field.weights = ApertureWeights(ApertureShape::kGaussian, 3, 2);
  light_field.present = {true, false, true, true, true, false};
  light_field.landing_step_px = {-1.0 / 3, 5e-324};
  light_field.transfer = TransferCurve::Gamma(2.2);
  LightFieldGrid grid;
  grid.s_count = 31;
  grid.t_count = 17;
  grid.u_count = 3;
  grid.v_count = 2;
  grid.planes = {0.1, 1000.0 / 3};
  grid.s_step_mm = 1.0 / 7;
  grid.t_step_mm = 2.0 / 7;
  grid.u_step_mm = -3.0 / 7;
  grid.v_step_mm = 0;
  grid.st_origin_index = {-0.0, 8.0 / 9};
  light_field.grid = grid;
  light_field.origin = {"blocks",     "umfpack",
                        "warp",       "bilinear",
                        "opencl:0:0", 16,
                        1.1,          1e-2 / 6,
                        12.0 / 7,     1e-13,
                        1.0 / 3e5,    {"defocus", "falloff"},
                        "0.2.0",      "2024-01-02T03:04:05Z",
                        "tv",         1.7e-3 / 7,
                        1.0 / 255,    57};
  description.view_format = "tiff";
  description.has_confidence = true;
  description.camera_file = "a camera: #1.yaml";
  return description;
}

TEST(LightFieldFile, RoundTripKeepsEveryBit) {
  const LightFieldDescription before = Everything();
  const LightFieldDescription after =
      ParseLightFieldDescription(LightFieldDescriptionToYaml(before), "l.yaml");
  const LightField& a = before.light_field;
  const LightField& b = after.light_field;
  EXPECT_EQ(b.s_count, a.s_count);
  EXPECT_EQ(b.t_count, a.t_count);
  EXPECT_EQ(b.u_count, a.u_count);
  EXPECT_EQ(b.v_count, a.v_count);
  EXPECT_EQ(b.channels, a.channels);
  ASSERT_EQ(b.weights.rows(), a.weights.rows());
  ASSERT_EQ(b.weights.cols(), a.weights.cols());
  for (Eigen::Index l = 0; l < a.weights.rows(); ++l) {
    for (Eigen::Index k = 0; k < a.weights.cols(); ++k)
      EXPECT_TRUE(SameBits(b.weights(l, k), a.weights(l, k)));
  }
  EXPECT_EQ(b.present, a.present);
  EXPECT_TRUE(SameBits(b.landing_step_px.x(), a.landing_step_px.x()));
  EXPECT_TRUE(SameBits(b.landing_step_px.y(), a.landing_step_px.y()));
  EXPECT_EQ(b.transfer, a.transfer);
  ASSERT_TRUE(b.grid);
  EXPECT_TRUE(SameBits(b.grid->planes.uv_depth_mm, a.grid->planes.uv_depth_mm));
  EXPECT_TRUE(SameBits(b.grid->planes.plane_spacing_mm, a.grid->planes.plane_spacing_mm));
  EXPECT_TRUE(SameBits(b.grid->s_step_mm, a.grid->s_step_mm));
  EXPECT_TRUE(SameBits(b.grid->t_step_mm, a.grid->t_step_mm));
  EXPECT_TRUE(SameBits(b.grid->u_step_mm, a.grid->u_step_mm));
  EXPECT_TRUE(SameBits(b.grid->v_step_mm, a.grid->v_step_mm));
  EXPECT_TRUE(SameBits(b.grid->st_origin_index.x(), a.grid->st_origin_index.x()));
  EXPECT_TRUE(SameBits(b.grid->st_origin_index.y(), a.grid->st_origin_index.y()));
  EXPECT_EQ(b.origin.method, "blocks");
  EXPECT_EQ(b.origin.block_solver, "umfpack");
  EXPECT_EQ(b.origin.stencil, "warp");
  EXPECT_EQ(b.origin.splat, "bilinear");
  EXPECT_EQ(b.origin.device, "opencl:0:0");
  EXPECT_EQ(b.origin.block_px, a.origin.block_px);
  EXPECT_EQ(b.origin.prior, "tv");
  EXPECT_TRUE(SameBits(b.origin.strength.value(), *a.origin.strength));
  EXPECT_TRUE(SameBits(b.origin.noise_sigma.value(), *a.origin.noise_sigma));
  EXPECT_EQ(b.origin.iterations, a.origin.iterations);
  EXPECT_EQ(b.origin.gamma, a.origin.gamma);
  EXPECT_EQ(b.origin.ridge, a.origin.ridge);
  EXPECT_EQ(b.origin.seconds, a.origin.seconds);
  EXPECT_EQ(b.origin.relative_residual, a.origin.relative_residual);
  EXPECT_EQ(b.origin.rcond_min, a.origin.rcond_min);
  EXPECT_EQ(b.origin.effects, a.origin.effects);
  EXPECT_EQ(b.origin.version, "0.2.0");
  EXPECT_EQ(b.origin.date, "2024-01-02T03:04:05Z");
  EXPECT_EQ(after.view_format, "tiff");
  EXPECT_TRUE(after.has_confidence);
  EXPECT_EQ(after.camera_file, "a camera: #1.yaml");
}

TEST(LightFieldFile, WhatIsNotKnownIsNotWritten) {
  LightFieldDescription description = Everything();
  description.light_field.grid.reset();
  description.light_field.present.clear();
  description.light_field.origin = {};
  description.camera_file.clear();
  const std::string yaml = LightFieldDescriptionToYaml(description);
  EXPECT_THAT(yaml, AllOf(Not(HasSubstr("camera")), Not(HasSubstr("planes")),
                          Not(HasSubstr("missing")), Not(HasSubstr("method"))));
  const LightFieldDescription after = ParseLightFieldDescription(yaml, "l.yaml");
  EXPECT_FALSE(after.light_field.grid);
  EXPECT_FALSE(after.light_field.origin.gamma);
}

TEST(LightFieldFile, ANumberThatCouldNotBeReadIsNotWritten) {
  LightFieldDescription description = Everything();
  description.light_field.origin.relative_residual = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(ErrorOf([&] { LightFieldDescriptionToYaml(description); }),
              AllOf(HasSubstr("relative_residual"), HasSubstr("nan")));
}

TEST(LightFieldFile, IsReadFromAFile) {
  const TemporaryFolder folder;
  const std::string path = folder.Put("lightfield.yaml", kRelative);
  EXPECT_EQ(ReadLightFieldDescription(path).light_field.s_count, 640);
  EXPECT_THAT(ErrorOf([&] { ReadLightFieldDescription(folder / "none.yaml"); }),
              HasSubstr("none.yaml"));
}

TEST(ViewFileStem, HasTheRowFirstAndTwoDigitsAtLeast) {
  EXPECT_EQ(ViewFileStem(3, 0), "view_00_03");
  EXPECT_EQ(ViewFileStem(12, 100), "view_100_12");
}

}  // namespace
}  // namespace thicklens::model

// thicklens estimate --solver functional and grid, as a person meets them.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "support/test_cameras.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/light_field.h"
#include "tools/support/child_process.h"
#include "tools/support/xml_elements.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using thicklens::testing::CentredSensor;
using thicklens::testing::ContentOf;
using thicklens::testing::TestCameraFocusedAt;
using thicklens::testing::WideLens;
using thicklens::testing::WithMethod;
using Arguments = std::vector<std::string>;

constexpr int kWidthPx = 60, kHeightPx = 44;

// Soft stripes, 1 grey level of noise.
model::EncodedImage Stripes() {
  model::EncodedImage image{kWidthPx, kHeightPx, 3, 8, {}};
  std::mt19937 engine(7);
  std::normal_distribution<double> noise(0, 1);
  for (int i = 0; i < kWidthPx * kHeightPx * 3; ++i) {
    const double value = 120 + 40 * std::sin(0.35 * (i / 3 % kWidthPx) + i % 3) +
                         30 * std::sin(0.3 * (i / 3 / kWidthPx));
    image.values.push_back(
        static_cast<std::uint16_t>(std::lround(std::clamp(value + noise(engine), 0.0, 255.0))));
  }
  return image;
}

// A large sensor behind a short lens: dark corners.
std::string WideCameraYaml() {
  return model::CameraToYaml(WithMethod(
      TestCameraFocusedAt(800, "wide", WideLens(), CentredSensor(kWidthPx, kHeightPx, 0.2))));
}

class EstimateFunctionalTest : public ::testing::TestWithParam<const char*>,
                               protected EstimateCommand {
 protected:
  std::string Depth(const std::function<double(int x)>& value) const {
    model::RawDepthMap map{kWidthPx, kHeightPx, {}, false};
    for (int i = 0; i < kWidthPx * kHeightPx; ++i)
      map.values.push_back(static_cast<float>(value(i % kWidthPx)));
    return folder_.Put("depth.pfm", io::EncodePfm(map));
  }
  std::string Image() const { return folder_.Put("picture.png", io::EncodePng(Stripes())); }
  Arguments Usual() const {
    return {Image(),        Depth([](int x) { return 0.02 * x - 0.5; }),
            "--solver",     GetParam(),
            "--views",      "3x3",
            "--depth-kind", "disparity"};
  }
  model::LightField Estimated(const Arguments& arguments) const {
    Summary(With(arguments, {"--format", "tiff"}));
    return io::ReadLightField(Output(), {});
  }
};

TEST_P(EstimateFunctionalTest, SaysWhatItDid) {
  ProgramResult result;
  const json summary =
      Summary(With(Usual(), {"--threads", "2", "--gamma", "0.5", "--ridge", "0.002"}), &result);
  EXPECT_THAT(result.out, AllOf(HasSubstr("3 x 3 views of 60 x 44 px"),
                                HasSubstr(std::string(GetParam()) + ": gamma 0.5, ridge 0.002"),
                                HasSubstr("iterations"), Not(HasSubstr("not converged"))));
  EXPECT_EQ(summary["solver"], GetParam());
  EXPECT_EQ(summary["gamma"], 0.5);
  EXPECT_EQ(summary["ridge"], 0.002);
  EXPECT_EQ(summary["prior"], "ridge");
  EXPECT_EQ(summary["strength"], 0.002);
  EXPECT_EQ(summary["device"], "cpu");
  EXPECT_EQ(summary["threads"], 2);
  EXPECT_EQ(summary["channels"], 3);
  json effects = {"defocus", "aperture-shape"};
  if (GetParam() == std::string("grid")) effects.push_back("occlusion");
  EXPECT_EQ(summary["effects"], effects);
  EXPECT_EQ(summary["converged"], true);
  EXPECT_GT(summary["iterations"].get<int>(), 0);
  EXPECT_LE(summary["relative_residual"].get<double>(), 1e-3);
  EXPECT_GT(summary["predicted_memory_mib"].get<double>(), 1);
  for (const char* of_others : {"block_solver", "rcond_min", "noise_sigma", "row_share",
                                "occluded_fraction", "residual_rms"}) {
    EXPECT_TRUE(summary.at(of_others).is_null()) << of_others;
  }
  EXPECT_THAT(summary["warnings"], IsEmpty());

  const model::LightFieldOrigin origin = io::ReadLightField(Output(), {}).origin;
  EXPECT_EQ(origin.method, GetParam());
  EXPECT_EQ(origin.gamma, 0.5);
  EXPECT_EQ(origin.ridge, 0.002);
  EXPECT_EQ(origin.iterations.value(), summary["iterations"].get<int>());
  EXPECT_GT(origin.seconds.value(), 0);
}

TEST_P(EstimateFunctionalTest, TakesItsSettings) {
  const Arguments exact = {"--tolerance", "1e-11"};
  EXPECT_EQ(Summary(With(With(Usual(), exact), {"--double"}))["converged"], true);
  ProgramResult result;
  json summary = Summary(With(Usual(), exact), &result);  // more than 32 bit can do
  EXPECT_EQ(summary["converged"], false);
  EXPECT_THAT(summary["warnings"].dump(),
              AllOf(HasSubstr("not converged"), HasSubstr("--max-iterations")));
  EXPECT_THAT(result.out, HasSubstr("not converged"));
  summary = Summary(With(Usual(), {"--max-iterations", "3"}));
  EXPECT_EQ(summary["iterations"], 3);
  EXPECT_EQ(summary["converged"], false);
  EXPECT_EQ(summary["gamma"], 1);
  EXPECT_DOUBLE_EQ(summary["ridge"].get<double>(), 0.01 / 9);
}

TEST_P(EstimateFunctionalTest, TheFallOffCanBeLeftOut) {
  const Arguments with_camera = {Image(),        Depth([](int x) { return 790.0 + x; }),
                                 "--solver",     GetParam(),
                                 "--views",      "3x3",
                                 "--depth-kind", "z",
                                 "--depth-unit", "mm",
                                 "--camera",     folder_.Put("camera.yaml", WideCameraYaml())};
  const bool is_grid = GetParam() == std::string("grid");
  const model::LightField with =
      Estimated(With(with_camera, {"--effects", is_grid ? "thickness,defocus,falloff,occlusion"
                                                        : "thickness,defocus,falloff"}));
  const model::LightField without = Estimated(With(with_camera, {"--without", "falloff"}));
  EXPECT_EQ(fmt::format("{}", fmt::join(without.origin.effects, ", ")),
            is_grid ? "defocus, occlusion" : "defocus");
  EXPECT_EQ(fmt::format("{}", fmt::join(with.origin.effects, ", ")),
            is_grid ? "thickness, defocus, falloff, occlusion" : "thickness, defocus, falloff");
  const model::LinearImage bright = model::ViewImage(with, 1, 1);
  const model::LinearImage dark = model::ViewImage(without, 1, 1);
  EXPECT_GT(bright.at(2, 2, 0), 1.2F * dark.at(2, 2, 0));
  EXPECT_NEAR(bright.at(kWidthPx / 2, kHeightPx / 2, 0), dark.at(kWidthPx / 2, kHeightPx / 2, 0),
              0.01);
  // The stripes do not show it, so that nothing is divided out without a statement.
  const json tested = Summary(with_camera);
  EXPECT_NE(tested["falloff"]["verdict"], "shown");
  EXPECT_GT(tested["falloff"]["sigma"], 0.2);
  EXPECT_THAT(tested["effects"].dump(), Not(HasSubstr("falloff")));
  EXPECT_TRUE(Summary(With(with_camera, {"--without", "falloff"}))["falloff"].is_null());
}

TEST_P(EstimateFunctionalTest, TheReportHasNoMaps) {
  Summary(With(Usual(), {"--report", folder_ / "page"}));
  const std::string html = ContentOf(folder_ / "page/index.html");
  EXPECT_EQ(ParseXml(html).error, "");
  EXPECT_THAT(
      html,
      AllOf(HasSubstr("Mosaic of the views"), HasSubstr("ridge mu"), HasSubstr("smoothness gamma"),
            HasSubstr("iterations"), HasSubstr(std::string("by the solver ") + GetParam()),
            Not(HasSubstr("Residual of the photograph")), Not(HasSubstr("strength of the prior"))));
}

TEST_P(EstimateFunctionalTest, OptionsOfOthersAreAUsageError) {
  for (const Arguments& of_blocks : std::vector<Arguments>{{"--block-solver", "eigen"},
                                                           {"--block-px", "16"},
                                                           {"--stencil", "warp"},
                                                           {"--splat", "bilinear"}}) {
    EXPECT_THAT(
        Refusal(With(Usual(), of_blocks), 2),
        HasSubstr(of_blocks.front() + " requires --solver blocks, the solver is " + GetParam()));
  }
  for (const Arguments& of_scene :
       std::vector<Arguments>{{"--prior", "tv"}, {"--strength", "auto"}}) {
    EXPECT_THAT(
        Refusal(With(Usual(), of_scene), 2),
        HasSubstr(of_scene.front() + " requires --solver scene, the solver is " + GetParam()));
  }
  EXPECT_THAT(Refusal(With(Usual(), {"--device", "opencl:0"}), 2),
              AllOf(HasSubstr("opencl:0"), HasSubstr(GetParam())));
}

TEST_P(EstimateFunctionalTest, SettingsThatCannotBe) {
  EXPECT_THAT(Refusal(With(Usual(), {"--gamma", "0"}), 2),
              HasSubstr("--gamma: a finite number > 0 is expected, found 0"));
  EXPECT_THAT(Refusal(With(Usual(), {"--ridge", "0"}), 2),
              HasSubstr("--ridge: a finite number > 0 is expected, found 0"));
  EXPECT_THAT(Refusal(With(Usual(), {"--tolerance", "1"}), 2),
              HasSubstr("--tolerance: must be above 0 and below 1"));
  EXPECT_THAT(Refusal(With(Usual(), {"--memory-limit", "5"}), 1),
              AllOf(HasSubstr("memory limit 5 MiB"), HasSubstr("at least")));
}

TEST_P(EstimateFunctionalTest, ThreadsDoNotChangeTheViews) {
  EXPECT_EQ(Estimated(With(Usual(), {"--threads", "1"})).values,
            Estimated(With(Usual(), {"--threads", "3"})).values);
}

INSTANTIATE_TEST_SUITE_P(Both, EstimateFunctionalTest, ::testing::Values("functional", "grid"),
                         [](const auto& one) { return std::string(one.param); });

}  // namespace
}  // namespace thicklens::tools

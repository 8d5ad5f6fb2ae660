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
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;
using Arguments = std::vector<std::string>;

constexpr int kWidthPx = 60, kHeightPx = 44;

// Soft stripes, 1 grey level of noise.
model::StoredPicture Stripes() {
  model::StoredPicture picture{kWidthPx, kHeightPx, 3, 8, {}};
  std::mt19937 engine(7);
  std::normal_distribution<double> noise(0, 1);
  for (int i = 0; i < kWidthPx * kHeightPx * 3; ++i) {
    const double value = 120 + 40 * std::sin(0.35 * (i / 3 % kWidthPx) + i % 3) +
                         30 * std::sin(0.3 * (i / 3 / kWidthPx));
    picture.values.push_back(
        static_cast<std::uint16_t>(std::lround(std::clamp(value + noise(engine), 0.0, 255.0))));
  }
  return picture;
}

// A large sensor behind a short lens: dark corners.
std::string WideCameraYaml() {
  model::Camera camera;
  camera.name = "wide";
  camera.lens = {12.5, 12.8, 3, 4.46};
  camera.sensor = {kWidthPx,
                   kHeightPx,
                   0.2,
                   {(kWidthPx - 1) / 2.0, (kHeightPx - 1) / 2.0},
                   model::TransferCurve::Srgb()};
  camera.calibration = model::CameraCalibration{};
  camera.calibration->image_distance_mm =
      model::Estimate{model::ImageDistanceMm(camera.lens, 800), 0};
  camera.calibration->blur_ratio = model::Estimate{0.45, 0};
  camera.calibration->evidence.method = "assumed";
  return model::CameraToYaml(camera);
}

class EstimateFunctionalTest : public ::testing::TestWithParam<const char*> {
 protected:
  std::string Depth(const std::function<double(int x)>& value) const {
    model::RawDepthMap map{kWidthPx, kHeightPx, {}, false};
    for (int i = 0; i < kWidthPx * kHeightPx; ++i)
      map.values.push_back(static_cast<float>(value(i % kWidthPx)));
    return folder_.Put("depth.pfm", io::EncodePfm(map));
  }
  std::string Picture() const { return folder_.Put("picture.png", io::EncodePng(Stripes())); }
  std::string Output() const { return folder_ / "lf"; }
  Arguments Usual() const {
    return {Picture(),      Depth([](int x) { return 0.02 * x - 0.5; }),
            "--solver",     GetParam(),
            "--views",      "3x3",
            "--depth-kind", "disparity"};
  }
  static Arguments With(Arguments arguments, const Arguments& more) {
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
  ProgramResult Run(Arguments arguments) const {
    arguments.insert(arguments.begin(), "estimate");
    arguments.insert(arguments.end(), {"-o", Output()});
    return ChildProgram(arguments, scratch_.path(), 0).Wait();
  }
  json Summary(const Arguments& arguments, ProgramResult* result = nullptr) const {
    const std::string path = folder_ / "summary.json";
    const ProgramResult ended = Run(With(arguments, {"--json", path}));
    EXPECT_EQ(ended.exit_code, 0) << ended.err;
    if (result != nullptr) *result = ended;
    return json::parse(ContentOf(path));
  }
  std::string Refusal(const Arguments& arguments, int exit_code) const {
    const ProgramResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, exit_code) << result.err;
    EXPECT_FALSE(fs::exists(Output()));
    return result.err;
  }
  model::LightField Estimated(const Arguments& arguments) const {
    Summary(With(arguments, {"--format", "tiff"}));
    return io::ReadLightField(Output(), {});
  }

  TemporaryFolder folder_;
  TemporaryFolder scratch_;
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
  for (const char* of_others :
       {"block_solver", "rcond_min", "noise_sigma", "row_share", "hidden_share", "residual_rms"}) {
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
  const Arguments with_camera = {Picture(),      Depth([](int x) { return 790.0 + x; }),
                                 "--solver",     GetParam(),
                                 "--views",      "3x3",
                                 "--depth-kind", "z",
                                 "--depth-unit", "mm",
                                 "--camera",     folder_.Put("camera.yaml", WideCameraYaml())};
  const model::LightField with = Estimated(with_camera);
  const model::LightField without = Estimated(With(with_camera, {"--without", "falloff"}));
  const bool is_grid = GetParam() == std::string("grid");
  EXPECT_EQ(fmt::format("{}", fmt::join(without.origin.effects, ", ")),
            is_grid ? "defocus, occlusion" : "defocus");
  EXPECT_EQ(fmt::format("{}", fmt::join(with.origin.effects, ", ")),
            is_grid ? "thickness, defocus, falloff, occlusion" : "thickness, defocus, falloff");
  const model::LinearPicture bright = model::ViewPicture(with, 1, 1);
  const model::LinearPicture dark = model::ViewPicture(without, 1, 1);
  EXPECT_GT(bright.at(2, 2, 0), 1.2F * dark.at(2, 2, 0));
  EXPECT_NEAR(bright.at(kWidthPx / 2, kHeightPx / 2, 0), dark.at(kWidthPx / 2, kHeightPx / 2, 0),
              0.01);
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
        HasSubstr(of_blocks.front() + " is of --solver blocks, the solver is " + GetParam()));
  }
  for (const Arguments& of_scene :
       std::vector<Arguments>{{"--prior", "tv"}, {"--strength", "auto"}}) {
    EXPECT_THAT(Refusal(With(Usual(), of_scene), 2),
                HasSubstr(of_scene.front() + " is of --solver scene, the solver is " + GetParam()));
  }
  EXPECT_THAT(Refusal(With(Usual(), {"--device", "opencl:0"}), 2),
              AllOf(HasSubstr("opencl:0"), HasSubstr(GetParam())));
}

TEST_P(EstimateFunctionalTest, SettingsThatCannotBe) {
  EXPECT_THAT(Refusal(With(Usual(), {"--gamma", "0"}), 1), HasSubstr("gamma is 0"));
  EXPECT_THAT(Refusal(With(Usual(), {"--ridge", "0"}), 1), HasSubstr("ridge is 0"));
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

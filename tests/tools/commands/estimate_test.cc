// thicklens estimate as a person meets it, by blocks, alone and in the protocol with a known light
// field. The solver of the whole scene: estimate_scene_test.cc.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "support/sanitizers.h"
#include "support/temporary_folder.h"
#include "support/test_cameras.h"
#include "thicklens/base/output_file.h"
#include "thicklens/estimator/block_solver.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/light_field.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;
using Arguments = std::vector<std::string>;

constexpr int kWidth = 36;
constexpr int kHeight = 28;

model::EncodedImage RandomImage(int channels, int bits) {
  model::EncodedImage image{kWidth, kHeight, channels, bits, {}};
  std::mt19937 engine(7);
  std::uniform_int_distribution<int> any(0, bits == 8 ? 255 : 65535);
  for (int i = 0; i < kWidth * kHeight * channels; ++i) {
    image.values.push_back(static_cast<std::uint16_t>(any(engine)));
  }
  return image;
}

model::RawDepthMap MapOf(const std::function<double(int x, int y)>& value) {
  model::RawDepthMap map{kWidth, kHeight, {}, false};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) map.values.push_back(static_cast<float>(value(x, y)));
  }
  return map;
}

std::string CameraYaml(int width_px, int height_px) {
  return model::CameraToYaml(thicklens::testing::PhotographCamera(width_px, height_px));
}

class EstimateTest : public ::testing::Test {
 protected:
  std::string Image(int channels = 3, int bits = 8) const {
    return folder_.Put("picture.png", io::EncodePng(RandomImage(channels, bits)));
  }
  std::string Depth(const std::function<double(int x, int y)>& value) const {
    return folder_.Put("depth.pfm", io::EncodePfm(MapOf(value)));
  }
  std::string Disparity() const {
    return Depth([](int x, int) { return 0.05 * x - 0.8; });
  }
  std::string Camera() const { return folder_.Put("camera.yaml", CameraYaml(kWidth, kHeight)); }
  std::string Output() const { return folder_ / "lf"; }

  ProgramResult Run(Arguments arguments) const {
    arguments.insert(arguments.begin(), "estimate");
    arguments.insert(arguments.end(), {"--solver", "blocks", "-o", Output()});
    return ChildProgram(arguments, scratch_.path(), 0).Wait();
  }
  model::LightField Estimated(Arguments arguments) const {
    arguments.insert(arguments.end(), {"--format", "tiff"});
    const ProgramResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return io::ReadLightField(Output(), {});
  }
  // Returns the one line of a refusal. No file may be left in the place of the light field.
  std::string Refusal(const Arguments& arguments, int exit_code = 1) const {
    const ProgramResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, exit_code) << result.err;
    EXPECT_FALSE(fs::exists(Output()));
    for (const auto& entry : fs::directory_iterator(folder_.path())) {
      EXPECT_THAT(entry.path().filename().string(), ::testing::Not(HasSubstr(".part")));
    }
    int errors = 0;
    std::string message;
    std::istringstream lines(result.err);
    for (std::string line; std::getline(lines, line);) {
      EXPECT_THAT(line, StartsWith("thicklens: "));
      if (line.find("thicklens: error: ") != 0) continue;
      ++errors;
      message = line;
    }
    EXPECT_EQ(errors, 1) << result.err;
    return message;
  }
  static Arguments AsDisparity(const std::string& image, const std::string& depth) {
    return {image, depth, "--depth-kind", "disparity", "--views", "3x3", "--device", "cpu"};
  }
  static Arguments With(Arguments arguments, const Arguments& more) {
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }

  TemporaryFolder folder_;
  TemporaryFolder scratch_;
};

TEST_F(EstimateTest, WritesALightFieldThatSaysHowItWasMade) {
  const std::string json = folder_ / "estimate.json";
  const ProgramResult result =
      Run(With(AsDisparity(Image(), Disparity()), {"--json", json, "--threads", "2"}));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, AllOf(HasSubstr("3 x 3 views of 36 x 28 px"), HasSubstr("6 blocks"),
                                ::testing::EndsWith("\nwrote " + Output() + "\n")));

  const nlohmann::json summary = nlohmann::json::parse(ContentOf(json));
  EXPECT_EQ(summary["status"], "ok");
  EXPECT_EQ(summary["solver"], "blocks");
  EXPECT_EQ(summary["block_solver"], estimator::BlockSolverName(estimator::DefaultBlockSolver()));
  EXPECT_EQ(summary["views"], nlohmann::json({3, 3}));
  EXPECT_EQ(summary["size"], nlohmann::json({kWidth, kHeight}));
  EXPECT_EQ(summary["threads"], 2);
  EXPECT_EQ(summary["device"], "cpu");
  EXPECT_EQ(summary["block_px"], 16);
  EXPECT_EQ(summary["effects"], nlohmann::json({"defocus", "aperture-shape", "occlusion"}));
  EXPECT_EQ(summary["prior"], "ridge");
  EXPECT_EQ(summary["strength"], summary["ridge"]);
  for (const char* of_scene :
       {"noise_sigma", "iterations", "converged", "row_share", "occluded_fraction", "residual_rms"})
    EXPECT_TRUE(summary.at(of_scene).is_null()) << of_scene;
  EXPECT_GT(summary["peak_rss_mib"].get<double>(), 10);
  EXPECT_GT(summary["seconds"]["total"].get<double>(), 0);
  EXPECT_LT(summary["relative_residual"].get<double>(), 1e-12);
  EXPECT_GT(summary["rcond_min"].get<double>(), 1e-6);

  const model::LightField found = io::ReadLightField(Output(), {});
  EXPECT_EQ(found.u_count, 3);
  EXPECT_EQ(found.channels, 3);
  EXPECT_EQ(found.origin.method, "blocks");
  EXPECT_FALSE(found.camera.has_value());
  EXPECT_NEAR(found.weights(0, 0), 1.0 / 9, 1e-12);  // uniform where there is no camera
}

TEST_F(EstimateTest, DepthByItsUnitAndACamera) {
  const std::string image = Image();
  const auto plane = [](int x, int) { return 700.0 + 4 * x; };
  const Arguments camera = {"--camera", Camera(), "--views", "3x3", "--device", "cpu"};
  const model::LightField in_mm =
      Estimated(With({image, Depth(plane), "--depth-kind", "z", "--depth-unit", "mm"}, camera));
  const model::LightField in_m =
      Estimated(With({image, Depth([&](int x, int y) { return plane(x, y) / 1000; }),
                      "--depth-kind", "z", "--depth-unit", "m"},
                     camera));
  ASSERT_TRUE(in_mm.camera.has_value());
  EXPECT_EQ(in_mm.origin.effects, (std::vector<std::string>{"defocus", "falloff", "occlusion"}));
  EXPECT_GT(in_mm.weights(1, 1), in_mm.weights(0, 0));  // the camera's PSF is Gaussian
  double largest = 0;
  for (std::size_t i = 0; i < in_mm.values.size(); ++i) {
    largest = std::max(largest, static_cast<double>(std::abs(in_mm.values[i] - in_m.values[i])));
  }
  EXPECT_LT(largest, 1e-3);  // depths differ by the rounding of float
}

TEST_F(EstimateTest, ThePositionOfAMovingLensGivesTheImageDistance) {
  model::Camera moving = thicklens::testing::PhotographCamera(kWidth, kHeight);
  const double d1_mm = moving.image_distance_mm();
  moving.calibration->focus_positions =
      model::FocusPositions{"mm", {{0, d1_mm}, {2, 1.01 * d1_mm}}};
  const std::string camera = folder_.Put("moving.yaml", model::CameraToYaml(moving));
  const std::string depth = Depth([](int, int) { return 900; });
  const Arguments rest = {Image(),        depth, "--depth-kind", "z",
                          "--depth-unit", "mm",  "--views",      "3x3"};
  const Arguments with_camera = With(rest, {"--camera", camera});
  const model::LightField found = Estimated(With(with_camera, {"--lens-position", "1"}));
  EXPECT_NEAR(found.camera->image_distance_mm(), 1.005 * d1_mm, 1e-9 * d1_mm);
  fs::remove_all(Output());
  EXPECT_NEAR(Estimated(with_camera).camera->image_distance_mm(), d1_mm, 1e-9 * d1_mm);
  fs::remove_all(Output());
  EXPECT_THAT(Refusal(With(with_camera, {"--lens-position", "3"})),
              AllOf(HasSubstr("--lens-position"), HasSubstr("from 0 to 2 mm")));
  EXPECT_THAT(Refusal(With(With(rest, {"--camera", Camera()}), {"--lens-position", "1"}), 2),
              HasSubstr("focus_positions"));
  EXPECT_THAT(Refusal(With(rest, {"--lens-position", "1"}), 2), HasSubstr("--camera"));
}

// A flat that is twice as bright on the right makes the light half as bright there.
TEST_F(EstimateTest, ThePhotographIsCorrectedByAFlat) {
  const auto constant = [&](const std::string& name, int width, int left, int right) {
    model::EncodedImage image{width, kHeight, 3, 8, {}};
    for (int i = 0; i < width * kHeight * 3; ++i)
      image.values.push_back(static_cast<std::uint16_t>(i / 3 % width < width / 2 ? left : right));
    return folder_.Put(name, io::EncodePng(image));
  };
  const Arguments rest = {constant("photo.png", kWidth, 100, 100),
                          Depth([](int, int) { return 0; }),
                          "--depth-kind",
                          "disparity",
                          "--views",
                          "3x3",
                          "--transfer",
                          "linear"};
  const std::string flat = constant("flat.png", kWidth, 100, 200);
  const model::LightField found = Estimated(With(rest, {"--flat", flat}));
  const auto at = [&](int x) {
    return static_cast<double>(
        found.values[found.ViewStart(1, 1, 0) + static_cast<std::size_t>(5 * kWidth + x)]);
  };
  EXPECT_NEAR(at(4) / at(kWidth - 5), 2, 0.1);
  fs::remove_all(Output());
  EXPECT_THAT(Refusal(With(rest, {"--flat", constant("other.png", 20, 100, 100)})),
              AllOf(HasSubstr("other.png"), HasSubstr("20 x 28")));
  EXPECT_THAT(Refusal(With(rest, {"--orientation", "displayed", "--flat", flat}), 2),
              HasSubstr("describe the sensor as stored"));
}

TEST_F(EstimateTest, AnImageOfAPartOfTheSensor) {
  const std::string camera = folder_.Put("large.yaml", CameraYaml(kWidth + 20, kHeight + 8));
  const std::string depth = Depth([](int, int) { return 900; });
  const Arguments rest = {"--depth-kind", "z",    "--depth-unit", "mm",
                          "--camera",     camera, "--views",      "3x3"};
  EXPECT_THAT(Refusal(With({Image(), depth}, rest)),
              AllOf(HasSubstr("36x28"), HasSubstr("56x36"), HasSubstr("--sensor-origin")));
  const model::LightField found =
      Estimated(With(With({Image(), depth}, rest), {"--sensor-origin", "20,8"}));
  EXPECT_EQ(found.camera->sensor.width_px, kWidth);
  EXPECT_DOUBLE_EQ(found.camera->sensor.principal_point_px.x(), (kWidth + 19) / 2.0 - 20);
  fs::remove_all(Output());
  EXPECT_THAT(
      Refusal(With(With({Image(), depth}, rest), {"--sensor-origin", "21,8"})),
      AllOf(HasSubstr("--sensor-origin: "), HasSubstr("large.yaml: the rectangle 21,8,36,28"),
            HasSubstr("is not inside the sensor of 56x36 px"),
            HasSubstr("x must be from 0 to 20 and y from 0 to 8")));
  EXPECT_THAT(
      Refusal(With(AsDisparity(Image(), Disparity()), {"--crop", "30,0,10,10"})),
      AllOf(HasSubstr("--crop: "), HasSubstr("picture.png: the rectangle 30,0,10,10"),
            HasSubstr("is not inside the image of 36x28 px"), HasSubstr("x must be from 0 to 26")));
}

TEST_F(EstimateTest, GreyAndSixteenBits) {
  const model::LightField grey = Estimated(AsDisparity(Image(1, 8), Disparity()));
  EXPECT_EQ(grey.channels, 1);
  const model::LightField deep = Estimated(AsDisparity(Image(3, 16), Disparity()));
  EXPECT_EQ(deep.channels, 3);
}

TEST_F(EstimateTest, OneViewAcrossIsReportedAndOneViewInAllIsRefused) {
  const ProgramResult result =
      Run({Image(), Disparity(), "--depth-kind", "disparity", "--views", "1x3", "--device", "cpu"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("one view along u"));
  fs::remove_all(Output());
  EXPECT_THAT(Refusal({Image(), Disparity(), "--depth-kind", "disparity", "--views", "1x1"}, 2),
              HasSubstr("1x1 is not a light field"));
}

TEST_F(EstimateTest, BlocksLargerThanTheImageAndTheSourcesStencil) {
  const std::string json = folder_ / "estimate.json";
  const ProgramResult result =
      Run(With(AsDisparity(Image(), Disparity()), {"--block-px", "500", "--stencil", "paper",
                                                   "--block-solver", "eigen", "--json", json}));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json summary = nlohmann::json::parse(ContentOf(json));
  EXPECT_EQ(summary["block_px"], kWidth);
  EXPECT_EQ(summary["blocks"], 1);
  EXPECT_EQ(summary["stencil"], "source");
}

TEST_F(EstimateTest, DepthThatCannotBe) {
  const std::string image = Image();
  const auto as_z = [&](const std::string& depth, const std::string& unit) {
    return Arguments{image, depth,      "--depth-kind", "z",       "--depth-unit",
                     unit,  "--camera", Camera(),       "--views", "3x3"};
  };
  EXPECT_THAT(Refusal(as_z(Depth([](int, int) { return 0; }), "mm")),
              AllOf(HasSubstr("depth.pfm"), HasSubstr("values are holes")));
  EXPECT_THAT(Refusal(as_z(Depth([](int, int) { return 800; }), "m")),
              AllOf(HasSubstr("depth.pfm"), HasSubstr("check the unit")));
  EXPECT_THAT(Refusal(as_z(Depth([](int, int) { return 0.8; }), "mm")),
              AllOf(HasSubstr("depth.pfm"), HasSubstr("check the unit")));
  // The reasons that lie in the map, with their remedies.
  EXPECT_THAT(Refusal(as_z(Depth([](int, int) { return -800; }), "mm")),
              AllOf(HasSubstr("must not be negative"), HasSubstr("multiply the values by -1")));
  EXPECT_THAT(Refusal(as_z(Depth([](int x, int) { return x / (kWidth - 1.0); }), "mm")),
              AllOf(HasSubstr("check the unit"), HasSubstr("relative map"),
                    HasSubstr("--depth-kind inverse with --depth-near and --depth-far")));
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(Refusal(AsDisparity(image, Depth([](int, int) { return kNan; }))),
              AllOf(HasSubstr("depth.pfm"), HasSubstr("holes")));
  const model::RawDepthMap small{8, 8, std::vector<float>(64, 1.0F), false};
  EXPECT_THAT(Refusal(AsDisparity(image, folder_.Put("small.pfm", io::EncodePfm(small)))),
              AllOf(HasSubstr("small.pfm"), HasSubstr("8x8"), HasSubstr("36x28")));
  EXPECT_THAT(Refusal({image, Disparity(), "--depth-kind", "z", "--depth-unit", "mm"}, 2),
              HasSubstr("--depth-kind z needs --camera; without a camera only a disparity map can "
                        "be used"));
  EXPECT_THAT(Refusal({image, Disparity()}, 2), HasSubstr("--depth-kind"));
}

TEST_F(EstimateTest, HolesAreFilledAndCounted) {
  const std::string json = folder_ / "estimate.json";
  const std::string depth = Depth([](int x, int y) {
    return x > 10 && x < 14 && y > 3 && y < 9 ? std::numeric_limits<double>::quiet_NaN() : 0.4;
  });
  const ProgramResult result = Run(With(AsDisparity(Image(), depth), {"--json", json}));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("15 px, filled along the surfaces around them (1.5 %)"));
  EXPECT_EQ(nlohmann::json::parse(ContentOf(json))["holes_filled"], 15);
}

TEST_F(EstimateTest, SettingsThatCannotBe) {
  const Arguments good = AsDisparity(Image(), Disparity());
  EXPECT_THAT(Refusal(With(good, {"--gamma", "0"}), 2),
              AllOf(HasSubstr("--gamma: "), HasSubstr("found 0"), HasSubstr("geometry")));
  EXPECT_THAT(Refusal(With(good, {"--gamma", "-1"}), 2), HasSubstr("found -1"));
  const std::string json = folder_ / "refused.json";
  EXPECT_THAT(Refusal(With(good, {"--ridge", "0", "--json", json})),
              AllOf(HasSubstr("block of "), HasSubstr("rcond is "), HasSubstr("ridge")));
  EXPECT_EQ(nlohmann::json::parse(ContentOf(json))["status"], "refused");
  EXPECT_THAT(Refusal(With(good, {"--memory-limit", "5"})),
              AllOf(HasSubstr("memory limit 5 MiB"), HasSubstr("at least")));
  EXPECT_THAT(Refusal(With(good, {"--crop", "30,20,10,10"})),
              AllOf(HasSubstr("30"), HasSubstr("36")));
  EXPECT_THAT(Refusal(With(good, {"--block-solver", "superlu"}), 2), HasSubstr("superlu"));
  EXPECT_THAT(Refusal(With(good, {"--sensor-origin", "0,0"}), 2), HasSubstr("--camera"));
  if (estimator::IsBuiltIn(estimator::BlockSolver::kCholmod)) {
    EXPECT_THAT(Refusal(With(good, {"--stencil", "paper", "--block-solver", "cholmod"})),
                HasSubstr("not symmetric"));
  } else {
    EXPECT_THAT(Refusal(With(good, {"--block-solver", "cholmod"})),
                HasSubstr("THICKLENS_WITH_GPL=OFF"));
  }
}

// An option that is given and ignored would mislead the user about the result.
TEST_F(EstimateTest, NothingThatIsGivenIsLeftOutWithoutAWord) {
  const Arguments relative = AsDisparity(Image(), Disparity());
  EXPECT_THAT(Refusal(With(relative, {"--st-depth-mm", "700"}), 2), HasSubstr("--camera"));
  EXPECT_THAT(Refusal(With(relative, {"--block-solver", "viennacl"}), 2),
              HasSubstr("--device cpu cannot be used with"));
  EXPECT_THAT(Refusal(With(relative, {"--sparse"}), 2), HasSubstr("--aperture-of"));
  EXPECT_THAT(Refusal(With(relative, {"--grid", "9"}), 2), HasSubstr("--aperture-of"));
  EXPECT_THAT(Refusal(With(relative, {"--ignore-exif"}), 2), HasSubstr("--camera"));
  for (const Arguments& of_scene :
       std::vector<Arguments>{{"--prior", "tv"}, {"--strength", "auto"}}) {
    EXPECT_THAT(Refusal(With(relative, of_scene), 2),
                HasSubstr(of_scene.front() + " requires --solver scene, the solver is blocks"));
  }
  for (const Arguments& iterative :
       std::vector<Arguments>{{"--tolerance", "1e-3"}, {"--max-iterations", "9"}, {"--double"}}) {
    EXPECT_THAT(Refusal(With(relative, iterative), 2),
                HasSubstr(iterative.front() + " requires --solver scene, functional or grid"));
  }
  EXPECT_THAT(Refusal({Image(), Disparity(), "--depth-kind", "disparity", "--views", "100x3"}, 2),
              HasSubstr("from 1 to 99"));
}

TEST_F(EstimateTest, DepthFarFromFocusIsReported) {
  const Arguments camera = {"--depth-kind", "z",       "--depth-unit", "mm",       "--camera",
                            Camera(),       "--views", "3x3",          "--device", "cpu"};
  const ProgramResult far = Run(With({Image(), Depth([](int, int) { return 4000; })}, camera));
  EXPECT_EQ(far.exit_code, 0) << far.err;
  EXPECT_THAT(far.err, AllOf(HasSubstr("4000 mm"), HasSubstr("800 mm"), HasSubstr("depth-unit")));
  const ProgramResult near = Run(With({Image(), Depth([](int, int) { return 900; })}, camera));
  EXPECT_THAT(near.err, ::testing::Not(HasSubstr("depth-unit")));
}

TEST_F(EstimateTest, DisparityBeyondTheImage) {
  EXPECT_THAT(Refusal(With(AsDisparity(Image(), Disparity()), {"--disparity-scale", "1e6"})),
              AllOf(HasSubstr("depth.pfm"), HasSubstr("px per view step"), HasSubstr("36 px"),
                    HasSubstr("--disparity-scale")));
  // The camera converts the disparity to an impossible depth, which the user did not give.
  EXPECT_THAT(Refusal(With(AsDisparity(Image(), Disparity()),
                           {"--camera", Camera(), "--disparity-scale", "1e6"})),
              AllOf(HasSubstr("depth.pfm"), HasSubstr("the scale and the offset of the disparity"),
                    Not(HasSubstr("unit"))));
}

TEST_F(EstimateTest, AFolderWithOtherThingsIsLeftAlone) {
  folder_.Put("lf/thesis.txt", "years of work");
  const ProgramResult result = Run(AsDisparity(Image(), Disparity()));
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(ContentOf(folder_ / "lf/thesis.txt"), "years of work");
}

TEST_F(EstimateTest, AFailingRunLeavesTheOlderLightField) {
  Estimated(AsDisparity(Image(), Disparity()));
  const std::string before = ContentOf(Output() + "/lightfield.yaml");
  EXPECT_EQ(Run(With(AsDisparity(Image(), Disparity()), {"--ridge", "0"})).exit_code, 1);
  EXPECT_EQ(ContentOf(Output() + "/lightfield.yaml"), before);
}

TEST_F(EstimateTest, TheMemoryLimitHolds) {
  if (thicklens::testing::kIsSanitized) GTEST_SKIP() << "the sanitizer needs memory of its own";
  // The middle is flat and in focus, so only the sides determine how much memory blocks need.
  constexpr int kWide = 144;
  constexpr int kHigh = 96;
  model::EncodedImage image{kWide, kHigh, 1, 8, {}};
  model::RawDepthMap map{kWide, kHigh, {}, false};
  for (int i = 0; i < kWide * kHigh; ++i) {
    image.values.push_back(static_cast<std::uint16_t>(i * 7919 % 256));
    const double beside = std::max(0.0, std::abs(i % kWide - kWide / 2) - 36.0);
    map.values.push_back(static_cast<float>(2.5 * beside / 36));
  }
  const Arguments good = With(AsDisparity(folder_.Put("slanted.png", io::EncodePng(image)),
                                          folder_.Put("slanted.pfm", io::EncodePfm(map))),
                              {"--threads", "2"});
  const std::string json = folder_ / "estimate.json";
  const auto summary_of = [&](const Arguments& more) {
    const ProgramResult result = Run(With(With(good, {"--json", json}), more));
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return nlohmann::json::parse(ContentOf(json));
  };
  for (const std::string solver : {"umfpack", "cholmod", "eigen", "bicgstab"}) {
    if (!estimator::IsBuiltIn(estimator::BlockSolverFromName(solver))) continue;
    SCOPED_TRACE(solver);
    // The memory that 16 px need is a real limit and sufficient for them, whatever else the program
    // holds.
    const nlohmann::json free = summary_of({"--block-solver", solver});
    EXPECT_LE(free["peak_rss_mib"].get<double>(), free["predicted_memory_mib"].get<double>());
    const int limit_mib = static_cast<int>(free["predicted_memory_mib"].get<double>()) + 4;
    const nlohmann::json bound =
        summary_of({"--block-solver", solver, "--memory-limit", std::to_string(limit_mib)});
    EXPECT_GE(bound["block_px"], 10);
    EXPECT_LE(bound["block_px"], 24);
    EXPECT_LE(bound["peak_rss_mib"].get<double>(), limit_mib);
  }
  fs::remove_all(Output());
  // Refused before a system is made that would not fit.
  EXPECT_THAT(Refusal(With(good, {"--block-px", "144", "--memory-limit", "150"})),
              AllOf(HasSubstr("memory limit 150 MiB"), HasSubstr("blocks of 144 px")));
}

TEST_F(EstimateTest, IterationsOfTheBlocksAreReported) {
  const Arguments good = With(AsDisparity(Image(), Disparity()), {"--block-solver", "cg"});
  const std::string json = folder_ / "estimate.json";
  const ProgramResult done = Run(With(good, {"--json", json}));
  ASSERT_EQ(done.exit_code, 0) << done.err;
  nlohmann::json summary = nlohmann::json::parse(ContentOf(json));
  EXPECT_EQ(summary["block_solver"], "cg");
  EXPECT_GT(summary["iterations"].get<int>(), 3);
  EXPECT_EQ(summary["converged"], true);
  EXPECT_EQ(summary["status"], "ok");
  EXPECT_LE(summary["relative_residual"].get<double>(), 1e-6);
  EXPECT_TRUE(summary["rcond_min"].is_null());
  EXPECT_THAT(done.err, ::testing::Not(HasSubstr("not converged")));

  const ProgramResult cut = Run(With(good, {"--max-iterations", "2", "--json", json}));
  ASSERT_EQ(cut.exit_code, 0) << cut.err;
  summary = nlohmann::json::parse(ContentOf(json));
  EXPECT_EQ(summary["converged"], false);
  EXPECT_EQ(summary["status"], "partial");
  EXPECT_THAT(summary["reason"].get<std::string>(), HasSubstr("not converged"));
  EXPECT_THAT(cut.err, AllOf(HasSubstr("not converged"), HasSubstr("--max-iterations")));
  fs::remove_all(Output());
  // A direct solver has no iterations to limit.
  EXPECT_THAT(Refusal(With(AsDisparity(Image(), Disparity()),
                           {"--block-solver", "eigen", "--tolerance", "1e-3"}),
                      2),
              HasSubstr("--tolerance requires --solver"));
}

TEST_F(EstimateTest, AnInterruptLeavesNothing) {
  // Large enough to be under way when the signal comes.
  constexpr int kSize = 400;
  model::EncodedImage image{kSize, kSize, 1, 8, {}};
  model::RawDepthMap map{kSize, kSize, {}, false};
  for (int i = 0; i < kSize * kSize; ++i) {
    image.values.push_back(static_cast<std::uint16_t>(i * 7919 % 256));
    map.values.push_back(static_cast<float>(i % kSize) * 0.005F);
  }
  Arguments arguments =
      With({"estimate"}, AsDisparity(folder_.Put("large.png", io::EncodePng(image)),
                                     folder_.Put("large.pfm", io::EncodePfm(map))));
  arguments =
      With(arguments, {"--solver", "blocks", "-o", Output(), "--views", "7x7", "--verbose"});
  arguments.erase(std::find(arguments.begin(), arguments.end(), "3x3") - 1,
                  std::find(arguments.begin(), arguments.end(), "3x3") + 1);
  ChildProgram program(arguments, scratch_.path(), 0);
  // The device is opened right before the blocks are solved.
  while (program.Running() && ContentOf(scratch_ / "stderr").find("device") == std::string::npos) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  program.Interrupt();
  const ProgramResult result = program.Wait();
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("interrupted; nothing was written"));
  EXPECT_FALSE(fs::exists(Output()));
}

TEST_F(EstimateTest, SlowARealRoomOfAKinect) {
  const std::string data = std::string(THICKLENS_SHARED_DATA_DIR) + "/tum_kinect";
  if (!fs::exists(data)) GTEST_SKIP() << data << " is missing";
  const std::string json = folder_ / "estimate.json";
  const ProgramResult result = Run(
      {data + "/TUM_color.png", data + "/TUM_depth.png", "--depth-kind", "z", "--depth-unit",
       "tum5000", "--camera", std::string(THICKLENS_SOURCE_DIR) + "/configs/cameras/kinect.yaml",
       "--views", "3x3", "--json", json});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json summary = nlohmann::json::parse(ContentOf(json));
  EXPECT_EQ(summary["size"], nlohmann::json({640, 480}));
  EXPECT_EQ(summary["blocks"], 1200);
  EXPECT_GT(summary["holes_filled"], 0);
  EXPECT_NEAR(summary["depth"]["median_mm"].get<double>(), 2415, 1);
  EXPECT_LT(summary["relative_residual"].get<double>(), 1e-12);
  EXPECT_GT(summary["rcond_min"].get<double>(), 1e-6);

  // The light field put through the camera is the photograph again. In the corners, where the
  // fall-off is divided out, bright radiance is above full scale and clipped in the views' files.
  const std::string again = folder_ / "again.png";
  const ProgramResult render =
      ChildProgram({"render", Output(), "--as-captured", "--crop", "160,120,320,240", "-o", again},
                   scratch_.path(), 0)
          .Wait();
  ASSERT_EQ(render.exit_code, 0) << render.err;
  const std::string compared = folder_ / "compared.json";
  const ProgramResult compare = ChildProgram({"compare", data + "/TUM_color.png", again, "--crop",
                                              "160,120,320,240", "--json", compared},
                                             scratch_.path(), 0)
                                    .Wait();
  ASSERT_EQ(compare.exit_code, 0) << compare.err;
  EXPECT_GT(nlohmann::json::parse(ContentOf(compared))["psnr_db"].get<double>(), 45);
}

// A flat scene in the plane of focus of a wide camera: all views alike, the photograph sharp but
// dark in the corners. Warping it must not be blamed for the fall-off.
TEST_F(EstimateTest, TheBaselineIsRadianceToo) {
  model::Camera camera = model::ParseCamera(CameraYaml(kWidth, kHeight), "wide");
  camera.sensor.pixel_pitch_mm = 0.4;
  const model::LightFieldGrid grid = model::DefaultGrid(camera, 3, 3);
  model::LightField truth = model::MakeLightField(kWidth, kHeight, 3, 3, 3);
  truth.grid = grid;
  truth.camera = camera;
  truth.weights = model::ApertureWeights(model::ApertureShape::kGaussian, 3, 3);
  const model::LinearImage view = model::ToLinear(RandomImage(3, 8), truth.transfer);
  for (int l = 0; l < 3; ++l) {
    for (int k = 0; k < 3; ++k) model::SetView(&truth, k, l, view);
  }
  const std::string folder = folder_ / "truth";
  OutputFolder output(folder, io::kLightFieldMarker, io::LightFieldEntries());
  io::WriteLightField(truth, io::ViewFormat::kTiff, &output);
  output.Commit();

  const std::string photo = folder_ / "photo.png";
  const ProgramResult render = ChildProgram({"render", folder, "--as-captured", "--bits", "16",
                                             "--device", "cpu", "-o", photo},
                                            scratch_.path(), 0)
                                   .Wait();
  ASSERT_EQ(render.exit_code, 0) << render.err;
  const std::string depth = Depth([](int, int) { return 800; });
  const auto dibr_db = [&](const Arguments& more) {
    const std::string json = folder_ / "compared.json";
    const ProgramResult result =
        ChildProgram(With({"compare", folder, folder, "--dibr", photo, depth, "--depth-kind", "z",
                           "--depth-unit", "mm", "--json", json},
                          more),
                     scratch_.path(), 0)
            .Wait();
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return nlohmann::json::parse(ContentOf(json))["dibr"]["mean"]["psnr_db"].get<double>();
  };
  EXPECT_GT(dibr_db({}), 60);
  EXPECT_LT(dibr_db({"--without", "falloff"}), 35);
}

// The road of a light field with true views, at 3 x 3 on a part of a real one.
class ProtocolTest : public EstimateTest {
 protected:
  void SetUp() override {
    data_ = std::string(THICKLENS_SHARED_DATA_DIR) + "/lf_antinous";
    if (!fs::exists(data_)) GTEST_SKIP() << data_ << " is missing";
  }
  nlohmann::json Compare(const Arguments& arguments) const {
    const std::string json = folder_ / "result.json";
    Arguments all = With({"compare"}, arguments);
    all.insert(all.end(), {"--json", json});
    const ProgramResult result = ChildProgram(all, scratch_.path(), 0).Wait();
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return nlohmann::json::parse(ContentOf(json));
  }
  std::string data_;
};

TEST_F(ProtocolTest, RenderEstimateCompareAsWritten) {
  const std::string photo = folder_ / "photo.png";
  const std::string depth = data_ + "/gt_disp_lowres.pfm";
  const Arguments crop = {"--crop", "192,192,128,128"};
  const ProgramResult render =
      ChildProgram(
          {"render", data_, "--grid", "9", "--views", "3x3", "--as-captured", "--aperture-shape",
           "uniform", "--noise", "1", "--bits", "8", "--seed", "1", "-o", photo},
          scratch_.path(), 0)
          .Wait();
  ASSERT_EQ(render.exit_code, 0) << render.err;
  const ProgramResult estimate = Run(With({photo, depth, "--depth-kind", "disparity", "--views",
                                           "3x3", "--aperture-shape", "uniform", "--device", "cpu"},
                                          crop));
  ASSERT_EQ(estimate.exit_code, 0) << estimate.err;
  const nlohmann::json result = Compare(
      With({data_, Output(), "--grid", "9", "--border", "20", "--dibr", photo, depth}, crop));
  // Blocks amplify the noise and lose the light that leaves them, so the result is worse than the
  // photograph warped by its depth.
  EXPECT_GT(result["mean"]["psnr_db"].get<double>(), 37);
  EXPECT_GT(result["dibr"]["mean"]["psnr_db"].get<double>(), 42);
  EXPECT_EQ(result["per_view"].size(), 9u);
}

// 33 of the 49 views: every second one of the outer ring is missing, and the corners beside it.
TEST_F(ProtocolTest, ASparseLightFieldSeenThroughAGaussianAperture) {
  const std::string sparse = folder_ / "sparse";
  fs::create_directories(sparse);
  int views = 0;
  for (int v = 1; v <= 7; ++v) {
    for (int u = 1; u <= 7; ++u) {
      const bool is_outer = u == 1 || u == 7 || v == 1 || v == 7;
      const bool is_corner_of_inner = (u == 2 || u == 6) && (v == 2 || v == 6);
      if ((is_outer && (u + v) % 2 != 0) || is_corner_of_inner) continue;
      const std::string name = fmt::format("/input_Cam{:03}.png", 9 * v + u);
      fs::create_symlink(data_ + name, sparse + name);
      ++views;
    }
  }
  ASSERT_EQ(views, 33);
  const std::string photo = folder_ / "photo.png";
  const std::string depth = data_ + "/gt_disp_lowres.pfm";
  const ProgramResult render =
      ChildProgram({"render", data_, "--grid", "9", "--as-captured", "--aperture-shape", "gaussian",
                    "--noise", "1", "--bits", "8", "--seed", "1", "-o", photo},
                   scratch_.path(), 0)
          .Wait();
  ASSERT_EQ(render.exit_code, 0) << render.err;
  const Arguments crop = {"--crop", "128,128,256,256"};
  const auto above_warping = [&](const Arguments& aperture) {
    Arguments all = With({photo, depth, "--depth-kind", "disparity", "--aperture-of", sparse,
                          "--grid", "9", "--sparse", "-o", Output()},
                         crop);
    all.insert(all.begin(), "estimate");
    all.insert(all.end(), aperture.begin(), aperture.end());
    const ProgramResult estimate = ChildProgram(all, scratch_.path(), 0).Wait();
    EXPECT_EQ(estimate.exit_code, 0) << estimate.err;
    const nlohmann::json result = Compare(With(
        {sparse, Output(), "--grid", "9", "--sparse", "--border", "20", "--dibr", photo, depth},
        crop));
    EXPECT_EQ(result["per_view"].size(), 33u);
    return result["mean"]["psnr_db"].get<double>() -
           result["dibr"]["mean"]["psnr_db"].get<double>();
  };
  const double gaussian_db = above_warping({"--aperture-shape", "gaussian"});
  EXPECT_GT(gaussian_db, 1);
  // This shape was formerly assumed without a message. Where it may be corrected by the blur that
  // the photograph shows, it is as good.
  EXPECT_GT(gaussian_db,
            above_warping({"--aperture-shape", "uniform", "--photo", "captured"}) + 0.5);
  EXPECT_GT(above_warping({"--aperture-shape", "uniform"}), gaussian_db - 0.5);
}

}  // namespace
}  // namespace thicklens::tools

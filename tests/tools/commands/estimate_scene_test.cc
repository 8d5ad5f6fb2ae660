// thicklens estimate with its default solver, as a person meets it.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bitset>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "support/temporary_folder.h"
#include "support/test_cameras.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_file.h"
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
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using thicklens::testing::ContentOf;
using Arguments = std::vector<std::string>;

constexpr int kColumns = 96, kRows = 64;

// Soft stripes, 1 grey level of noise.
model::EncodedImage Stripes(int channels) {
  model::EncodedImage image{kColumns, kRows, channels, 8, {}};
  std::mt19937 engine(7);
  std::normal_distribution<double> noise(0, 1);
  for (int y = 0; y < kRows; ++y) {
    for (int x = 0; x < kColumns; ++x) {
      for (int c = 0; c < channels; ++c) {
        const double value = 120 + 40 * std::sin(0.35 * x + 0.5 * c) + 30 * std::sin(0.3 * y);
        image.values.push_back(
            static_cast<std::uint16_t>(std::lround(std::clamp(value + noise(engine), 0.0, 255.0))));
      }
    }
  }
  return image;
}

std::string CameraYaml(const model::TransferCurve& transfer) {
  return model::CameraToYaml(thicklens::testing::PhotographCamera(kColumns, kRows, transfer));
}

class EstimateSceneTest : public ::testing::Test, protected EstimateCommand {
 protected:
  std::string Image(int channels = 3) const {
    return folder_.Put("picture.png", io::EncodePng(Stripes(channels)));
  }
  std::string Depth(const std::function<double(int x, int y)>& value) const {
    model::RawDepthMap map{kColumns, kRows, {}, false};
    for (int y = 0; y < kRows; ++y) {
      for (int x = 0; x < kColumns; ++x) map.values.push_back(static_cast<float>(value(x, y)));
    }
    return folder_.Put("depth.pfm", io::EncodePfm(map));
  }
  std::string Slant() const {
    return Depth([](int x, int) { return 0.01 * x - 0.5; });
  }
  std::string Report() const { return folder_ / "page"; }

  Arguments Usual() const {
    return {Image(), Slant(), "--depth-kind", "disparity", "--views", "3x3"};
  }
  std::string Refusal(const Arguments& arguments, int exit_code) const {
    std::string message = EstimateCommand::Refusal(arguments, exit_code);
    EXPECT_FALSE(fs::exists(Report()));
    return message;
  }
};

// A near strip before a far wall.
double Strip(int x, int) { return x >= 40 && x < 60 ? 1 : -0.5; }

model::EncodedImage ConfidenceFile(const std::string& folder, int k, int l) {
  return io::ToEncodedImage(
      io::ReadImageFile(fmt::format("{}/confidence/view_{:02}_{:02}.png", folder, l, k)));
}

TEST_F(EstimateSceneTest, OccludedRaysMayBeInpainted) {
  const Arguments strip = {Image(),   Depth(Strip), "--depth-kind", "disparity",
                           "--views", "3x3",        "--format",     "tiff"};
  EXPECT_TRUE(Summary(strip)["inpainting"].is_null());
  const model::LightField own = io::ReadLightField(Output(), {});
  EXPECT_EQ(own.origin.method, "scene");
  ProgramResult result;
  const json inpainting = Summary(With(strip, {"--fill", "telea"}), &result)["inpainting"];
  EXPECT_GT(inpainting["rays"].get<int>(), 100);
  EXPECT_EQ(inpainting["filled"].get<int>() + inpainting["carried"].get<int>(),
            inpainting["rays"].get<int>());
  EXPECT_THAT(result.out, HasSubstr("inpainting   "));
  const model::LightField telea = io::ReadLightField(Output(), {});
  EXPECT_EQ(telea.origin.method, "scene+telea");
  int changed = 0;
  for (std::size_t i = 0; i < own.values.size(); ++i) {
    if (own.values[i] != telea.values[i]) ++changed;
  }
  EXPECT_GT(changed, 0);
  EXPECT_LE(changed, 3 * inpainting["rays"].get<int>());  // channels
  const ProgramResult report =
      ChildProgram({"report", Output(), "-o", folder_ / "page.html"}, scratch_.path(), 0).Wait();
  EXPECT_EQ(report.exit_code, 0) << report.err;
  EXPECT_THAT(ContentOf(folder_ / "page.html"), HasSubstr("scene+telea"));
}

TEST_F(EstimateSceneTest, WritesTheConfidenceOfEachRay) {
  const json summary = Summary({Image(), Depth(Strip), "--depth-kind", "disparity", "--views",
                                "3x3", "--threads", "2", "--store", "views"});
  std::size_t filled = 0, whole = 0;
  for (int l = 0; l < 3; ++l) {
    for (int k = 0; k < 3; ++k) {
      const model::EncodedImage rays = ConfidenceFile(Output(), k, l);
      ASSERT_EQ(rays.channels, 1);
      ASSERT_EQ(rays.bits, 8);
      ASSERT_EQ(rays.width_px, kColumns);
      ASSERT_EQ(rays.height_px, kRows);
      filled += static_cast<std::size_t>(std::count(rays.values.begin(), rays.values.end(), 0));
      whole += static_cast<std::size_t>(std::count(rays.values.begin(), rays.values.end(), 255));
    }
  }
  EXPECT_GT(filled, 0u);
  constexpr double kRays = 9.0 * kColumns * kRows;
  EXPECT_NEAR(summary["rays"]["filled_in_share"], static_cast<double>(filled) / kRays, 1e-9);
  EXPECT_NEAR(summary["rays"]["visible_fraction"], static_cast<double>(whole) / kRays, 1e-9);
  // In the view one step to the right, the strip is one px farther left, and the wall half a px
  // farther right.
  const model::EncodedImage right = ConfidenceFile(Output(), 2, 1);
  const auto row = right.values.begin() + 32 * kColumns;
  EXPECT_EQ(row[50], 255);
  EXPECT_EQ(row[59], 0);
  EXPECT_EQ(row[20], 255);
  // The folder is read as before.
  EXPECT_EQ(io::ReadLightField(Output(), {}).u_count, 3);
}

TEST_F(EstimateSceneTest, WritesTheSameConfidenceWithAPageAndByOtherSolvers) {
  const Arguments usual = {Image(),   Depth(Strip), "--depth-kind", "disparity",
                           "--views", "3x3",        "--store",      "views"};
  Summary(usual);
  const model::EncodedImage streamed = ConfidenceFile(Output(), 0, 2);
  for (const Arguments& more : {Arguments{"--report", Report()},
                                {"--solver", "blocks"},
                                {"--solver", "functional"},
                                {"--solver", "grid"}}) {
    fs::remove_all(Output());
    Summary(With(usual, more));
    EXPECT_EQ(ConfidenceFile(Output(), 0, 2).values, streamed.values) << more[1];
  }
}

TEST_F(EstimateSceneTest, IsTheDefaultAndSaysWhatItDid) {
  ProgramResult result;
  const json summary = Summary(With(Usual(), {"--threads", "2"}), &result);
  EXPECT_THAT(result.out,
              AllOf(HasSubstr("3 x 3 views of 96 x 64 px"), HasSubstr("scene: tv prior"),
                    HasSubstr("grey levels"), HasSubstr("iterations")));
  EXPECT_EQ(summary["solver"], "scene");
  EXPECT_TRUE(summary.at("block_solver").is_null());
  EXPECT_TRUE(summary.at("rcond_min").is_null());
  EXPECT_EQ(summary["prior"], "tv");
  EXPECT_EQ(summary["strength_rule"], "auto");
  EXPECT_EQ(summary["device"], "cpu");
  EXPECT_EQ(summary["threads"], 2);
  EXPECT_EQ(summary["views"], json({3, 3}));
  EXPECT_EQ(summary["size"], json({kColumns, kRows}));
  EXPECT_EQ(summary["channels"], 3);
  EXPECT_EQ(summary["transfer"], "srgb");
  EXPECT_EQ(summary["effects"], json({"defocus", "aperture-shape", "occlusion"}));
  EXPECT_EQ(summary["holes_filled"], 0);
  EXPECT_EQ(summary["converged"], true);
  EXPECT_GT(summary["strength"].get<double>(), 0);
  EXPECT_NEAR(summary["noise_sigma"].get<double>() * 255, 1, 0.4);
  EXPECT_GT(summary["iterations"].get<int>(), 0);
  EXPECT_LE(summary["relative_residual"].get<double>(), 1e-4);
  EXPECT_GT(summary["residual_rms"].get<double>(), 0);
  double of_rays = 0;
  for (const auto& [kind, share] : summary["rays"].items()) {
    EXPECT_GE(share.get<double>(), 0) << kind;
    const bool is_former = kind == "seen_share" || kind == "partly_seen_share";
    if (!is_former) of_rays += share.get<double>();
  }
  EXPECT_NEAR(of_rays, 1, 1e-9);
  for (const char* share : {"row_share", "occluded_fraction", "clipped_fraction"}) {
    EXPECT_GE(summary.at(share).get<double>(), 0) << share;
    EXPECT_LE(summary.at(share).get<double>(), 1) << share;
  }
  const json& seconds = summary["seconds"];
  double parts = 0;
  for (const char* part : {"setup", "solve", "views", "files"})
    parts += seconds.at(part).get<double>();
  EXPECT_LE(parts, seconds["total"].get<double>() * 1.001);
  EXPECT_GT(seconds["read"].get<double>(), 0);
  EXPECT_LE(seconds["read"].get<double>(), seconds["setup"].get<double>());
  EXPECT_GT(summary["peak_rss_mib"].get<double>(), 10);
  EXPECT_GT(summary["predicted_memory_mib"].get<double>(), 1);
  EXPECT_NEAR(summary["disparity"]["min_px"].get<double>(), -0.5, 1e-6);
  EXPECT_NEAR(summary["disparity"]["max_px"].get<double>(), 0.45, 1e-6);
  EXPECT_FALSE(summary.contains("depth"));
  EXPECT_THAT(summary["warnings"], IsEmpty());

  const model::LightFieldOrigin origin = io::ReadLightField(Output(), {}).origin;
  EXPECT_EQ(origin.method, "scene");
  EXPECT_EQ(origin.prior, "tv");
  EXPECT_EQ(origin.device, "cpu");
  EXPECT_DOUBLE_EQ(origin.strength.value(), summary["strength"].get<double>());
  EXPECT_DOUBLE_EQ(origin.noise_sigma.value(), summary["noise_sigma"].get<double>());
  EXPECT_EQ(origin.iterations.value(), summary["iterations"].get<int>());
  EXPECT_GT(origin.seconds.value(), 0);
  EXPECT_FALSE(origin.rcond_min.has_value());
}

TEST_F(EstimateSceneTest, TakesItsSettings) {
  json summary = Summary(With(Usual(), {"--prior", "ridge", "--strength", "0.02", "--double"}));
  EXPECT_EQ(summary["prior"], "ridge");
  EXPECT_EQ(summary["strength_rule"], "given");
  EXPECT_DOUBLE_EQ(summary["strength"].get<double>(), 0.02);
  summary = Summary(With(Usual(), {"--prior", "gradient", "--strength", "gcv"}));
  EXPECT_EQ(summary["prior"], "gradient");
  EXPECT_EQ(summary["strength_rule"], "gcv");
  summary = Summary(With(Usual(), {"--prior", "patches", "--report", Report()}));
  EXPECT_EQ(summary["prior"], "patches");
  EXPECT_EQ(summary["strength_rule"], "auto");
  EXPECT_EQ(summary["converged"], true);
  EXPECT_EQ(io::ReadLightField(Output(), {}).origin.prior, "patches");
  EXPECT_THAT(ContentOf(Report() + "/index.html"), HasSubstr("<td>patches</td>"));
  // This tolerance is below the precision of 32-bit numbers.
  const Arguments exact = {"--prior", "gradient",         "--tolerance",
                           "1e-10",   "--max-iterations", "500"};
  EXPECT_EQ(Summary(With(With(Usual(), exact), {"--double"}))["converged"], true);
  EXPECT_EQ(Summary(With(Usual(), exact))["converged"], false);
  const json loose = Summary(With(Usual(), {"--prior", "gradient", "--tolerance", "0.1"}));
  EXPECT_LT(loose["iterations"].get<int>(),
            Summary(With(Usual(), {"--prior", "gradient"}))["iterations"].get<int>());
}

TEST_F(EstimateSceneTest, OptionsOfBlocksAreAUsageError) {
  for (const Arguments& smooth : std::vector<Arguments>{{"--gamma", "1"}, {"--ridge", "0.1"}}) {
    EXPECT_THAT(Refusal(With(Usual(), smooth), 2),
                HasSubstr(smooth.front() +
                          " requires --solver blocks, functional or grid, the solver is scene"));
  }
  for (const Arguments& of_blocks : std::vector<Arguments>{{"--block-solver", "eigen"},
                                                           {"--block-px", "16"},
                                                           {"--stencil", "warp"},
                                                           {"--splat", "bilinear"}}) {
    EXPECT_THAT(Refusal(With(Usual(), of_blocks), 2),
                HasSubstr(of_blocks.front() + " requires --solver blocks, the solver is scene"));
  }
}

TEST_F(EstimateSceneTest, ADeviceThatIsAskedForComputesIt) {
  const auto summary = Summary(With(Usual(), {"--device", "opencl"}));
  EXPECT_THAT(summary["device"].get<std::string>(), ::testing::StartsWith("opencl:"));
  EXPECT_TRUE(summary["converged"]);
  EXPECT_EQ(Summary(With(Usual(), {"--device", "auto"}))["device"], "cpu");
}

TEST_F(EstimateSceneTest, SettingsThatCannotBe) {
  for (const char* strength : {"0", "-1", "nan", "inf", "much", "1x", ""}) {
    EXPECT_THAT(Refusal(With(Usual(), {"--strength", strength}), 2), HasSubstr("--strength"))
        << strength;
  }
  EXPECT_THAT(Refusal(With(Usual(), {"--prior", "sparse"}), 2), HasSubstr("sparse"));
  EXPECT_THAT(Refusal(With(Usual(), {"--tolerance", "0"}), 2), HasSubstr("--tolerance"));
  EXPECT_THAT(Refusal(With(Usual(), {"--tolerance", "1"}), 2),
              HasSubstr("--tolerance: must be above 0 and below 1"));
  EXPECT_THAT(Refusal(With(Usual(), {"--max-iterations", "0"}), 2), HasSubstr("--max-iterations"));
  EXPECT_THAT(Refusal(With(Usual(), {"--memory-limit", "5"}), 1),
              AllOf(HasSubstr("memory limit 5 MiB"), HasSubstr("at least")));
  EXPECT_THAT(Refusal(With(Usual(), {"--report", Output()}), 2), HasSubstr("outside"));
  EXPECT_THAT(Refusal(With(Usual(), {"--report", Output() + "/page"}), 2), HasSubstr("outside"));
  EXPECT_THAT(Refusal(With(Usual(), {"--report", folder_ / "none/page"}), 1), HasSubstr("none"));
}

// Never linear by accident, and never silently.
TEST_F(EstimateSceneTest, TheTransferCurve) {
  const std::string assumed = "encoded values are assumed to be sRGB (--transfer)";
  ProgramResult result;
  json summary = Summary(Usual(), &result);
  EXPECT_THAT(result.err, HasSubstr(assumed));
  EXPECT_EQ(summary["transfer_from"], "assumed");

  summary = Summary(With(Usual(), {"--transfer", "linear"}), &result);
  EXPECT_THAT(result.err, Not(HasSubstr("encoded values")));
  EXPECT_EQ(summary["transfer"], "linear");
  EXPECT_EQ(summary["transfer_from"], "option");
  EXPECT_EQ(io::ReadLightField(Output(), {}).transfer, model::TransferCurve::Linear());

  const std::string camera =
      folder_.Put("camera.yaml", CameraYaml(model::TransferCurve::Gamma(2.2)));
  const Arguments with_camera = With(Usual(), {"--camera", camera});
  summary = Summary(with_camera, &result);
  EXPECT_THAT(result.err, Not(HasSubstr("encoded values")));
  EXPECT_EQ(summary["transfer"], "gamma-2.2");
  EXPECT_EQ(summary["transfer_from"], "camera");
  summary = Summary(With(with_camera, {"--transfer", "srgb"}));
  EXPECT_EQ(summary["transfer"], "srgb");
  EXPECT_EQ(summary["transfer_from"], "option");
  const model::LightField found = io::ReadLightField(Output(), {});
  EXPECT_EQ(found.transfer, model::TransferCurve::Srgb());
  EXPECT_EQ(found.camera->sensor.transfer, model::TransferCurve::Srgb());
}

TEST_F(EstimateSceneTest, WarnsOfStepsThatAreTooLarge) {
  // One column of 96 at 3.2 px, the rest below 3 px.
  const std::string depth = Depth([](int x, int) { return x == 20 ? 3.2 : 2.9; });
  ProgramResult result;
  const json summary =
      Summary({Image(), depth, "--depth-kind", "disparity", "--views", "3x3"}, &result);
  // The stripes are sharp where the depth says that they are blurred.
  ASSERT_EQ(summary["warnings"].size(), 2u) << summary["warnings"];
  EXPECT_THAT(
      summary["warnings"][0].get<std::string>(),
      AllOf(HasSubstr("1.0 % of the pixels"), HasSubstr("3 px"), HasSubstr("up to 3.2 px")));
  EXPECT_THAT(summary["warnings"][1].get<std::string>(),
              HasSubstr("not explained beyond its noise"));
  EXPECT_THAT(result.err, HasSubstr("up to 3.2 px"));
  EXPECT_NEAR(summary["disparity"]["coarse_share"].get<double>(), 1.0 / kColumns, 1e-9);
}

TEST_F(EstimateSceneTest, SmoothsANoisyDepthAndWarnsWhereItStaysNoisy) {
  const auto with_noise = [&](double sigma_px) {
    std::mt19937 engine(11);
    std::normal_distribution<double> noise(0, 1);
    return Depth([&](int x, int) { return 0.01 * x - 0.5 + sigma_px * noise(engine); });
  };
  const auto summary_of = [&](double sigma_px, const Arguments& more) {
    return Summary(
        With({Image(), with_noise(sigma_px), "--depth-kind", "disparity", "--views", "3x3"}, more));
  };
  const json smoothed = summary_of(0.1, {});
  EXPECT_NEAR(smoothed["disparity"]["noise_px"].get<double>(), 0.1, 0.01);
  EXPECT_NEAR(smoothed["disparity"]["noise_left_px"].get<double>(), 0.015, 0.005);
  EXPECT_THAT(smoothed["warnings"].dump(), Not(HasSubstr("noise of")));
  const json kept = summary_of(0.1, {"--keep-depth-noise"});
  EXPECT_NEAR(kept["disparity"]["noise_px"].get<double>(), 0.1, 0.01);
  EXPECT_TRUE(kept["disparity"]["noise_left_px"].is_null());
  EXPECT_THAT(kept["warnings"].dump(), AllOf(HasSubstr("noise of about 0.1"), HasSubstr("0.05")));
  EXPECT_THAT(summary_of(0.5, {})["warnings"].dump(), HasSubstr("noise of about 0.0"));
  const json quiet = summary_of(0.01, {});
  EXPECT_TRUE(quiet["disparity"]["noise_left_px"].is_null());
  EXPECT_THAT(quiet["warnings"].dump(), Not(HasSubstr("noise of")));
}

TEST_F(EstimateSceneTest, SaysWhenItHasNotConverged) {
  ProgramResult result;
  const json summary =
      Summary(With(Usual(), {"--max-iterations", "2", "--tolerance", "1e-9"}), &result);
  EXPECT_EQ(summary["converged"], false);
  EXPECT_THAT(summary["warnings"].dump(),
              AllOf(HasSubstr("not converged"), HasSubstr("--max-iterations")));
  EXPECT_THAT(result.out, HasSubstr("not converged"));
}

// Sharp bars of many widths, all in focus, 1 grey level of noise.
model::EncodedImage Bars(int width_px, int height_px) {
  const std::bitset<64> is_dark(0x9d3a6c51b2e4f087ULL);
  model::EncodedImage image{width_px, height_px, 1, 8, {}};
  std::mt19937 engine(5);
  std::normal_distribution<double> noise(0, 1);
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) {
      const double value = (is_dark[static_cast<std::size_t>(x / 4)] ? 60 : 190) + noise(engine);
      image.values.push_back(static_cast<std::uint16_t>(std::lround(value)));
    }
  }
  return image;
}

TEST_F(EstimateSceneTest, NamesAPatchWhoseDepthIsWrong) {
  // In this map one patch is far out of focus.
  model::RawDepthMap map{256, 192, {}, false};
  for (int y = 0; y < 192; ++y) {
    for (int x = 0; x < 256; ++x) {
      map.values.push_back(x >= 120 && x < 200 && y >= 56 && y < 136 ? -0.9F : 0.0F);
    }
  }
  const Arguments arguments = {folder_.Put("bars.png", io::EncodePng(Bars(256, 192))),
                               folder_.Put("bars.pfm", io::EncodePfm(map)),
                               "--depth-kind",
                               "disparity",
                               "--views",
                               "5x5",
                               "--photo",
                               "captured"};
  const json summary = Summary(arguments);
  ASSERT_FALSE(summary["residual_patches"].empty());
  for (const json& patch : summary["residual_patches"]) {
    EXPECT_GE(patch["x_px"], 96);
    EXPECT_LT(patch["x_px"], 200);
    EXPECT_GE(patch["y_px"], 32);
    EXPECT_LT(patch["y_px"], 136);
  }
  EXPECT_THAT(summary["warnings"].dump(),
              AllOf(HasSubstr("not explained"), HasSubstr("grey levels")));
  // The right depth causes no message.
  map.values.assign(map.values.size(), 0.0F);
  folder_.Put("bars.pfm", io::EncodePfm(map));
  EXPECT_THAT(Summary(arguments)["residual_patches"], IsEmpty());
}

TEST_F(EstimateSceneTest, APhotographSharperThanItsDepthAllowsIsReported) {
  model::RawDepthMap map{128, 96, std::vector<float>(128 * 96, -0.9F), false};
  Arguments arguments = {folder_.Put("bars.png", io::EncodePng(Bars(128, 96))),
                         folder_.Put("bars.pfm", io::EncodePfm(map)),
                         "--depth-kind",
                         "disparity",
                         "--views",
                         "5x5",
                         "--photo",
                         "captured"};
  // The error is the same everywhere, so that no patch stands out.
  const json summary = Summary(arguments);
  EXPECT_GT(summary["unexplained_share"], 0.9);
  EXPECT_THAT(summary["warnings"].dump(), AllOf(HasSubstr("of the photograph is not explained"),
                                                HasSubstr("--disparity-scale")));
  arguments.insert(arguments.end(), {"--disparity-scale", "0.01"});
  const json right = Summary(arguments);
  EXPECT_LT(right["unexplained_share"], 0.05);
  EXPECT_THAT(right["warnings"], IsEmpty());
}

// Values of blocks of several sizes added up: sharp at every pixel.
model::EncodedImage SharpBlocks(int width_px, int height_px) {
  std::mt19937 engine(11);
  std::normal_distribution<double> value(0, 1);
  std::vector<double> sum(static_cast<std::size_t>(width_px) * height_px, 110);
  for (const int block_px : {2, 5, 11, 23}) {
    const int across = width_px / block_px + 1;
    std::vector<double> levels(static_cast<std::size_t>(across) * (height_px / block_px + 1));
    for (double& level : levels) level = 6 * std::sqrt(block_px) * value(engine);
    for (int i = 0; i < width_px * height_px; ++i) {
      sum[static_cast<std::size_t>(i)] += levels[static_cast<std::size_t>(
          i / width_px / block_px * across + i % width_px / block_px)];
    }
  }
  model::EncodedImage image{width_px, height_px, 1, 8, {}};
  for (const double level : sum) {
    image.values.push_back(
        static_cast<std::uint16_t>(std::lround(std::clamp(level + value(engine), 0.0, 255.0))));
  }
  return image;
}

TEST_F(EstimateSceneTest, ASharpPhotographIsTakenAsTheCentreView) {
  constexpr int kWide = 192, kHigh = 128;
  model::RawDepthMap map{kWide, kHigh, {}, false};
  for (int i = 0; i < kWide * kHigh; ++i)
    map.values.push_back(static_cast<float>(1.4 * (i % kWide) / kWide));
  const Arguments arguments = {folder_.Put("sharp.png", io::EncodePng(SharpBlocks(kWide, kHigh))),
                               folder_.Put("sharp.pfm", io::EncodePfm(map)),
                               "--depth-kind",
                               "disparity",
                               "--views",
                               "5x5"};
  ProgramResult result;
  const json found = Summary(With(arguments, {"--report", Report()}), &result);
  const json& photo = found.at("photo");
  EXPECT_EQ(photo.at("verdict"), "sharp") << photo.dump(1);
  EXPECT_EQ(photo.at("used_share"), 0);
  EXPECT_LT(photo.at("share").get<double>(), 0.3);
  EXPECT_GT(photo.at("sigma").get<double>(), 0);
  EXPECT_FALSE(photo.at("regions").empty());
  EXPECT_THAT(result.out, HasSubstr("blur shown   sharp: "));
  EXPECT_THAT(result.err, AllOf(HasSubstr("is sharp at all depths"), HasSubstr("--photo")));
  EXPECT_THAT(ContentOf(Report() + "/index.html"), HasSubstr("is sharp at all depths"));
  EXPECT_LT(found.at("residual_rms").get<double>(), 0.1 / 255);

  const json stated = Summary(With(arguments, {"--photo", "sharp"}), &result).at("photo");
  EXPECT_EQ(stated.at("verdict"), "not measured");
  EXPECT_EQ(stated.at("used_share"), 0);
  EXPECT_THAT(result.err, Not(HasSubstr("sharp at all depths")));
  const json captured = Summary(With(arguments, {"--photo", "captured"}));
  EXPECT_EQ(captured.at("photo").at("used_share"), 1);
  EXPECT_GT(captured.at("residual_rms").get<double>(), 4.0 / 255);
  fs::remove_all(Output());
  fs::remove_all(Report());
  EXPECT_THAT(Refusal(With(arguments, {"--photo", "sharp", "--solver", "blocks"}), 2),
              HasSubstr("--photo requires --solver scene"));
  EXPECT_THAT(Refusal(With(arguments, {"--photo", "blurred"}), 2), HasSubstr("--photo"));
}

// Compression removes noise and adds its own error: a photograph with the right depth is not in
// doubt because of it, and where it is in doubt, compression is named.
TEST_F(EstimateSceneTest, TheErrorOfJpegCompressionIsPartOfTheNoise) {
  const model::EncodedImage bars = Bars(128, 96);
  cv::Mat stored(bars.height_px, bars.width_px, CV_8UC(bars.channels));
  std::copy(bars.values.begin(), bars.values.end(), stored.ptr());
  io::ImageWriting writing;
  writing.jpeg_quality = 90;
  const std::string jpeg = io::EncodeImageFile(stored, io::ImageFormat::kJpeg, writing);
  const model::RawDepthMap map{128, 96, std::vector<float>(128 * 96, -0.9F), false};
  Arguments arguments = {folder_.Put("bars.jpg", jpeg),
                         folder_.Put("bars.pfm", io::EncodePfm(map)),
                         "--depth-kind",
                         "disparity",
                         "--views",
                         "5x5",
                         "--photo",
                         "captured"};
  const json summary = Summary(arguments);
  const std::optional<io::JpegError> error = io::MeasureJpegError(jpeg);
  ASSERT_TRUE(error);
  EXPECT_NEAR(summary["compression_sigma"].get<double>(), error->rms_levels / 255, 1e-6);
  EXPECT_GT(error->rms_levels, 0.1);
  EXPECT_THAT(summary["warnings"].dump(),
              AllOf(HasSubstr("of the photograph is not explained beyond its noise and JPEG "
                              "compression of"),
                    HasSubstr("is a JPEG file")));
  arguments.insert(arguments.end(), {"--disparity-scale", "0.01"});
  EXPECT_THAT(Summary(arguments)["warnings"], IsEmpty());
  arguments[0] = folder_.Put("bars.png", io::EncodePng(bars));
  EXPECT_TRUE(Summary(arguments)["compression_sigma"].is_null());
}

TEST_F(EstimateSceneTest, HolesAreReportedWithTheirShare) {
  const std::string depth = Depth([](int x, int y) {
    return x < 10 && y < 32 ? std::numeric_limits<double>::quiet_NaN() : 0.4;
  });
  ProgramResult result;
  const json summary =
      Summary({Image(), depth, "--depth-kind", "disparity", "--views", "3x3"}, &result);
  EXPECT_EQ(summary["holes_filled"], 320);
  EXPECT_NEAR(summary["holes_share"].get<double>(), 0.052, 5e-4);
  EXPECT_THAT(result.out, HasSubstr("320 px, filled along the surfaces around them (5.2 %)"));
  EXPECT_THAT(result.err, Not(HasSubstr("are not depths")));

  const std::string nearly_none = Depth([](int x, int y) {
    return x == 20 && y == 20 ? 0.4 : std::numeric_limits<double>::quiet_NaN();
  });
  Summary({Image(), nearly_none, "--depth-kind", "disparity", "--views", "3x3"}, &result);
  EXPECT_THAT(result.out, HasSubstr("(99.9 %)"));
  EXPECT_THAT(result.err, AllOf(HasSubstr("depth.pfm"), HasSubstr("are not depths")));
}

TEST_F(EstimateSceneTest, TheReportShowsEachFigureOnce) {
  const std::string depth = Depth([](int x, int y) {
    if (x > 70 && y > 50) return std::numeric_limits<double>::quiet_NaN();
    return x < 40 ? 1.5 : -0.01 * x;
  });
  const json summary = Summary(
      {Image(), depth, "--depth-kind", "disparity", "--views", "5x5", "--report", Report()});
  EXPECT_THAT(folder_.Entries(), ::testing::Contains("page"));
  const std::string html = ContentOf(Report() + "/index.html");
  const XmlDocument document = ParseXml(html);
  ASSERT_EQ(document.error, "");
  std::vector<std::string> images;
  for (const XmlElement& image : document.Named("img")) {
    EXPECT_THAT(image.Attribute("src"), ::testing::StartsWith("data:image/"));
    images.push_back(image.Attribute("alt"));
  }
  EXPECT_THAT(
      images,
      ElementsAre("The photograph through the whole aperture", "Depth map in colours",
                  "Residual of the photograph", "Confidence of the estimate", "Mosaic of the views",
                  "view, u 0, v 2", "view, u 2, v 2", "view, u 4, v 2", "Epipolar image, row 16",
                  "Epipolar image, row 32", "Epipolar image, row 48", "Refocused to +1.50 px",
                  "Refocused to +0.89 px", "Refocused to +0.28 px", "Refocused to −0.33 px",
                  "Refocused to −0.94 px"));
  for (const char* outside : {"http", "href=", "<script", "@import"})
    EXPECT_THAT(html, Not(HasSubstr(outside)));
  EXPECT_THAT(html,
              AllOf(HasSubstr("<td>total variation</td>"), HasSubstr("Hatched in grey: 325 px"),
                    HasSubstr("grey levels</td>"), HasSubstr("picture.png</td>"),
                    HasSubstr("depth.pfm (disparity)</td>"), HasSubstr("<td>srgb (assumed)</td>"),
                    HasSubstr("<td>uniform (assumed)</td>")));
  EXPECT_EQ(summary["holes_filled"], 325);
}

TEST_F(EstimateSceneTest, TheReportOfBlocksHasNoMaps) {
  Summary(With(Usual(), {"--solver", "blocks", "--report", Report(), "--device", "cpu"}));
  const std::string html = ContentOf(Report() + "/index.html");
  EXPECT_THAT(html, AllOf(HasSubstr("Mosaic of the views"), HasSubstr("ridge mu"),
                          Not(HasSubstr("Residual of the photograph"))));
}

TEST_F(EstimateSceneTest, OtherFilesBesideTheReportStay) {
  folder_.Put("page/mine.txt", "mine");
  folder_.Put("page/index.html", R"(<meta name="generator" content="thicklens, light field"/>)");
  Summary(With(Usual(), {"--report", Report()}));
  EXPECT_EQ(ContentOf(Report() + "/mine.txt"), "mine");
  EXPECT_THAT(ContentOf(Report() + "/index.html"), HasSubstr("<!DOCTYPE html>"));

  // A page of an earlier version has no tag.
  folder_.Put("page/index.html", "<style>\n:root { color-scheme: light dark; --paper: #ffffff;");
  Summary(With(Usual(), {"--report", Report()}));
  EXPECT_THAT(ContentOf(Report() + "/index.html"), HasSubstr("<!DOCTYPE html>"));
}

TEST_F(EstimateSceneTest, TheFileOfSomebodyElseIsNoReport) {
  folder_.Put("page/index.html", "<html>mine</html>");
  EXPECT_THAT(EstimateCommand::Refusal(With(Usual(), {"--report", Report()}), 1),
              HasSubstr("this file is not the page of a light field by thicklens"));
  EXPECT_EQ(ContentOf(Report() + "/index.html"), "<html>mine</html>");
}

TEST_F(EstimateSceneTest, AnInterruptLeavesNothing) {
  // Large enough to be under way when the signal comes.
  constexpr int kSize = 700;
  model::EncodedImage image{kSize, kSize, 1, 8, {}};
  model::RawDepthMap map{kSize, kSize, {}, false};
  for (int i = 0; i < kSize * kSize; ++i) {
    image.values.push_back(static_cast<std::uint16_t>(i % 1009 * 7919 % 256));
    map.values.push_back(static_cast<float>(i % kSize) * 0.003F);
  }
  ChildProgram program(
      {"estimate", folder_.Put("large.png", io::EncodePng(image)),
       folder_.Put("large.pfm", io::EncodePfm(map)), "--depth-kind", "disparity", "--tolerance",
       "1e-12", "--max-iterations", "100000", "-o", Output(), "--report", Report(), "--verbose"},
      scratch_.path(), 0);
  // Said right before the solver is started.
  while (program.Running() && ContentOf(scratch_ / "stderr").find("device") == std::string::npos) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  program.Interrupt();
  const ProgramResult result = program.Wait();
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("interrupted; nothing was written"));
  EXPECT_THAT(folder_.Entries(), ElementsAre("large.pfm", "large.png"));
}

TEST_F(EstimateSceneTest, ThreadsDoNotChangeTheViews) {
  const auto views_with = [&](const char* threads) {
    Summary(With(Usual(), {"--threads", threads, "--format", "tiff"}));
    return io::ReadLightField(Output(), {}).values;
  };
  EXPECT_EQ(views_with("1"), views_with("3"));
}

// Waves of 6 px, of which five views 1.2 px apart show nothing in the mean, beside a flat part.
TEST_F(EstimateSceneTest, ChecksTheBlurWhereItIsAskedTo) {
  constexpr int kWide = 192, kHigh = 128;
  model::EncodedImage waves{kWide, kHigh, 1, 8, {}};
  model::RawDepthMap map{kWide, kHigh, std::vector<float>(kWide * kHigh, 1.2F), false};
  std::mt19937 engine(3);
  std::normal_distribution<double> noise(0, 1);
  for (int i = 0; i < kWide * kHigh; ++i) {
    const int x = i % kWide;
    const double wave = x < kWide / 3 ? 0 : 50 * std::sin(2 * 3.14159265 * x / 6);
    waves.values.push_back(static_cast<std::uint16_t>(std::lround(120 + wave + noise(engine))));
  }
  const Arguments sharp = {folder_.Put("waves.png", io::EncodePng(waves)),
                           folder_.Put("plane.pfm", io::EncodePfm(map)),
                           "--depth-kind",
                           "disparity",
                           "--views",
                           "5x5",
                           "--threads",
                           "1"};
  EXPECT_TRUE(Summary(sharp).at("blur_check").is_null());
  ProgramResult result;
  const json summary = Summary(With(sharp, {"--check-blur", "--photo", "captured"}), &result);
  EXPECT_THAT(result.out, HasSubstr("blur check   "));
  const json& check = summary.at("blur_check");
  EXPECT_EQ(check.at("size"), json({kWide, kHigh}));
  EXPECT_GE(check.at("unexplained_blocks").get<int>(), 16);
  const json& proposal = check.at("proposal").at("narrower_blur");
  EXPECT_LT(proposal.at("disparity_scale").get<double>(), 0.9);
  EXPECT_THAT(result.err, AllOf(HasSubstr("is sharper than"), HasSubstr("--disparity-scale 0.")));
  EXPECT_THAT(summary.at("warnings").dump(), HasSubstr("is sharper than"));
  // Proposed, not applied.
  EXPECT_NEAR(summary.at("disparity").at("max_px").get<double>(), 1.2, 1e-6);
  // A photograph that has a smaller aperture is not compared with the whole one.
  EXPECT_TRUE(Summary(With(sharp, {"--check-blur", "--photo", "sharp"}), &result)
                  .at("blur_check")
                  .is_null());
  EXPECT_THAT(result.err, HasSubstr("the blur is not checked"));

  const json right = Summary(With(Usual(), {"--check-blur"}), &result);
  EXPECT_TRUE(right.at("blur_check").at("proposal").is_null());
  EXPECT_THAT(result.err, Not(HasSubstr("sharper")));
  fs::remove_all(Output());
  for (const std::string solver : {"blocks", "functional", "grid"}) {
    EXPECT_THAT(Refusal(With(sharp, {"--check-blur", "--solver", solver}), 2),
                HasSubstr("--check-blur requires --solver scene"));
  }
}

}  // namespace
}  // namespace thicklens::tools

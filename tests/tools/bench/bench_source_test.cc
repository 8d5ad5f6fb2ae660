// thicklens bench paper, thicklens bench gamma.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "thicklens/estimator/block_solver.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_io.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/thick_lens.h"
#include "tools/bench/bench_scene.h"
#include "tools/bench/bench_source_rows.h"
#include "tools/bench/bench_source_tables.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsSupersetOf;
using ::testing::Not;
using ::thicklens::testing::TemporaryFolder;
using Arguments = std::vector<std::string>;

class BenchSourceTest : public ::testing::Test {
 protected:
  nlohmann::json Rows(Arguments arguments) {
    const std::string file = folder_ / "rows.json";
    arguments.insert(arguments.begin(), "bench");
    arguments.insert(arguments.end(), {"--json", file, "--repeat", "1"});
    result_ = ChildProgram(arguments, folder_.path(), 0).Wait();
    EXPECT_EQ(result_.exit_code, 0) << result_.err;
    std::ifstream stream(file);
    const nlohmann::json json = nlohmann::json::parse(stream);
    EXPECT_EQ(json["status"], "ok");
    EXPECT_TRUE(json["machine"].contains("processor"));
    return json["rows"];
  }

  TemporaryFolder folder_;
  ProgramResult result_;
};

TEST_F(BenchSourceTest, MeasuresTheFourTables) {
  const nlohmann::json rows = Rows({"paper", "--size", "64x64", "--views", "2", "--threads", "2"});
  std::map<int, std::set<std::string>> found;
  std::map<std::string, double> psnr_db;
  for (const auto& row : rows) {
    const std::string name = row["implementation"];
    SCOPED_TRACE(row.dump());
    EXPECT_TRUE(row["failure"].is_null());
    found[row["table"]].insert(name);
    EXPECT_EQ(row["size"], nlohmann::json({64, 64}));
    EXPECT_EQ(row["seconds_of_runs"].size(), 1U);
    EXPECT_GT(row["seconds"].get<double>(), 0);
    EXPECT_TRUE(row["extrapolated_from"].is_null());
    EXPECT_TRUE(row["published_seconds"].is_null());  // the image does not have the paper's size
    if (row["table"] == 2) {
      EXPECT_GT(row["bandwidth_share"].get<double>(), 0);
      continue;
    }
    EXPECT_GT(row["psnr_true_views_db"].get<double>(), 25);
    if (row["table"] == 3) psnr_db[name] = row["psnr_true_views_db"];
    if (row["table"] == 4) {
      EXPECT_GT(row["macade_standin"].get<double>(), 0.9);
      EXPECT_LT(row["delta_e94_mean"].get<double>(), 2);
    }
  }
  EXPECT_THAT(found[1], IsSupersetOf({"opencl", "cpu", "cpu, all threads", "scene tv"}));
  EXPECT_THAT(found[2], IsSupersetOf({"opencl", "cpu", "native"}));
  EXPECT_THAT(found[3], IsSupersetOf({"eigen", "cg", "bicgstab", "scene ridge", "grid", "dibr"}));
  EXPECT_THAT(found[4], IsSupersetOf({"thick", "thin"}));
  // All solvers solve one system, so they differ in time only.
  EXPECT_NEAR(psnr_db["cg"], psnr_db["eigen"], 0.1);
  EXPECT_NEAR(psnr_db["bicgstab"], psnr_db["eigen"], 0.1);
  EXPECT_GT(psnr_db["scene tv"], psnr_db["dibr"]);
  EXPECT_THAT(result_.out, AllOf(HasSubstr("Table 1"), HasSubstr("Table 4"),
                                 HasSubstr("Machines differ"), Not(HasSubstr("extrapolated"))));
}

TEST_F(BenchSourceTest, LargeImagesAreSampledAndSaySo) {
  const nlohmann::json rows =
      Rows({"paper", "--size", "160x160", "--views", "2", "--table", "1", "--device", "cpu"});
  ASSERT_GE(rows.size(), 2U);
  for (const auto& row : rows) {
    // Every row is scored on the same four areas. Extrapolated values have keys of their own.
    EXPECT_EQ(row["scored_area"], nlohmann::json({{"parts", 4}, {"size_px", {32, 32}}}));
    const bool is_whole = row["implementation"] == "scene tv";
    EXPECT_EQ(row["seconds"].is_null(), !is_whole);
    EXPECT_EQ(row["extrapolated_seconds"].is_null(), is_whole);
    EXPECT_EQ(row["times_faster_unlike"].is_null(), row["threads"] == 1 && !is_whole);
    if (is_whole) {
      EXPECT_TRUE(row["extrapolated_from"].is_null());
    } else {
      EXPECT_EQ(row["extrapolated_from"]["blocks"], 64);
      EXPECT_EQ(row["extrapolated_from"]["of"], 100);
    }
    EXPECT_NE(row["implementation"], "opencl");
  }
  EXPECT_THAT(result_.out, HasSubstr("64 of 100 of 160x160 with 2x2 views; --full runs all"));
  EXPECT_THAT(result_.out, HasSubstr("160x160, 2 x 2 views: scores are for 4 areas of 32 x 32 px"));
  EXPECT_THAT(result_.err, HasSubstr("rows with OpenCL are left out"));
}

TEST_F(BenchSourceTest, TakesAnImageOfOnesOwn) {
  const BenchScene scene = MakeBenchScene(64, 64, 2, 2, 3, 2, {});
  const model::Camera camera_of_it = BenchCamera(64, 64);
  model::EncodedImage stored{64, 64, 1, 8, {}};
  for (const float value : scene.input.image.values) {
    stored.values.push_back(
        static_cast<std::uint16_t>(std::lround(255 * scene.input.transfer.Encode(value))));
  }
  const model::RawDepthMap depth{64, 64, std::vector<float>(64 * 64, 900), false};
  const std::string image = folder_.Put("mine.png", io::EncodePng(stored));
  const std::string map = folder_.Put("depth.pfm", io::EncodePfm(depth));
  const std::string camera = folder_.Put("camera.yaml", model::CameraToYaml(camera_of_it));
  const Arguments given = {"paper", "--image",      image, "--depth",  map,    "--depth-kind",
                           "z",     "--depth-unit", "mm",  "--camera", camera, "--views",
                           "2"};
  const nlohmann::json rows = Rows(given);
  std::set<int> tables;
  for (const auto& row : rows) {
    tables.insert(row["table"].get<int>());
    EXPECT_EQ(row["image"], "mine");
    EXPECT_TRUE(row["psnr_true_views_db"].is_null());  // its true views are unknown
  }
  EXPECT_EQ(tables, (std::set<int>{1, 2, 3, 4}));
}

TEST_F(BenchSourceTest, RefusesWhatCannotBeMeant) {
  const auto refusal = [&](const Arguments& arguments) {
    Arguments all = {"bench", "paper"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    const ProgramResult result = ChildProgram(all, folder_.path(), 0).Wait();
    EXPECT_EQ(result.exit_code, 2) << result.err;
    return result.err;
  };
  EXPECT_THAT(refusal({"--size", "M"}), HasSubstr("--size"));
  EXPECT_THAT(refusal({"--size", "32x64"}), HasSubstr("--size"));
  EXPECT_THAT(refusal({"--table", "5"}), HasSubstr("--table"));
  EXPECT_THAT(refusal({"--image", "x.png"}), HasSubstr("--depth"));
  EXPECT_THAT(refusal({"--camera", "x.yaml"}), HasSubstr("--image"));
  EXPECT_THAT(refusal({"--image", "a.png", "--depth", "b.pfm", "--size", "K"}),
              HasSubstr("--size"));
  EXPECT_THAT(refusal({"--image", "a.png", "--depth", "b.pfm", "--seed", "3"}),
              HasSubstr("--seed"));
  EXPECT_THAT(refusal({"--image", "a.png", "--depth", "b.pfm", "--table", "4"}),
              HasSubstr("--camera"));
  EXPECT_THAT(refusal({"--depth-kind", "z"}), HasSubstr("--depth-kind"));
}

// The cost of blocks grows so fast with the number of views that fewer parts represent the image.
TEST(BenchPartsTest, FewerPartsAreOfManyViewsAndStandForAsMuch) {
  SourceImage image;
  image.whole = MakeBenchScene(160, 192, 2, 2, 1, 1, {});
  const auto parts_with = [&](int views, bool full) {
    image.rects.clear();
    image.parts.clear();
    image.sample.reset();
    // The number of views of the measurement; the parts need only the scene's own number.
    image.views = views;
    Cut(full, &image);
    double pixels = 0;
    for (const BenchScene& part : image.parts) {
      pixels += static_cast<double>(part.input.image.values.size());
    }
    EXPECT_NEAR((full ? 1 : image.pixels_per_part_pixel) * pixels, 160 * 192, 1e-6);
    return image.parts.size();
  };
  EXPECT_EQ(parts_with(3, false), 4U);
  EXPECT_EQ(image.sample->solved, 64);
  EXPECT_EQ(parts_with(5, false), 2U);
  EXPECT_EQ(image.sample->solved, 32);
  // The parts are in opposite quarters and share no row and no column.
  EXPECT_LE(image.rects[0].x + image.rects[0].width, image.rects[1].x);
  EXPECT_LE(image.rects[0].y + image.rects[0].height, image.rects[1].y);
  // The comparison of lenses cuts its own parts, and as many of them.
  std::vector<SourceContender> lenses;
  AddTable4(SourceBench(), image, &lenses);
  ASSERT_EQ(lenses.size(), 2U);
  EXPECT_EQ(lenses[1].row.extrapolated->solved, 32);
  EXPECT_EQ(parts_with(7, false), 1U);
  EXPECT_EQ(image.sample->solved, 16);
  EXPECT_EQ(image.sample->all, 120);
  EXPECT_EQ(parts_with(7, true), 1U);
  EXPECT_FALSE(image.sample);
}

// Table 4 assumes this.
TEST(BenchSceneTest, ThinLensEquivalentHasTheSameGridAndDisparities) {
  model::Camera thick = BenchCamera(64, 64);
  const double focus_depth_mm = thick.focus_depth_mm();
  thick.lens.rear_focal_length_mm = 12.8;
  thick.lens.lens_thickness_mm = 3;
  thick.calibration->image_distance_mm =
      model::Estimate{model::ImageDistanceMm(thick.lens, focus_depth_mm), 0};
  const model::LightFieldGrid a = model::DefaultGrid(thick, 5, 5);
  const model::LightFieldGrid b = model::DefaultGrid(model::ThinLensEquivalent(thick), 5, 5);
  EXPECT_NEAR(a.u_step_mm, b.u_step_mm, 1e-12);
  for (const float depth_mm : {400.0F, 999.0F, 5000.0F}) {
    EXPECT_NEAR(estimator::DisparityOnGrid(a, {depth_mm}, 1, 1).disparity[0],
                estimator::DisparityOnGrid(b, {depth_mm}, 1, 1).disparity[0], 1e-6);
  }
}

TEST(SourceTableText, RowsThatCouldNotBeRunAreListed) {
  SourceRow row;
  row.table = 3;
  row.image = "L";
  row.views = 3;
  row.implementation = "viennacl";
  row.failure = "no device";
  EXPECT_THAT(SourceTableText(3, {row}), HasSubstr("viennacl           not run: no device"));
  EXPECT_EQ(SourceRowJson(row, {row})["failure"], "no device");
}

TEST(SourceTableText, PutsThePublishedBesideTheMeasured) {
  SourceRow cpu;
  cpu.table = 2;
  cpu.image = "K";
  cpu.views = 7;
  cpu.implementation = "cpu";
  cpu.seconds = {3, 1, 2};
  cpu.published = PublishedSeconds(2, "cpu", 'K', 7);
  SourceRow opencl = cpu;
  opencl.implementation = "opencl";
  opencl.seconds = {0.5};
  opencl.published = PublishedSeconds(2, "opencl", 'K', 7);
  opencl.extrapolated = BlockSample{4, 9};
  const std::string text = SourceTableText(2, {cpu, opencl});
  // 2 s measured over 0.5 s extrapolated, which is unlike; 27.4475 over 0.3325.
  EXPECT_THAT(text, ::testing::ContainsRegex("- +0.5 +0.5 .. 0.5 +- +4 +0.33 +82.5"));
  EXPECT_THAT(text, AllOf(HasSubstr("27.45"), HasSubstr("0.5 .. 0.5"), HasSubstr("1 .. 3"),
                          HasSubstr("4 of 9 of K")));
  const nlohmann::json json = SourceRowJson(opencl, {cpu, opencl});
  EXPECT_TRUE(json["times_faster"].is_null());
  EXPECT_EQ(json["times_faster_unlike"], 4);
  EXPECT_TRUE(json["seconds"].is_null());
  EXPECT_EQ(json["extrapolated_seconds"], 0.5);
  // Measured as the other, on as many threads: the same work.
  opencl.extrapolated.reset();
  EXPECT_EQ(SourceRowJson(opencl, {cpu, opencl})["times_faster"], 4);
  opencl.threads = 2;
  EXPECT_EQ(SourceRowJson(opencl, {cpu, opencl})["times_faster_unlike"], 4);
  EXPECT_EQ(json["times_faster_than"], "cpu");
  EXPECT_NEAR(json["published_seconds"].get<double>(), 0.3325, 1e-12);
  EXPECT_EQ(json["published_seconds_of_images"].size(), 4U);
  EXPECT_EQ(json["extrapolated_from"], nlohmann::json({{"blocks", 4}, {"of", 9}}));
}

TEST_F(BenchSourceTest, GammaTowardNothingLosesTheLightField) {
  const nlohmann::json rows = Rows({"gamma", "--size-px", "64", "--views", "2"});
  ASSERT_EQ(rows.size(), 24U);
  for (const auto& row : rows) {
    SCOPED_TRACE(row.dump());
    if (row["ridge"].is_null()) {  // this program's keeps every system regular
      ASSERT_TRUE(row["failure"].is_null());
      EXPECT_EQ(row["refused"], false);
      EXPECT_GT(row["psnr_true_views_db"].get<double>(), 30);
    } else {  // as in the paper, no gamma is applied
      EXPECT_EQ(row["ridge"], 0);
      EXPECT_TRUE(!row["failure"].is_null() || row["refused"] == true);
    }
  }
  EXPECT_THAT(result_.out, HasSubstr("singular to the last bit"));
}

}  // namespace
}  // namespace thicklens::tools

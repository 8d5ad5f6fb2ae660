// thicklens bench: every solver on one simulated image.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "thicklens/estimator/compare.h"
#include "tools/bench/bench_scene.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

using ::testing::HasSubstr;
using ::thicklens::testing::TemporaryFolder;

TEST(BenchScene, BlursFromNothingToThreePixels) {
  const BenchScene scene = MakeBenchScene(128, 64, 5, 3, 1, 2, {});
  EXPECT_EQ(scene.input.image.channels, 1);
  EXPECT_EQ(scene.truth.u_count, 5);
  EXPECT_EQ(scene.truth.v_count, 3);
  // sigma per axis, from the disparities: |d| times the weighted rms of the views' offsets.
  double moment = 0;
  for (int k = 0; k < 5; ++k) moment += (k - 2) * (k - 2) * scene.input.weights.col(k).sum();
  double least = 1e9, most = 0;
  for (const float d : scene.input.disparity.disparity) {
    const double sigma_px = std::abs(d * scene.input.disparity.step.x()) * std::sqrt(moment);
    least = std::min(least, sigma_px);
    most = std::max(most, sigma_px);
  }
  EXPECT_LT(least, 0.03);
  EXPECT_NEAR(most, 3, 0.2);
}

TEST(BenchScene, ThePartInTheMiddleIsTheSameImage) {
  const BenchScene scene = MakeBenchScene(128, 96, 3, 3, 2, 2, {});
  const BenchScene middle = MiddleOf(scene, 64, 64);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      ASSERT_EQ(middle.input.image.at(x, y, 0), scene.input.image.at(x + 32, y + 16, 0));
      ASSERT_EQ(middle.input.disparity.disparity[static_cast<std::size_t>(y * 64 + x)],
                scene.input.disparity.disparity[static_cast<std::size_t>((y + 16) * 128 + x + 32)]);
    }
  }
  // The views of both are the same, so that the warped part is the part of the warped whole.
  const auto whole = estimator::WarpedLightField(scene.input, true, 2);
  const auto part = estimator::WarpedLightField(middle.input, true, 2);
  const auto cut = model::CropViews(whole, {32, 16, 64, 64});
  const auto scores = estimator::CompareLightFields(cut, part, 8, std::nullopt, 2);
  EXPECT_GT(scores.mean.psnr_db, 55);
}

TEST(Bench, MeasuresEverySolverOnTheSameScene) {
  TemporaryFolder scratch;
  const std::string file = scratch / "bench.json";
  ChildProgram program({"bench", "solvers", "--size", "96x80", "--views", "3x3", "--threads", "1",
                        "--repeat", "2", "--json", file},
                       scratch.path(), 0);
  const ProgramResult result = program.Wait();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("medians of 2"));
  std::ifstream stream(file);
  const nlohmann::json json = nlohmann::json::parse(stream);
  EXPECT_EQ(json["status"], "ok");
  EXPECT_TRUE(json["machine"].contains("processor"));
  double dibr_db = 0, ridge_db = 0;
  std::vector<std::string> solvers;
  for (const auto& row : json["rows"]) {
    solvers.push_back(row["solver"]);
    EXPECT_EQ(row["size"], nlohmann::json({96, 80}));
    EXPECT_EQ(row["views"], nlohmann::json({3, 3}));
    EXPECT_EQ(row["threads"], 1);
    // Measured and extrapolated values never have the same key, nor do PSNRs of the part that
    // blocks solved and of the whole image.
    const bool is_sampled = row["solver"] == "blocks";
    const std::string time = is_sampled ? "extrapolated_seconds" : "seconds";
    EXPECT_GT(row[time].get<double>(), 0);
    EXPECT_EQ(row[time + "_of_runs"].size(), 2U);
    EXPECT_TRUE(row[is_sampled ? "seconds" : "extrapolated_seconds"].is_null());
    EXPECT_EQ(row["extrapolated_from"].is_null(), !is_sampled);
    EXPECT_EQ(row["times_faster"].is_null(), !is_sampled);
    EXPECT_EQ(row["times_faster_extrapolated"].is_null(), is_sampled);
    EXPECT_EQ(row["psnr_db"].is_null(), is_sampled);
    EXPECT_GT(row["psnr_part_db"].get<double>(), 25);
    if (row["solver"] == "dibr") dibr_db = row["psnr_db"];
    if (row["solver"] == "scene" && row["prior"] == "ridge") ridge_db = row["psnr_db"];
  }
  EXPECT_EQ(json["part"]["rect_px"], nlohmann::json({16, 8, 64, 64}));
  EXPECT_EQ(json["part"]["scored"]["size_px"], nlohmann::json({32, 32}));
  EXPECT_THAT(result.out, ::testing::AllOf(HasSubstr("of the part"), HasSubstr("of it all"),
                                           HasSubstr("1 area of 32 x 32 px")));
  EXPECT_THAT(solvers, ::testing::IsSupersetOf({"blocks", "scene", "functional", "grid", "dibr"}));
  EXPECT_GT(ridge_db, dibr_db + 1);
}

TEST(Bench, LooksAtTheConditionOfEachDiscretisation) {
  const TemporaryFolder folder;
  const std::string json = folder / "conditioning.json";
  const ProgramResult result =
      ChildProgram({"bench", "conditioning", "--size", "4", "--json", json}, folder.path(), 0)
          .Wait();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("gamma 1e+06"));
  std::ifstream file(json);
  const nlohmann::json summary = nlohmann::json::parse(file);
  const nlohmann::json& usual = summary["rows"][0];
  EXPECT_EQ(usual["changed"], "nothing");
  EXPECT_EQ(usual["rays_warp"]["unknowns"], 16 * 9);
  EXPECT_EQ(usual["scene_points"]["unknowns"], 16);
  for (const nlohmann::json& row : summary["rows"]) {
    const bool has_ridge = row["ridge"].is_null() || row["ridge"] > 0;
    EXPECT_EQ(row["scene_points"].is_object(), has_ridge) << row["changed"];
    if (row["gamma"] == 1e6) {
      EXPECT_GT(row["rays_warp"]["condition"], 1e8);
    }
    if (has_ridge) {
      EXPECT_LT(row["scene_points"]["condition"], 1e6) << row["changed"];
    }
  }
}

TEST(Bench, RefusesASizeThatIsNone) {
  TemporaryFolder scratch;
  for (const char* size : {"32x64", "64", "axb"}) {
    ChildProgram program({"bench", "solvers", "--size", size}, scratch.path(), 0);
    const ProgramResult result = program.Wait();
    EXPECT_EQ(result.exit_code, 2) << size;
    EXPECT_THAT(result.err, HasSubstr("--size"));
  }
}

}  // namespace
}  // namespace thicklens::tools

// thicklens bench accuracy: every way to a light field, in time and in decibels.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "tools/support/child_process.h"
#include "tools/system/peak_memory.h"

namespace thicklens::tools {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using thicklens::testing::TemporaryFolder;

json ReadJson(const std::string& path) {
  std::ifstream file(path);
  return json::parse(file);
}

TEST(PeakMemory, IsThatSinceItWasForgotten) {
  const auto held_mib = ForgetPeakMemory();
  ASSERT_TRUE(held_mib.has_value());
  {
    std::vector<char> much(std::size_t{64} << 20U, 1);
    EXPECT_EQ(much[much.size() / 2], 1);
  }
  EXPECT_GT(PeakMemoryMib(), *held_mib + 60);
  const auto again_mib = ForgetPeakMemory();
  EXPECT_LT(PeakMemoryMib(), *again_mib + 30);
}

TEST(BenchAccuracy, MeasuresEveryPlanAgainstTheTrueViews) {
  const TemporaryFolder folder;
  ChildProgram program(
      {"bench", "accuracy", "--scene", "slanted", "--size-px", "64", "--views", "3", "--repeat",
       "2", "--device", "cpu", "--report", folder / "prices", "--json", folder / "prices.json"},
      folder.path(), 0);
  const ProgramResult result = program.Wait();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("slanted, 3 x 3 views"));
  const json summary = ReadJson(folder / "prices.json");
  EXPECT_GT(summary["machine"]["triad_bytes_per_second"].get<double>(), 1e8);
  EXPECT_TRUE(summary["machine"]["opencl"].is_null());
  std::map<std::string, json> rows;
  int on_front = 0;
  for (const json& row : summary["rows"]) {
    ASSERT_TRUE(row["failure"].is_null()) << row;
    rows[row["name"]] = row;
    EXPECT_EQ(row["seconds_of_runs"].size(), 2U);
    EXPECT_TRUE(row["extrapolated_from"].is_null());  // the whole is no larger than a part
    if (row["on_front"] == true) ++on_front;
    for (const json& other : summary["rows"]) {
      const bool beats = other["seconds"] < row["seconds"] &&
                         other["psnr_true_views_db"]["mean"] > row["psnr_true_views_db"]["mean"];
      EXPECT_FALSE(row["on_front"] == true && beats) << row["name"] << other["name"];
    }
  }
  EXPECT_EQ(rows.size(), summary["rows"].size());
  EXPECT_GE(on_front, 2);
  const auto psnr = [&](const std::string& name) {
    return rows.at(name)["psnr_true_views_db"]["mean"].get<double>();
  };
  EXPECT_GT(psnr("scene tv"), psnr("warping (DIBR)") + 1);
  EXPECT_NEAR(psnr("scene tv, double"), psnr("scene tv"), 0.05);
  // A looser tolerance takes no more iterations, and leaves the residual that it allows.
  const auto iterations = [&](const std::string& name) {
    return rows.at(name)["iterations"].get<int>();
  };
  EXPECT_LT(iterations("functional, tolerance 0.1"), iterations("functional, tolerance 1e-06"));
  EXPECT_LE(rows.at("functional, tolerance 0.01")["relative_residual"].get<double>(), 0.0101);
  // Direct solvers have no iterations, and alone an estimate of the condition.
  for (const auto& [name, row] : rows) {
    const bool is_direct = !row["rcond_min"].is_null();
    EXPECT_EQ(is_direct, row["iterations"].is_null() && name != "warping (DIBR)") << name;
  }
  EXPECT_TRUE(std::filesystem::exists(folder / "prices/index.html"));
  EXPECT_TRUE(std::filesystem::exists(folder / "prices/figures/prices-1.svg"));
  std::ifstream csv(folder / "prices/prices.csv");
  std::size_t lines = 0;
  for (std::string line; std::getline(csv, line);) ++lines;
  EXPECT_EQ(lines, rows.size() + 1);
}

TEST(BenchAccuracy, TakesAScenesFileAsItIs) {
  const TemporaryFolder folder;
  std::ofstream(folder / "scene.yaml") << "schema: thicklens/simulate-scene/1\n"
                                          "camera: " THICKLENS_SOURCE_DIR
                                          "/configs/cameras/case-ii.yaml\n"
                                          "truth: {focus_depth_mm: 300, blur_ratio: 0.45}\n"
                                          "size_px: [64, 48]\n"
                                          "layers:\n"
                                          "  - plane: {depth_mm: 301, slope: [0.5, 0]}\n"
                                          "    texture: {kind: noise}\n";
  ChildProgram program({"bench", "accuracy", "--scene", folder / "scene.yaml", "--views", "2",
                        "--repeat", "1", "--device", "cpu", "--json", folder / "prices.json"},
                       folder.path(), 0);
  const ProgramResult result = program.Wait();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json summary = ReadJson(folder / "prices.json");
  for (const json& row : summary["rows"]) {
    EXPECT_TRUE(row["failure"].is_null()) << row;
    EXPECT_EQ(row["scene"], folder / "scene.yaml");
  }
}

TEST(BenchAccuracy, RefusesWhatCannotBeMeant) {
  const TemporaryFolder folder;
  const auto exit_code = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"bench", "accuracy"});
    ChildProgram program(arguments, folder.path(), 0);
    return program.Wait().exit_code;
  };
  EXPECT_EQ(exit_code({"--views", "1"}), 2);
  EXPECT_EQ(exit_code({"--views", "3", "3"}), 2);
  EXPECT_EQ(exit_code({"--scene", "cards", "cards"}), 2);
  EXPECT_EQ(
      exit_code({"--scene", THICKLENS_SOURCE_DIR "/configs/scenes/demo.yaml", "--size-px", "64"}),
      2);
  EXPECT_EQ(exit_code({"--save-profile", folder / "p.json", "--device", "cpu"}), 2);
  EXPECT_EQ(exit_code({"--scene", "cards", folder / "no-such.yaml"}), 1);  // and soon
  EXPECT_EQ(exit_code({"--save-profile", folder / "p.json", "--views", "3"}), 2);
  EXPECT_EQ(exit_code({"--scene", folder / "no-such.yaml", "--views", "3"}), 1);
  EXPECT_EQ(exit_code({"--save-profile", folder / "no/such/folder/p.json"}), 1);
}

}  // namespace
}  // namespace thicklens::tools

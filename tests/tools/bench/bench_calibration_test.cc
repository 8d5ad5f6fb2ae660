// thicklens bench calibration.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "support/part_of.h"
#include "support/temporary_folder.h"
#include "tools/bench/bench_calibration_rows.h"
#include "tools/bench/bench_sweep.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::thicklens::testing::TemporaryFolder;

ProgramResult Bench(const TemporaryFolder& folder, const std::vector<std::string>& arguments) {
  std::vector<std::string> all = {"bench", "calibration"};
  all.insert(all.end(), arguments.begin(), arguments.end());
  return ChildProgram(all, folder.path(), 0).Wait();
}

CalibrationTrial SolvedTrial(double error_um, double sigma_um, double seconds) {
  CalibrationTrial trial;
  trial.outcome = calib::Outcome::kOk;
  trial.seconds = seconds;
  trial.image_distance_um = CalibrationError{error_um, sigma_um};
  return trial;
}

CalibrationTrial RefusedTrial(const std::string& reason) {
  CalibrationTrial trial;
  trial.reason = reason;
  return trial;
}

TEST(CalibrationErrors, CountIntervalsThatHoldTheTruth) {
  const CalibrationErrors errors =
      ErrorsOf({{0.5, 1.0}, {-1.0, 1.0}, {1.5, 1.0}, {-3.0, 1.0}, {7.0, std::nullopt}});
  EXPECT_EQ(errors.count, 5);
  EXPECT_EQ(errors.coverage.trials, 4);
  EXPECT_EQ(errors.coverage.inside_68, 2);
  EXPECT_EQ(errors.coverage.inside_95, 3);
  EXPECT_DOUBLE_EQ(errors.coverage.fraction_95(), 0.75);
  EXPECT_DOUBLE_EQ(errors.median_absolute, 1.5);
  EXPECT_DOUBLE_EQ(errors.root_mean_square, std::sqrt((0.25 + 1 + 2.25 + 9 + 49) / 5));
}

TEST(CalibrationRow, CountsReasonsWhoseNumbersDifferAsOne) {
  const auto reason = [](const std::string& text) {
    return MakeCalibrationRow("fit", 3, 64, {RefusedTrial(text)}).reasons.begin()->first;
  };
  EXPECT_EQ(reason("12 of 31 frames. 4.25 px, d1 2"), "# of # frames. # px, d# #");
  EXPECT_EQ(reason("ends with 7."), "ends with #.");
  EXPECT_EQ(reason("3.14"), "#");
  EXPECT_EQ(reason("none"), "none");
}

TEST(CalibrationErrors, OfNoSweepAreNotKnown) {
  EXPECT_EQ(ErrorsOf({}).count, 0);
  const CalibrationRow row =
      MakeCalibrationRow("fit", 3, 64, {RefusedTrial("has 3"), RefusedTrial("has 4")});
  EXPECT_EQ(row.refused, 2);
  EXPECT_EQ(row.reasons, (std::map<std::string, int>{{"has #", 2}}));
  EXPECT_TRUE(CalibrationRowJson(row)["image_distance_error_um"].is_null());
  EXPECT_THAT(CalibrationRowsText({row}), HasSubstr("\n2 x fit: has #\n"));
  EXPECT_THAT(CalibrationRowsCsv({row}),
              HasSubstr("\nfit,64,3,2,0,0,2,0,0,0,0,,,,,0,,,,,0,,,,,0\n"));
}

TEST(CalibrationErrors, AFractionScattersAsBinomialTrialsDo) {
  EXPECT_DOUBLE_EQ(BinomialStandardError(0.5, 100), 0.05);
  EXPECT_NEAR(BinomialStandardError(0.95, 19), 0.05, 1e-12);
}

CalibrationRow Row(double seconds, double error_um) {
  return MakeCalibrationRow("fit", 31, 64, {SolvedTrial(error_um, 1, seconds)});
}

std::vector<bool> Marked(std::vector<CalibrationRow> rows) {
  MarkFront(&rows);
  std::vector<bool> marked;
  for (const CalibrationRow& row : rows) marked.push_back(row.on_front);
  return marked;
}

TEST(MarkFront, MarksWhatNoOtherRowBetters) {
  EXPECT_THAT(Marked({Row(1, 5), Row(2, 3), Row(3, 4), Row(4, 1), Row(4, 2), Row(5, 1)}),
              ElementsAre(true, true, false, true, false, false));
  // Two equal rows are both marked.
  EXPECT_THAT(Marked({Row(1, 5), Row(1, 5)}), ElementsAre(true, true));
}

TEST(MarkFront, LeavesOutWhatMostSweepsDidNotGive) {
  const CalibrationRow half =
      MakeCalibrationRow("fit", 8, 64, {SolvedTrial(0.1, 1, 0.1), RefusedTrial("no edges")});
  EXPECT_THAT(Marked({half, Row(1, 5)}), ElementsAre(false, true));
}

// A method that refuses difficult sweeps has smaller errors on the others.
TEST(CalibrationRowsText, RowsOfFewerSweepsHaveATableOfTheirOwn) {
  const CalibrationRow all =
      MakeCalibrationRow("fit", 31, 64, {SolvedTrial(4, 1, 2), SolvedTrial(6, 1, 2)});
  const CalibrationRow fewer =
      MakeCalibrationRow("peak", 8, 64, {SolvedTrial(0.25, 1, 1), RefusedTrial("too hard")});
  EXPECT_TRUE(all.IsOfAllSweeps());
  EXPECT_FALSE(fewer.IsOfAllSweeps());
  EXPECT_THAT(Marked({fewer, all}), ElementsAre(false, true));
  const std::string text = CalibrationRowsText({all, fewer});
  const std::size_t second = text.find("These rows are from fewer sweeps");
  ASSERT_NE(second, std::string::npos);
  EXPECT_EQ(text.substr(0, second).find("0.25"), std::string::npos);
  EXPECT_THAT(text.substr(second), HasSubstr("0.25"));
  EXPECT_EQ(CalibrationRowJson(fewer)["errors_are_of_all_sweeps"], false);
}

TEST(BenchSweep, PartsAreOfTheSamePhotographs) {
  const BenchSweep bench = MakeBenchSweep(BenchSweepOptions(), {}, 96, 3);
  const calib::FocusSweep all = PartOfSweep(bench, 31, 96);
  const calib::FocusSweep part = PartOfSweep(bench, 8, 64);
  ASSERT_EQ(all.frames.size(), 31U);
  ASSERT_EQ(part.frames.size(), 8U);
  std::set<std::string> names;
  std::size_t previous = 0;
  for (std::size_t i = 0; i < part.frames.size(); ++i) {
    names.insert(part.frames[i].image);
    std::size_t same = 0;
    while (all.frames[same].image != part.frames[i].image) ++same;
    EXPECT_EQ(part.frames[i].reading_mm, all.frames[same].reading_mm);
    if (i > 0) {  // evenly spread
      EXPECT_GE(same, previous + 3);
      EXPECT_LE(same, previous + 4);
    }
    previous = same;
    const cv::Mat middle = calib::RegionOf(part.read_frame(i), part, i);
    ASSERT_EQ(middle.size(), cv::Size(64, 64));
    const cv::Mat expected = all.read_frame(same)(cv::Rect(16, 16, 64, 64));
    EXPECT_EQ(cv::countNonZero(middle != expected), 0);
  }
  EXPECT_EQ(names.size(), 8U);
}

// The error that is stated of the floor is the one that it has.
TEST(BenchSweep, TheFloorErrsAsItIsStated) {
  double squares = 0;
  constexpr int kSweeps = 200;
  model::SweepSimulationOptions small = BenchSweepOptions();
  small.frame_count = 1;
  double least_mm = 1e9, most_mm = -1e9;
  for (int i = 0; i < kSweeps; ++i) {
    const BenchSweep bench = MakeBenchSweep(small, {}, 16, static_cast<std::uint64_t>(i));
    const model::Estimate floor_px = bench.sweep.floor.given_px.value();
    squares += std::pow((floor_px.value - bench.truth.blur_floor_px) / floor_px.sigma, 2);
    least_mm = std::min(least_mm, bench.truth.frames[0].depth_mm);
    most_mm = std::max(most_mm, bench.truth.frames[0].depth_mm);
  }
  EXPECT_NEAR(std::sqrt(squares / kSweeps), 1, 0.15);
  // The plane of focus may be anywhere between two frames.
  EXPECT_NEAR(least_mm, 284.5, 0.05);
  EXPECT_NEAR(most_mm, 285.5, 0.05);
}

void ExpectCountsThatAddUp(const json& rows) {
  std::set<std::string> seen;
  for (const json& row : rows) {
    SCOPED_TRACE(row.dump());
    seen.insert(row["method"].get<std::string>() + " " + row["field_px"].dump() + " " +
                row["frames"].dump());
    EXPECT_EQ(row["sweeps"], 4);
    EXPECT_EQ(row["ok"].get<int>() + row["partial"].get<int>() + row["refused"].get<int>(), 4);
    int reported = 0;
    for (const auto& [reason, count] : row["reasons"].items()) reported += count.get<int>();
    EXPECT_EQ(row["ok"].get<int>() + reported, 4);
    ASSERT_EQ(row["seconds_of_sweeps"].size(), 4U);
    EXPECT_LE(row["seconds_least"], row["seconds"]);
    EXPECT_LE(row["seconds"], row["seconds_most"]);
  }
  EXPECT_EQ(rows.size(), 16U);
  EXPECT_EQ(seen.size(), 16U);
}

// A sweep without a calibration has a row that states the refusal.
void ExpectRefusalsToBeReported(const json& rows) {
  for (const json& row : rows) {
    const bool has_few_frames = row["frames"] == 4;
    if (!has_few_frames && row["field_px"] != 16) continue;
    SCOPED_TRACE(row.dump());
    EXPECT_EQ(row["refused"], 4);
    EXPECT_THAT(row["reasons"].begin().key(),
                HasSubstr(has_few_frames ? "at least # frames, this one has #" : "# x # px"));
    EXPECT_TRUE(row["focus_depth_error_mm"].is_null());
    EXPECT_EQ(row["pareto_front"], false);
  }
}

// The first row of a method for all frames and the larger field.
json FirstRowOf(const json& rows, const std::string& method) {
  for (const json& row : rows) {
    if (row["method"] == method && row["field_px"] == 192 && row["frames"] == 31) return row;
  }
  return {};
}

// The steps are 1 mm; of d1 that is 40 um.
void ExpectASmallErrorOfTheFit(const json& fit, const json& no_field) {
  ASSERT_EQ(fit["ok"], 4);
  EXPECT_LT(fit["focus_depth_error_mm"]["median_absolute"], 0.06);
  EXPECT_LT(fit["image_distance_error_um"]["median_absolute"], 2.4);
  EXPECT_GT(fit["image_distance_error_um"]["median_absolute"], 0);
  EXPECT_LT(fit["blur_ratio_error_percent"]["median_absolute"], 1.5);
  for (const char* quantity :
       {"focus_depth_error_mm", "image_distance_error_um", "blur_ratio_error_percent"}) {
    // The maps of field and colours change no value.
    EXPECT_EQ(fit[quantity], no_field[quantity]);
    const json& of_68 = fit[quantity]["covered_by_68_percent"];
    const json& of_95 = fit[quantity]["covered_by_95_percent"];
    for (const json* covered : {&of_68, &of_95}) {
      const auto fraction = (*covered)["fraction"].get<double>();
      EXPECT_EQ((*covered)["trials"], 4);
      EXPECT_GE(fraction, 0);
      EXPECT_LE(fraction, 1);
      EXPECT_EQ(fraction, (*covered)["inside"].get<double>() / 4);
    }
    EXPECT_GE(of_95["inside"], of_68["inside"]);
    EXPECT_GT(of_95["inside"], 0);
  }
}

void ExpectTheRecipeToBeCheapAndWrong(const json& rows) {
  const json fit = FirstRowOf(rows, "fit-no-field"), peak = FirstRowOf(rows, "peak");
  const json source = FirstRowOf(rows, "source");
  // The frame that it names is off by up to half a step, and its mean of ratios diverges.
  EXPECT_GT(source["focus_depth_error_mm"]["median_absolute"],
            2 * fit["focus_depth_error_mm"]["median_absolute"].get<double>());
  EXPECT_GT(source["blur_ratio_error_percent"]["median_absolute"], 10);
  EXPECT_TRUE(source["image_distance_error_um"]["covered_by_95_percent"].is_null());
  EXPECT_TRUE(peak["blur_ratio_error_percent"].is_null());
  EXPECT_EQ(peak["focus_depth_error_mm"]["covered_by_95_percent"]["trials"], 4);
  EXPECT_EQ(peak["seconds_of_sweeps"], source["seconds_of_sweeps"]);
  // The factor is ten, so that the test does not depend on the load of the machine.
  EXPECT_LT(source["seconds"], fit["seconds"]);
}

void ExpectNoMarkedRowToBeBettered(const json& rows) {
  int marked = 0;
  for (const json& row : rows) {
    const json& error = row["image_distance_error_um"];
    bool is_bettered = error.is_null();
    for (const json& other : rows) {
      const json& others = other["image_distance_error_um"];
      if (is_bettered || others.is_null()) continue;
      const double seconds = row["seconds"].get<double>() - other["seconds"].get<double>();
      const double error_um =
          error["median_absolute"].get<double>() - others["median_absolute"].get<double>();
      is_bettered = seconds >= 0 && error_um >= 0 && seconds + error_um > 0;
    }
    EXPECT_EQ(row["pareto_front"], !is_bettered) << row.dump();
    if (row["pareto_front"]) ++marked;
  }
  EXPECT_GE(marked, 1);
}

void ExpectTheSameRowsAsCsv(const std::string& path, const json& rows) {
  std::ifstream stream(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  ASSERT_EQ(lines.size(), 1 + rows.size());
  const auto commas = [](const std::string& line) {
    return std::count(line.begin(), line.end(), ',');
  };
  for (std::size_t i = 1; i < lines.size(); ++i) {
    SCOPED_TRACE(lines[i]);
    const json& row = rows[i - 1];
    EXPECT_EQ(commas(lines[i]), commas(lines[0]));
    const std::string begin = row["method"].get<std::string>() + "," + row["field_px"].dump();
    EXPECT_EQ(lines[i].rfind(begin + ",", 0), 0U);
    EXPECT_EQ(lines[i].back(), row["pareto_front"] ? '1' : '0');
  }
}

// One run for all, large enough for a fit, and with rows that must be refused.
TEST(BenchCalibration, MeasuresEveryMethodOnTheSameSweeps) {
  const TemporaryFolder folder;
  const std::string json_path = folder / "rows.json", report = folder / "report";
  const ProgramResult result =
      Bench(folder, {"--sweeps", "4", "--field-px", "192,16", "--frames", "31,4", "--threads", "2",
                     "--json", json_path, "--report", report});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("4 simulated sweeps"));
  EXPECT_THAT(result.out, HasSubstr("\n* "));
  EXPECT_THAT(result.out, HasSubstr("at least # frames"));
  std::ifstream stream(json_path);
  const json summary = json::parse(stream);
  EXPECT_EQ(summary["status"], "ok");
  EXPECT_TRUE(summary["machine"].contains("processor"));
  const json& rows = summary["rows"];
  ExpectCountsThatAddUp(rows);
  ExpectRefusalsToBeReported(rows);
  ExpectASmallErrorOfTheFit(FirstRowOf(rows, "fit"), FirstRowOf(rows, "fit-no-field"));
  ExpectTheRecipeToBeCheapAndWrong(rows);
  ExpectNoMarkedRowToBeBettered(rows);
  ExpectTheSameRowsAsCsv(report + "/prices.csv", rows);
}

TEST(BenchCalibrationUsage, WrongUsageIsReported) {
  const TemporaryFolder folder;
  const auto expect_usage = [&](const std::vector<std::string>& arguments,
                                const std::string& message) {
    const ProgramResult result = Bench(folder, arguments);
    EXPECT_EQ(result.exit_code, 2) << result.err;
    EXPECT_THAT(result.err, HasSubstr(message));
  };
  expect_usage({"--sweeps", "0"}, "--sweeps");
  expect_usage({"--frames", "16,32"}, "--frames: numbers from 1 to 31");
  expect_usage({"--frames", "0"}, "found 0");
  expect_usage({"--frames", "some"}, "--frames");
  expect_usage({"--field-px", "513"}, "from 16 to 512 (the sensor's shorter side)");
  expect_usage({"--field-px", "128,8"}, "found 8");
  expect_usage({"--report", folder / "a", "--json", folder / "a"}, "two outputs have this name");
}

TEST(BenchCalibrationUsage, RefusesFilesThatCannotBe) {
  const TemporaryFolder folder;
  ProgramResult result = Bench(folder, {"--sweep", folder / "none.yaml"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("none.yaml"));
  // Told before anything is measured: that would take longer than the tests may.
  result = Bench(folder, {"--sweeps", "100000", "--report", folder / "none/rows"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("none/rows"));
}

TEST(BenchCalibrationUsage, TakesADescriptionOfItsOwn) {
  const TemporaryFolder folder;
  const ProgramResult result =
      Bench(folder, {"--sweep", THICKLENS_SOURCE_DIR "/configs/sweeps/case-v.yaml", "--sweeps", "1",
                     "--field-px", "96", "--json", folder / "rows.json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  std::ifstream stream(folder / "rows.json");
  const json summary = json::parse(stream);
  EXPECT_THAT(summary["sweep"]["description"].get<std::string>(), HasSubstr("case-v.yaml"));
  EXPECT_EQ(summary["sweep"]["frames"], 7);
  EXPECT_EQ(summary["rows"][0]["frames"], 7);
  EXPECT_EQ(summary["rows"][1]["frames"], 4);
  EXPECT_EQ(summary["rows"][2]["frames"], 2);
}

TEST(BenchCalibrationUsage, AnInterruptLeavesNoFile) {
  const TemporaryFolder folder;
  ChildProgram program({"bench", "calibration", "--sweeps", "1000", "--report", folder / "rows"},
                       folder.path(), 0);
  while (program.Running() && testing::PartOf(folder.path(), "rows").empty())
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  program.Interrupt();
  const ProgramResult result = program.Wait();
  EXPECT_NE(result.exit_code, 0);
  EXPECT_THAT(result.err, HasSubstr("interrupted"));
  EXPECT_FALSE(std::filesystem::exists(folder / "rows"));
  EXPECT_EQ(testing::PartOf(folder.path(), "rows"), "");
}

}  // namespace
}  // namespace thicklens::tools

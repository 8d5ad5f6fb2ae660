// Files that `thicklens calibrate --report` leaves.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "tools/support/child_process.h"
#include "tools/support/xml_elements.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;
using Arguments = std::vector<std::string>;

// A simulated sweep that all tests share, and a folder for the outputs of one.
class CalibrateOutputs : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = std::make_unique<TemporaryFolder>();
    const std::string config = shared_->Put(
        "config.yaml", std::string("schema: thicklens/simulate-sweep/1\ncamera: ") +
                           THICKLENS_SOURCE_DIR +
                           "/configs/cameras/case-ii.yaml\n"
                           "truth: {focus_depth_mm: 300, blur_ratio: 0.45, blur_floor_px: 0.5}\n"
                           "size_px: [128, 128]\ntarget: {kind: dead-leaves, contrast: 0.6}\n"
                           "bench: {first_depth_mm: 290.4, step_mm: 2, frames: 11, offset_mm: 20, "
                           "reading_sigma_mm: 0.05}\nnoise: {full_well_electrons: 10000}\n");
    const ProgramResult result =
        Run({"simulate", "sweep", config, "-o", *shared_ / "sweep"}, *shared_);
    ASSERT_EQ(result.exit_code, 0) << result.err;
  }
  static void TearDownTestSuite() { shared_.reset(); }

  static ProgramResult Run(const Arguments& arguments, const TemporaryFolder& folder) {
    return ChildProgram(arguments, folder.path(), 0).Wait();
  }
  ProgramResult Calibrate(Arguments options) const {
    Arguments arguments = {"calibrate", *shared_ / "sweep/sweep.yaml", "--report",
                           folder_ / "out/report"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    return Run(arguments, scratch_);
  }
  std::vector<std::string> Names(const std::string& folder) const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_ / folder))
      names.push_back(entry.path().filename().string());
    return names;
  }

  static std::unique_ptr<TemporaryFolder> shared_;
  TemporaryFolder folder_, scratch_;
};

std::unique_ptr<TemporaryFolder> CalibrateOutputs::shared_;

TEST_F(CalibrateOutputs, FiguresLieBesideThePageAndAreReplaced) {
  fs::create_directories(folder_ / "out/report");
  folder_.Put("out/report/mine.txt", "mine");
  folder_.Put("out/report/figures/captions.txt", "of an older run");
  folder_.Put("out/report/figures/field.svg", "of an older run");
  folder_.Put("out/report/report.html", "of an older version");
  const ProgramResult result = Calibrate({"--no-field", "--json", folder_ / "result.json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(Names("out/report"),
              ::testing::UnorderedElementsAre("figures", "index.html", "mine.txt", "report.html"));
  EXPECT_EQ(ContentOf(folder_ / "out/report/mine.txt"), "mine");
  EXPECT_THAT(result.err, HasSubstr("report.html: this page of an older version stays"));
  const std::vector<std::string> figures = Names("out/report/figures");
  EXPECT_THAT(figures, Contains("sharpness.svg"));
  EXPECT_THAT(figures, Contains("blur.svg"));
  EXPECT_THAT(figures, Contains("mtf-through-focus.svg"));
  EXPECT_THAT(ContentOf(folder_ / "out/report/figures/mtf.csv"),
              HasSubstr("frequency_cycles_per_px,frequency_lp_per_mm_on_sensor,in focus,"));
  EXPECT_THAT(figures, Not(Contains("field.svg"))) << "it is not of this run";
  for (const std::string& name : figures) {
    const std::string content = ContentOf(folder_ / ("out/report/figures/" + name));
    if (name != "captions.txt" && name != "mtf.csv") {
      EXPECT_EQ(ParseXml(content).error, "") << name;
    }
  }
  EXPECT_THAT(ContentOf(folder_ / "out/report/figures/captions.txt"), HasSubstr("blur.svg"));
  const auto json = nlohmann::json::parse(ContentOf(folder_ / "result.json"));
  EXPECT_FALSE(json.at("field").at("done").get<bool>());
}

// The depth of field that the camera file gives is that of the calibration.
TEST_F(CalibrateOutputs, DepthOfFieldAgreesWithExplain) {
  fs::create_directories(folder_ / "out");
  const std::string camera = folder_ / "camera.yaml";
  const ProgramResult result =
      Calibrate({"--no-field", "-o", camera, "--coc-um", "20", "--json", folder_ / "result.json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("depth of field for a circle of confusion of 20 um"));
  EXPECT_THAT(result.out, HasSubstr("modelled from the fitted blur, not measured"));
  const ProgramResult explained = Run({"explain", camera, "--depth-range", "280:320", "--coc-um",
                                       "20", "--json", folder_ / "explained.json"},
                                      scratch_);
  ASSERT_EQ(explained.exit_code, 0) << explained.err;
  const auto found = nlohmann::json::parse(ContentOf(folder_ / "result.json"));
  const auto again = nlohmann::json::parse(ContentOf(folder_ / "explained.json"));
  EXPECT_EQ(found.at("focus_limits"), again.at("focus_limits"));
  EXPECT_GT(found["focus_limits"].at("near_mm").at("sigma").get<double>(), 0);
  EXPECT_EQ(found.at("mtf").at("frames").size(), 11U);
  EXPECT_EQ(found["mtf"]["in_focus"].at("origin"), "modelled");
  EXPECT_GT(found["mtf"]["in_focus"]["mtf50"].at("object_lp_per_mm").at("value").get<double>(), 0);
}

TEST_F(CalibrateOutputs, MergesTheFramesAndMeasuresTheShapeOfTheBlur) {
  fs::create_directories(folder_ / "out");
  fs::create_directories(folder_ / "psf");
  const std::string camera = folder_ / "camera.yaml";
  const ProgramResult result =
      Calibrate({"--no-field", "-o", camera, "--all-in-focus", folder_ / "merged.png",
                 "--focus-map", folder_ / "height.pfm", "--write-psf",
                 folder_ / "out/../psf/shape.yaml", "--json", folder_ / "result.json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto found = nlohmann::json::parse(ContentOf(folder_ / "result.json"));
  EXPECT_TRUE(found.at("all_in_focus").at("done").get<bool>());
  EXPECT_THAT(result.out, HasSubstr("all-in-focus image and focus map: "));
  EXPECT_TRUE(fs::exists(folder_ / "merged.png"));
  EXPECT_TRUE(fs::exists(folder_ / "height.pfm"));
  ASSERT_TRUE(found.at("measured_psf").at("done").get<bool>()) << found["measured_psf"];
  EXPECT_THAT(ContentOf(camera), HasSubstr("psf: measured\npsf_file: psf/shape.yaml\n"));
  EXPECT_THAT(ContentOf(folder_ / "psf/shape.yaml"), HasSubstr("schema: thicklens/psf/1"));
  // The camera file can be read from anywhere.
  EXPECT_EQ(Run({"explain", camera, "--depth-range", "280:320"}, scratch_).exit_code, 0);
}

TEST_F(CalibrateOutputs, RefusesNamesThatHoldNoImage) {
  fs::create_directories(folder_ / "out");
  ProgramResult result = Calibrate({"--all-in-focus", folder_ / "merged.txt"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("--all-in-focus"));
  result = Calibrate({"--focus-map", folder_ / "map.png"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("--focus-map"));
  EXPECT_THAT(result.err, HasSubstr(".pfm or .tif is expected"));
}

TEST_F(CalibrateOutputs, RefusesACircleAsLargeAsTheApertureBeforeItMeasures) {
  fs::create_directories(folder_ / "out");
  const ProgramResult result = Calibrate({"--coc-um", "100000"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("--coc-um: a circle below the diameter of the aperture"));
}

TEST_F(CalibrateOutputs, RefusesOutputsThatGreenSitesDoNotGive) {
  fs::create_directories(folder_ / "out");
  const ProgramResult result = Calibrate({"--raw", "green", "--focus-map", folder_ / "map.pfm"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("--focus-map is not made of the green sites of raw files"));
}

// The field of so small an image may have no map. The output shows whether one was tried.
TEST_F(CalibrateOutputs, NoFieldLeavesTheMapOut) {
  fs::create_directories(folder_ / "out");
  std::string message[2];
  for (const bool without : {false, true}) {
    Arguments options = {"--json", folder_ / "result.json"};
    if (without) options.emplace_back("--no-field");
    const ProgramResult result = Calibrate(options);
    ASSERT_EQ(result.exit_code, 0) << result.err;
    message[without ? 1 : 0] = nlohmann::json::parse(ContentOf(folder_ / "result.json"))
                                   .at("field")
                                   .at("message")
                                   .get<std::string>();
  }
  EXPECT_NE(message[0], "the map was not requested");
  EXPECT_EQ(message[1], "the map was not requested");
}

TEST_F(CalibrateOutputs, FilesOfOthersAmongTheFiguresStopTheRunAtOnce) {
  folder_.Put("out/report/figures/captions.txt", "of an older run");
  folder_.Put("out/report/figures/mine.svg", "mine");
  const ProgramResult result = Calibrate({});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("mine.svg"));
  EXPECT_EQ(ContentOf(folder_ / "out/report/figures/mine.svg"), "mine");
  EXPECT_THAT(Names("out/report"), ::testing::ElementsAre("figures"));
}

TEST_F(CalibrateOutputs, AnotherPageIsNotReplaced) {
  const std::string tag = R"(<meta name="generator" content="thicklens, light field"/>)";
  const std::string of_older_estimate =
      "<style>\n:root { color-scheme: light dark; --paper: #ffffff;";
  for (const std::string& page : {std::string("<html>mine</html>"), tag, of_older_estimate}) {
    folder_.Put("out/report/index.html", page);
    const ProgramResult result = Calibrate({});
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_THAT(result.err, HasSubstr("this file is not the page of a calibration by thicklens"));
    EXPECT_EQ(ContentOf(folder_ / "out/report/index.html"), page);
    EXPECT_THAT(Names("out/report"), ::testing::ElementsAre("index.html"));
  }
  folder_.Put("out/report/index.html",
              R"(<meta name="generator" content="thicklens, calibration"/>)");
  EXPECT_EQ(Calibrate({}).exit_code, 0);
  EXPECT_THAT(ContentOf(folder_ / "out/report/index.html"), HasSubstr("<!DOCTYPE html>"));
}

TEST_F(CalibrateOutputs, ADryRunLeavesNoFolder) {
  const ProgramResult result = Calibrate({"--dry-run"});
  EXPECT_EQ(result.exit_code, 1) << "the folder of the report's folder is missing";
  fs::create_directories(folder_ / "out");
  EXPECT_EQ(Calibrate({"--dry-run"}).exit_code, 0);
  EXPECT_TRUE(fs::is_empty(folder_ / "out"));
}

}  // namespace
}  // namespace thicklens::tools

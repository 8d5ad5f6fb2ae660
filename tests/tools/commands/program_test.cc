// The built program as a user sees it: exit codes, messages, and the files that it leaves.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "support/part_of.h"
#include "support/temporary_folder.h"
#include "thicklens/base/output_file.h"
#include "thicklens/io/image_io.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/sweep_file.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;
using Arguments = std::vector<std::string>;

constexpr char kErrorPrefix[] = "thicklens: error: ";
constexpr int kFrames = 11;

std::vector<std::string> LinesOf(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

// Returns the one error line without its prefix. Any other output fails the test.
std::string ErrorLine(const ProgramResult& result) {
  std::string message;
  int errors = 0;
  for (const std::string& line : LinesOf(result.err)) {
    EXPECT_THAT(line, StartsWith("thicklens: "));
    if (line.rfind(kErrorPrefix, 0) != 0) continue;
    ++errors;
    message = line.substr(std::string(kErrorPrefix).size());
  }
  EXPECT_EQ(errors, 1) << result.err;
  return message;
}

// A sweep from 290.4 to 310.4 mm with frames of `size_px` squared.
std::string SweepConfig(int size_px, int frames) {
  std::ostringstream config;
  config << "schema: thicklens/simulate-sweep/1\n"
         << "camera: " << THICKLENS_SOURCE_DIR << "/configs/cameras/case-ii.yaml\n"
         << "truth: {focus_depth_mm: 300, blur_ratio: 0.45, blur_floor_px: 0.5}\n"
         << "size_px: [" << size_px << ", " << size_px << "]\n"
         << "target: {kind: dead-leaves, contrast: 0.6}\n"
         << "bench: {first_depth_mm: 290.4, step_mm: " << 20.0 / (frames - 1)
         << ", frames: " << frames << ", offset_mm: 20, reading_sigma_mm: 0.05}\n"
         << "noise: {full_well_electrons: 10000}\n";
  return config.str();
}

std::string GreyPng(int width_px, int height_px) {
  model::EncodedImage image{width_px, height_px, 1, 8, {}};
  image.values.assign(static_cast<std::size_t>(width_px * height_px), std::uint16_t{128});
  return io::EncodePng(image);
}

// A folder for the outputs of one test, and a simulated sweep that all tests share and copy.
class ProgramTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = std::make_unique<TemporaryFolder>();
    const TemporaryFolder scratch;
    const std::string config = scratch.Put("config.yaml", SweepConfig(160, kFrames));
    const ProgramResult result =
        ChildProgram({"simulate", "sweep", config, "-o", *shared_ / "sweep"}, scratch.path(), 0)
            .Wait();
    ASSERT_EQ(result.exit_code, 0) << result.err;
  }
  static void TearDownTestSuite() { shared_.reset(); }

  // The sweep's folder, copied so that the test may spoil it.
  std::string CopySweep() const {
    fs::copy(*shared_ / "sweep", folder_ / "sweep", fs::copy_options::recursive);
    return folder_ / "sweep";
  }
  // Copies the sweep as a folder with a table: camera.yaml, frames/ and the path of the table.
  std::string CopyAsFolderWithTable() const {
    const std::string sweep = CopySweep();
    std::string rows = "file,reading\n";
    for (const auto& frame : model::ReadSweep(sweep + "/sweep.yaml", nullptr).frames)
      rows +=
          fs::path(frame.image).filename().string() + "," + std::to_string(frame.reading_mm) + "\n";
    return folder_.Put("sweep/positions.csv", rows);
  }

  ProgramResult Run(const Arguments& arguments, long max_file_bytes = 0) const {
    return ChildProgram(arguments, scratch_.path(), max_file_bytes).Wait();
  }
  // Runs a command that must fail with one line and exit code 1, and returns the line.
  std::string Failure(const Arguments& arguments, long max_file_bytes = 0) const {
    const ProgramResult result = Run(arguments, max_file_bytes);
    EXPECT_EQ(result.exit_code, 1) << result.err;
    return ErrorLine(result);
  }
  // Does the same for a calibration whose older output must stay as it is and must remain the only
  // one.
  std::string CalibrationFailure(Arguments arguments, long max_file_bytes = 0) const {
    const std::string older = "older content\n";
    const std::string output = folder_.Put("out/camera.yaml", older);
    arguments.insert(arguments.begin(), "calibrate");
    arguments.insert(arguments.end(), {"-o", output});
    const std::string message = Failure(arguments, max_file_bytes);
    EXPECT_EQ(ContentOf(output), older);
    EXPECT_EQ(std::distance(fs::directory_iterator(folder_ / "out"), fs::directory_iterator()), 1);
    return message;
  }
  std::string FolderFailure() const {
    const std::string sweep = folder_ / "sweep";
    return CalibrationFailure(
        {sweep, "--readings", sweep + "/positions.csv", "--camera", sweep + "/camera.yaml"});
  }

  static std::unique_ptr<TemporaryFolder> shared_;
  TemporaryFolder folder_;
  TemporaryFolder scratch_;
};

std::unique_ptr<TemporaryFolder> ProgramTest::shared_;

void ReplaceInFile(const std::string& path, const std::string& from, const std::string& to) {
  std::string text = ContentOf(path);
  const auto at = text.find(from);
  ASSERT_NE(at, std::string::npos) << from << " is not in " << path;
  std::ofstream(path, std::ios::binary) << text.replace(at, from.size(), to);
}

// They bring hundreds of libraries along, which take longer to load than all that the program does
// when it starts.
TEST(Program, StartsWithoutTheDecoders) {
  const TemporaryFolder folder;
  const std::string list = folder / "libraries";
  const std::string command = "LD_TRACE_LOADED_OBJECTS=1 '" THICKLENS_PROGRAM "' > '" + list + "'";
  ASSERT_EQ(std::system(command.c_str()), 0);
  EXPECT_THAT(ContentOf(list), HasSubstr("libopencv_core"));
  EXPECT_THAT(ContentOf(list), Not(HasSubstr("libopencv_imgcodecs")));
  EXPECT_THAT(ContentOf(list), Not(HasSubstr("libOpenImageIO")));
  EXPECT_THAT(ContentOf(list), Not(HasSubstr("libraw")));
}

TEST_F(ProgramTest, TheVersionListsTheLibrariesOfTheBuild) {
  const ProgramResult result = Run({"--version"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.out, AllOf(StartsWith("thicklens 0."), HasSubstr("OpenCV 4."),
                                HasSubstr("Ceres 2."), HasSubstr("Eigen 3.")));
}

TEST_F(ProgramTest, EveryCommandHasHelp) {
  for (const Arguments& command :
       {Arguments{"simulate", "sweep"}, Arguments{"calibrate"}, Arguments{"explain"},
        Arguments{"camera", "init"}, Arguments{"depth", "extract"}, Arguments{"frames", "average"},
        Arguments{"frames", "defects"}, Arguments{"undistort"}, Arguments{"mtf"},
        Arguments{"plan"}}) {
    Arguments arguments = command;
    arguments.emplace_back("--help");
    const ProgramResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, 0);
    EXPECT_THAT(result.out, AllOf(HasSubstr("--json"), HasSubstr("--threads"), HasSubstr("--quiet"),
                                  HasSubstr("--verbose")));
    EXPECT_THAT(result.err, IsEmpty());
  }
}

TEST_F(ProgramTest, WithoutACommandItPrintsTheHelp) {
  for (const Arguments& arguments : {Arguments{}, Arguments{"camera"}, Arguments{"depth"},
                                     Arguments{"frames"}, Arguments{"simulate"}}) {
    Arguments asked_for = arguments;
    asked_for.emplace_back("--help");
    const ProgramResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, 0);
    EXPECT_THAT(result.err, IsEmpty());
    EXPECT_THAT(result.out, AllOf(HasSubstr("Usage: thicklens"), Not(HasSubstr("Excludes")),
                                  Not(HasSubstr("{false}"))));
    EXPECT_EQ(result.out, Run(asked_for).out);
  }
}

TEST_F(ProgramTest, TheHelpListsTheCommandsInTheOrderOfWorkWithExamples) {
  const std::string help = Run({"--help"}).out;
  std::size_t at = help.find("Subcommands:");
  for (const char* command : {"target", "camera", "calibrate", "explain", "depth", "estimate",
                              "render", "compare", "report", "simulate", "bench", "doctor"}) {
    at = help.find(std::string("\n  ") + command + " ", at);
    ASSERT_NE(at, std::string::npos) << command;
  }
  EXPECT_NE(help.find("Examples:", at), std::string::npos);
  EXPECT_THAT(Run({"estimate", "--help"}).out, Not(HasSubstr("Examples:")));
}

TEST_F(ProgramTest, TheHelpOfEstimateHasItsOptionsInGroups) {
  const std::string help = Run({"estimate", "--help"}).out;
  EXPECT_THAT(help, Not(HasSubstr("\nOptions:")));
  std::size_t at = 0;
  for (const char* part :
       {"\nInput:", "--depth-kind", "\nQuality:", "--within", "\nOutput:", "--views",
        "\nSolver (for comparison):", "--solver", "\nRun:", "--threads", "--help"}) {
    at = help.find(part, at);
    ASSERT_NE(at, std::string::npos) << part;
  }
  EXPECT_THAT(help, HasSubstr("Required with DEPTH. Meaning of the depth map"));
  EXPECT_THAT(Run({"explain", "--help"}).out, HasSubstr("Required with --depth. Meaning"));
  EXPECT_THAT(Run({"compare", "--help"}).out, HasSubstr("Required with --dibr. Meaning"));
}

// Each command of the examples gets as far as its first file, which is missing here.
TEST_F(ProgramTest, TheExamplesOfTheHelpAreRightUsage) {
  std::istringstream help(Run({"--help"}).out);
  const std::string begin = "    thicklens ";
  int examples = 0;
  for (std::string line; std::getline(help, line);) {
    if (line.rfind(begin, 0) != 0) continue;
    ++examples;
    std::istringstream words(line.substr(begin.size()));
    Arguments arguments;
    for (std::string word; words >> word;) arguments.push_back(word);
    if (arguments.front() == "camera") arguments.back() = folder_ / "missing/camera.yaml";
    // A folder of frames that does not exist would be wrong usage of --readings.
    if (arguments.front() == "calibrate") {
      ASSERT_EQ(arguments.at(1), "sweep");
      arguments.at(1) = folder_.path();
    }
    const ProgramResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, 1) << line << "\n" << result.err;
  }
  EXPECT_EQ(examples, 5);
}

TEST_F(ProgramTest, UnknownNamesAreReportedWithTheNearestOnes) {
  EXPECT_THAT(ErrorLine(Run({"calibrat", "x"})),
              HasSubstr("unknown command 'calibrat'; did you mean calibrate?"));
  EXPECT_THAT(ErrorLine(Run({"frobnicate"})),
              AllOf(HasSubstr("unknown command 'frobnicate'"), HasSubstr("target, camera")));
  for (const Arguments& arguments : {Arguments{"estimate", "--veiws", "5x5"},
                                     Arguments{"estimate", "a", "b", "--veiws", "5x5"}}) {
    EXPECT_THAT(ErrorLine(Run(arguments)),
                HasSubstr("--veiws: unknown option of estimate; did you mean --views?"));
  }
}

TEST_F(ProgramTest, WrongUsageIsExitCode2) {
  const std::string camera = *shared_ / "sweep/camera.yaml";
  const std::string sweep = *shared_ / "sweep/sweep.yaml";
  for (const Arguments& arguments : {
           Arguments{"frobnicate"},
           Arguments{"simulate", "sweep"},
           Arguments{"calibrate", sweep, "--metod", "fit"},
           Arguments{"calibrate", sweep, "--method", "magic"},
           Arguments{"calibrate", sweep, "--roi", "1,2,3"},
           Arguments{"calibrate", sweep, "--floor-px", "-1"},
           Arguments{"calibrate", sweep, "--offset-mm", "nan"},
           Arguments{"calibrate", sweep, "--readings", "positions.csv"},
           Arguments{"calibrate", sweep, "-o", sweep},
           Arguments{"calibrate", sweep, "-o", folder_ / "x", "--json", folder_ / "x"},
           Arguments{"explain", camera},
           Arguments{"explain", camera, "--depth-range", "200:100"},
           Arguments{"explain", camera, "--depth-range", "0:100"},
           Arguments{"explain", camera, "--depth-range", "100:200:300"},
           Arguments{"explain", camera, "--depth-range", "100:200", "--threads", "-1"},
           Arguments{"camera", "init", "--focal-mm", "-3"},
           Arguments{"camera", "init", "--focal-mm", "nan"},
           Arguments{"camera", "init", "--f-number", "0"},
           Arguments{"camera", "init", "--pitch-um", "6000"},
           Arguments{"camera", "init", "--size", "640"},
           Arguments{"camera", "init", "--size", "640x0"},
           Arguments{"camera", "init", "--transfer", "log"},
       }) {
    const ProgramResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, 2) << result.err;
    ErrorLine(result);
  }
  EXPECT_THAT(folder_.Entries(), IsEmpty());
}

TEST_F(ProgramTest, AWrongOptionIsReportedWithItsValueAndTheRightOnes) {
  EXPECT_THAT(ErrorLine(Run({"camera", "init", "--pitch-um", "6000"})),
              AllOf(HasSubstr("--pitch-um"), HasSubstr("6000"), HasSubstr("micrometres")));
  EXPECT_THAT(ErrorLine(Run({"explain", "x", "--depth-range", "9:1"})),
              AllOf(HasSubstr("--depth-range"), HasSubstr("9:1"), HasSubstr("0 < NEAR < FAR")));
}

TEST_F(ProgramTest, SimulatesASweepThatCanBeRead) {
  const std::string sweep = *shared_ / "sweep";
  const model::SweepFile file = model::ReadSweep(sweep + "/sweep.yaml", nullptr);
  const model::SweepTruth truth = model::ReadSweepTruth(sweep + "/truth.yaml");
  ASSERT_EQ(file.frames.size(), static_cast<std::size_t>(kFrames));
  ASSERT_TRUE(file.offset_mm);
  EXPECT_EQ(file.offset_mm->value, 20);
  EXPECT_EQ(file.reading_sigma_mm, 0.05);
  EXPECT_NEAR(truth.focus_depth_mm, 300, 1e-9);
  const model::Camera camera = model::ReadCamera(file.camera_path);
  EXPECT_FALSE(camera.calibration) << "a calibration would not have to find anything";
  EXPECT_EQ(camera.sensor.width_px, 160);
  EXPECT_EQ(io::ReadImageFile(file.frames[3].image).size(), cv::Size(160, 160));
}

TEST_F(ProgramTest, TheSeedAloneDecidesWhatIsSimulated) {
  const std::string config = folder_.Put("config.yaml", SweepConfig(64, 5));
  const auto frame = [&](const std::string& seed, const std::string& threads) {
    const std::string out = folder_ / ("s" + seed + "t" + threads);
    EXPECT_EQ(Run({"simulate", "sweep", config, "-o", out, "--seed", seed, "--threads", threads})
                  .exit_code,
              0);
    return ContentOf(out + "/frames/frame_002.png");
  };
  const std::string first = frame("1", "1");
  EXPECT_FALSE(first.empty());
  EXPECT_EQ(first, frame("1", "3"));
  EXPECT_NE(first, frame("2", "1"));
}

TEST_F(ProgramTest, SimulationReplacesItsOwnFolderAndNoOther) {
  const std::string config = folder_.Put("config.yaml", SweepConfig(64, 5));
  const std::string out = folder_ / "sweep";
  ASSERT_EQ(Run({"simulate", "sweep", config, "-o", out}).exit_code, 0);
  EXPECT_EQ(Run({"simulate", "sweep", config, "-o", out}).exit_code, 0);
  folder_.Put("photos/mine.jpg", "mine");
  EXPECT_THAT(Failure({"simulate", "sweep", config, "-o", folder_ / "photos"}),
              HasSubstr("not replaced"));
  EXPECT_EQ(ContentOf(folder_ / "photos/mine.jpg"), "mine");
  EXPECT_THAT(folder_.Entries(), ElementsAre("config.yaml", "photos", "sweep"));
}

TEST_F(ProgramTest, CalibratesASweepAndWritesAllItsOutputs) {
  const std::string sweep = *shared_ / "sweep/sweep.yaml";
  const std::string camera = folder_ / "camera.yaml";
  const ProgramResult result = Run({"calibrate", sweep, "-o", camera, "--report",
                                    folder_ / "report", "--json", folder_ / "result.json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("image distance"));
  EXPECT_THAT(result.err, Not(HasSubstr("error")));
  const auto json = nlohmann::json::parse(ContentOf(folder_ / "result.json"));
  EXPECT_THAT((std::vector<std::string>{"ok", "partial"}), Contains(json["status"]));
  EXPECT_TRUE(json.contains("truth")) << "truth.yaml lies beside sweep.yaml";
  const model::Camera calibrated = model::ReadCamera(camera);
  ASSERT_TRUE(calibrated.calibration && calibrated.calibration->image_distance_mm);
  const model::Evidence& evidence = calibrated.calibration->evidence;
  EXPECT_EQ(evidence.method, "joint-blur-fit");
  EXPECT_EQ(evidence.data_sha256.size(), 64U);
  EXPECT_THAT(evidence.version, StartsWith("0."));
  EXPECT_THAT(evidence.date, AllOf(StartsWith("20"), EndsWith("Z")));
  EXPECT_THAT(result.out,
              EndsWith("\nwrote " + camera + ", " + (folder_ / "report") + "/index.html\n"));
  EXPECT_THAT(ContentOf(folder_ / "report/index.html"), HasSubstr("</html>"));
  EXPECT_THAT(folder_.Entries(), ElementsAre("camera.yaml", "report", "result.json"));

  const ProgramResult explained = Run({"explain", camera, "--depth-range", "250:inf"});
  EXPECT_EQ(explained.exit_code, 0) << explained.err;
  EXPECT_THAT(explained.out, HasSubstr("infinity"));
}

TEST_F(ProgramTest, TheSourcesRecipeIsMarkedAsSuch) {
  const std::string camera = folder_ / "camera.yaml";
  const ProgramResult result = Run(
      {"calibrate", *shared_ / "sweep/sweep.yaml", "--method", "paper", "-o", camera, "--quiet"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, IsEmpty());
  EXPECT_EQ(model::ReadCamera(camera).calibration->evidence.method, "source-recipe");
}

TEST_F(ProgramTest, TheSummaryStatesWhichReadingsWereRead) {
  const std::string table = CopyAsFolderWithTable();
  const std::string sweep = folder_ / "sweep";
  const ProgramResult result =
      Run({"calibrate", sweep, "--readings", table, "--camera", sweep + "/camera.yaml", "--dry-run",
           "--json", folder_ / "dry.json"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  const std::string readings = "column 2 'reading' of positions.csv, mm (no unit is stated)";
  EXPECT_THAT(result.out, HasSubstr("read from  " + readings));
  EXPECT_THAT(ContentOf(folder_ / "dry.json"), HasSubstr("\"readings\": \"" + readings));
}

TEST_F(ProgramTest, AFolderWithATableCalibratesLikeItsSweepFile) {
  const std::string table = CopyAsFolderWithTable();
  const std::string sweep = folder_ / "sweep";
  const ProgramResult result =
      Run({"calibrate", sweep, "--readings", table, "--camera", sweep + "/camera.yaml",
           "--offset-mm", "20", "--reading-sigma-mm", "0.05", "-o", folder_ / "camera.yaml"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(model::ReadCamera(folder_ / "camera.yaml").calibration);
}

TEST_F(ProgramTest, ADryRunTellsWhatItUnderstoodAndWritesNothing) {
  const std::string sweep = CopySweep();
  for (int i = 1; i < kFrames; ++i)  // no more than the first frame is opened
    folder_.Put(
        "sweep/frames/frame_0" + std::string(i < 10 ? "0" : "") + std::to_string(i) + ".png",
        "no image");
  const ProgramResult result = Run({"calibrate", sweep + "/sweep.yaml", "--dry-run", "-o",
                                    folder_ / "camera.yaml", "--report", folder_ / "report"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out,
              AllOf(HasSubstr("11 (the first one has 160 x 160 px"), HasSubstr("offset 20 mm"),
                    HasSubstr("direction away"), HasSubstr("f1 50 mm"), HasSubstr("camera.yaml"),
                    HasSubstr("290."), HasSubstr("310.")));
  EXPECT_THAT(folder_.Entries(), ElementsAre("sweep"));
}

TEST_F(ProgramTest, ADryRunFindsWhatWouldStopTheRun) {
  const std::string sweep = CopySweep();
  folder_.Put("sweep/frames/frame_000.png", GreyPng(100, 80));
  EXPECT_THAT(CalibrationFailure({sweep + "/sweep.yaml", "--dry-run"}),
              AllOf(HasSubstr("frame_000.png"), HasSubstr("100 x 80"), HasSubstr("160 x 160")));
}

TEST_F(ProgramTest, NamesAMissingSweep) {
  EXPECT_THAT(CalibrationFailure({folder_ / "none.yaml"}),
              AllOf(HasSubstr("none.yaml"), HasSubstr("No such file")));
}

TEST_F(ProgramTest, NamesAMissingFrame) {
  const std::string sweep = CopySweep();
  fs::remove(sweep + "/frames/frame_003.png");
  EXPECT_THAT(CalibrationFailure({sweep + "/sweep.yaml"}), HasSubstr("frame_003.png"));
}

TEST_F(ProgramTest, NamesAFrameThatIsNoImage) {
  const std::string sweep = CopySweep();
  folder_.Put("sweep/frames/frame_004.png", "this is a text\n");
  EXPECT_THAT(CalibrationFailure({sweep + "/sweep.yaml"}),
              AllOf(HasSubstr("frame_004.png"), HasSubstr("cannot be decoded as an image")));
}

TEST_F(ProgramTest, NamesAFrameOfAnotherSize) {
  const std::string sweep = CopySweep();
  folder_.Put("sweep/frames/frame_005.png", GreyPng(100, 80));
  EXPECT_THAT(CalibrationFailure({sweep + "/sweep.yaml"}),
              AllOf(HasSubstr("frame_005.png"), HasSubstr("100 x 80")));
}

TEST_F(ProgramTest, NamesARowWithoutFile) {
  const std::string table = CopyAsFolderWithTable();
  fs::remove(folder_ / "sweep/frames/frame_006.png");
  EXPECT_THAT(FolderFailure(), AllOf(HasSubstr("positions.csv:8"), HasSubstr("frame_006.png")));
}

TEST_F(ProgramTest, NamesAFileWithoutRow) {
  CopyAsFolderWithTable();
  folder_.Put("sweep/frames/more.png", GreyPng(160, 160));
  EXPECT_THAT(FolderFailure(), AllOf(HasSubstr("more.png"), HasSubstr("no row")));
}

TEST_F(ProgramTest, NamesADuplicateRow) {
  const std::string table = CopyAsFolderWithTable();
  std::ofstream(table, std::ios::app) << "frame_002.png,333\n";
  EXPECT_THAT(FolderFailure(), AllOf(HasSubstr("positions.csv:13"), HasSubstr("line 4")));
}

TEST_F(ProgramTest, RefusesReadingsThatAreAllEqual) {
  CopyAsFolderWithTable();
  std::string rows;
  for (int i = 0; i < kFrames; ++i)
    rows += "frame_0" + std::string(i < 10 ? "0" : "") + std::to_string(i) + ".png,300\n";
  folder_.Put("sweep/positions.csv", rows);
  EXPECT_THAT(FolderFailure(), HasSubstr("reading"));
}

TEST_F(ProgramTest, RefusesThreeFrames) {
  const std::string sweep = CopySweep();
  model::SweepFile file = model::ReadSweep(sweep + "/sweep.yaml", nullptr);
  file.frames.resize(3);
  const std::string three = folder_.Put("sweep/three.yaml", model::SweepToYaml(file));
  EXPECT_THAT(CalibrationFailure({three}), AllOf(HasSubstr("three.yaml"), HasSubstr("3")));
}

// A refusal still writes its summary and its report, but no camera.
TEST_F(ProgramTest, RefusesABlankTarget) {
  const std::string sweep = CopySweep();
  for (const auto& frame : fs::directory_iterator(sweep + "/frames"))
    folder_.Put("sweep/frames/" + frame.path().filename().string(), GreyPng(160, 160));
  const std::string camera = folder_ / "camera.yaml";
  const ProgramResult result =
      Run({"calibrate", sweep + "/sweep.yaml", "--json", folder_ / "result.json", "-o", camera,
           "--report", folder_ / "report"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("sweep.yaml: "));
  EXPECT_THAT(result.out, EndsWith("wrote " + (folder_ / "report") + "/index.html\n"));
  EXPECT_FALSE(fs::exists(camera));
  const auto json = nlohmann::json::parse(ContentOf(folder_ / "result.json"));
  EXPECT_EQ(json["status"], "refused");
  EXPECT_FALSE(json["reason"].get<std::string>().empty());
  EXPECT_EQ(json["frames"].size(), static_cast<std::size_t>(kFrames));
  EXPECT_THAT(ContentOf(folder_ / "report/index.html"), HasSubstr("</html>"));
}

TEST_F(ProgramTest, AnErrorIsWrittenToTheSummaryToo) {
  EXPECT_THAT(CalibrationFailure({folder_ / "none.yaml", "--json", folder_ / "result.json"}),
              HasSubstr("none.yaml"));
  const auto json = nlohmann::json::parse(ContentOf(folder_ / "result.json"));
  EXPECT_EQ(json["status"], "refused");
  EXPECT_THAT(json["reason"].get<std::string>(), HasSubstr("none.yaml"));
}

TEST_F(ProgramTest, NamesWhatIsWrongInACameraFileWithItsPlace) {
  const struct {
    const char *right, *wrong, *reported;
  } cases[] = {
      {"aperture_radius_mm: 8.9286", "aperture_radius_mm: -8.9286", "aperture_radius_mm"},
      {"psf: gaussian", "psf: gaussian\ncolour: red", "unknown key 'colour'"},
      {"pixel_pitch_mm: 0.0045", "pixel_pitch_um: 4.5",
       "wrong unit: this field is 'pixel_pitch_mm'"},
      {"front_focal_length_mm: 50", "front_focal_length_mm: 50 mm",
       "the unit is in the key's name"},
      {"psf: gaussian",
       "psf: gaussian\ncalibration:\n  image_distance_mm: {value: 49, sigma: 0}\n"
       "  evidence: {method: assumed}",
       "D >= f2"},
  };
  const std::string sweep = CopySweep();
  const std::string camera = sweep + "/camera.yaml";
  const std::string whole = ContentOf(camera);
  for (const auto& wrong : cases) {
    std::ofstream(camera, std::ios::binary) << whole;
    ReplaceInFile(camera, wrong.right, wrong.wrong);
    const std::string message = CalibrationFailure({sweep + "/sweep.yaml"});
    EXPECT_THAT(message, AllOf(HasSubstr("camera.yaml:"), HasSubstr(wrong.reported)));
    EXPECT_EQ(Failure({"explain", camera, "--depth-range", "250:350"}), message);
  }
}

TEST_F(ProgramTest, ExplainNamesTheMissingCalibration) {
  EXPECT_THAT(Failure({"explain", *shared_ / "sweep/camera.yaml", "--depth-range", "250:350"}),
              HasSubstr("camera.yaml is not calibrated yet: image_distance_mm and blur_ratio are "
                        "missing; run thicklens calibrate"));
}

TEST_F(ProgramTest, MakesACameraFileThatTheOtherCommandsRead) {
  const std::string camera = folder_ / "camera.yaml";
  const Arguments numbers = {"camera",     "init",    "--focal-mm",     "12.5",
                             "--f-number", "1.4",     "--pitch-um",     "6",
                             "--size",     "640x480", "--thickness-mm", "-1.5"};
  Arguments to_file = numbers;
  to_file.insert(to_file.end(), {"-o", camera});
  const ProgramResult written = Run(to_file);
  ASSERT_EQ(written.exit_code, 0);
  EXPECT_EQ(written.out, "wrote " + camera + "\n");
  EXPECT_EQ(model::ReadCamera(camera).lens.lens_thickness_mm, -1.5);
  const ProgramResult shown = Run(numbers);
  EXPECT_EQ(shown.out, ContentOf(camera));
  EXPECT_THAT(shown.err, AllOf(StartsWith("thicklens: warning: "), HasSubstr("assumed"),
                               HasSubstr("lens.rear_focal_length_mm")));
}

TEST_F(ProgramTest, AFullDiskLeavesTheOlderOutputsWhole) {
  const std::string sweep = *shared_ / "sweep/sweep.yaml";
  EXPECT_THAT(CalibrationFailure({sweep, "--quiet"}, 100),
              AllOf(HasSubstr("camera.yaml"), HasSubstr("File too large")));

  const std::string config = folder_.Put("config.yaml", SweepConfig(64, 5));
  const std::string out = folder_ / "simulated";
  ASSERT_EQ(Run({"simulate", "sweep", config, "-o", out}).exit_code, 0);
  const std::string before = ContentOf(out + "/frames/frame_002.png");
  EXPECT_THAT(Failure({"simulate", "sweep", config, "-o", out, "--seed", "2"}, 1000),
              HasSubstr("File too large"));
  EXPECT_EQ(ContentOf(out + "/frames/frame_002.png"), before);
  EXPECT_THAT(folder_.Entries(), ElementsAre("config.yaml", "out", "simulated"));
}

// Interrupted once the first frame of a long simulation is on disk.
TEST_F(ProgramTest, AnInterruptLeavesNothingHalfWritten) {
  const std::string config = folder_.Put("config.yaml", SweepConfig(400, 2000));
  ChildProgram child({"simulate", "sweep", config, "-o", folder_ / "sweep"}, scratch_.path(), 0);
  std::error_code not_yet;
  const auto is_begun = [&] {
    const fs::path frames = thicklens::testing::PartOf(folder_.path(), "sweep") + "/frames";
    return fs::exists(frames, not_yet) && !fs::is_empty(frames, not_yet);
  };
  while (child.Running() && !is_begun()) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  child.Interrupt();
  const ProgramResult result = child.Wait();
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(ErrorLine(result), StartsWith("interrupted"));
  EXPECT_THAT(folder_.Entries(), ElementsAre("config.yaml"));
}

TEST_F(ProgramTest, TwoRunsDoNotWriteTheSameOutput) {
  const OutputFile other_run(folder_ / "camera.yaml");
  EXPECT_THAT(Failure({"calibrate", *shared_ / "sweep/sweep.yaml", "-o", folder_ / "camera.yaml"}),
              AllOf(HasSubstr("camera.yaml"), HasSubstr("another run")));
  EXPECT_FALSE(fs::exists(folder_ / "camera.yaml"));
}

TEST_F(ProgramTest, NamesAnOutputFolderThatDoesNotExistBeforeItMeasures) {
  EXPECT_THAT(
      Failure({"calibrate", *shared_ / "sweep/sweep.yaml", "-o", folder_ / "none/camera.yaml"}),
      HasSubstr("none does not exist"));
}

TEST_F(ProgramTest, AFailureOfStandardOutputIsReported) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  const TemporaryFolder full;
  fs::create_symlink("/dev/full", full / "stdout");
  ChildProgram child({"camera", "init", "--focal-mm", "50", "--f-number", "2", "--pitch-um", "5",
                      "--size", "64x48"},
                     full.path(), 0);
  while (child.Running()) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  EXPECT_THAT(ContentOf(full / "stderr"),
              HasSubstr("thicklens: error: standard output cannot be written"));
}

}  // namespace
}  // namespace thicklens::tools

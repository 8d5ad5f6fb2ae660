// No output may be one of the inputs, by whatever name, and '-' is standard output or refused.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "support/temporary_folder.h"
#include "thicklens/base/output_file.h"
#include "tools/support/child_process.h"
#include "tools/system/program_run.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using thicklens::testing::ContentOf;
using thicklens::testing::TemporaryFolder;
using Words = std::vector<std::string>;

constexpr char kSmallSweep[] =
    "schema: thicklens/simulate-sweep/1\n"
    "camera: case.yaml\n"
    "truth: {focus_depth_mm: 300, blur_ratio: 0.45, blur_floor_px: 0.5}\n"
    "size_px: [64, 64]\n"
    "target: {kind: image, image: target.png}\n"
    "bench: {first_depth_mm: 290, step_mm: 4, frames: 6}\n"
    "noise: {full_well_electrons: 10000}\n";

constexpr char kSmallScene[] =
    "schema: thicklens/simulate-scene/1\n"
    "camera: case.yaml\n"
    "truth: {focus_depth_mm: 300, blur_ratio: 0.45}\n"
    "size_px: [64, 64]\n"
    "layers:\n"
    "  - plane: {depth_mm: 300}\n"
    "    texture: {kind: image, image: target.png}\n"
    "  - depth: {map: map.pfm, kind: z, unit: mm}\n"
    "    outline: {mask: mask.png}\n"
    "    texture: {kind: dead-leaves}\n";

// Inputs of every kind, made once by the program itself.
class RunFilesTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    made_ = std::make_unique<TemporaryFolder>();
    const std::string cameras = std::string(THICKLENS_SOURCE_DIR) + "/configs/cameras/";
    fs::copy_file(cameras + "case-ii.yaml", *made_ / "case.yaml");
    fs::copy_file(cameras + "macro-bench.yaml", *made_ / "calibrated.yaml");
    const std::string demo = std::string(THICKLENS_SOURCE_DIR) + "/configs/scenes/in-focus.yaml";
    MakeWithProgram({"simulate", "image", demo, "-o", *made_ / "pic"});
    MakeWithProgram({"simulate", "light-field", demo, "--views", "2x2", "-o", *made_ / "lf"});
    MakeWithProgram({"render", *made_ / "lf", "--convert", "hci", "-o", *made_ / "hci"});
    MakeWithProgram({"render", *made_ / "lf", "--view", "0,0", "-o", *made_ / "target.png"});
    fs::copy_file(*made_ / "target.png", *made_ / "mask.png");
    fs::copy_file(*made_ / "pic/depth.pfm", *made_ / "map.pfm");
    made_->Put("sw.yaml", kSmallSweep);
    made_->Put("scene.yaml", kSmallScene);
    MakeWithProgram({"simulate", "sweep", *made_ / "sw.yaml", "-o", *made_ / "sweep"});
    std::string rows = "file,reading\n";
    for (int i = 0; i < 6; ++i) {
      rows += "frame_00" + std::to_string(i) + ".png," + std::to_string(290 + 4 * i) + "\n";
    }
    made_->Put("sweep/table.csv", rows);
    made_->Put("sweep/by-table.yaml",
               "schema: thicklens/sweep/1\ncamera: camera.yaml\nframes_csv: table.csv\n"
               "frames_dir: frames\n");
    made_->Put("sweep/by-floor.yaml",
               "schema: thicklens/sweep/1\ncamera: camera.yaml\nframes_csv: table.csv\n"
               "frames_dir: frames\nblur_floor_px: {from_calibration: ../floor.yaml}\n");
    made_->Put("floor.yaml", ContentOf(*made_ / "case.yaml"));
  }
  static void TearDownTestSuite() { made_.reset(); }

  RunFilesTest() { fs::copy(made_->path(), work_ / "w", fs::copy_options::recursive); }
  std::string operator()(const std::string& name) const { return work_ / "w/" + name; }

  // Its own name, a symbolic link, a hard link and another spelling.
  std::vector<std::string> NamesOf(const std::string& input) {
    const std::string number = std::to_string(++links_);
    const std::string soft = (*this)("soft-" + number + fs::path(input).extension().string());
    const std::string hard = (*this)("hard-" + number + fs::path(input).extension().string());
    fs::create_symlink(input, soft);
    fs::create_hard_link(input, hard);
    const fs::path path(input);
    return {input, soft, hard,
            (path.parent_path() / "." / ".." / path.parent_path().filename() / path.filename())
                .string()};
  }

  ProgramRun Run(const Words& words) const {
    return RunProgram(THICKLENS_PROGRAM, words, work_.path(), 60);
  }

  // Each option that writes refuses the input, the first by each of its names, and it stays as it
  // is.
  void ExpectKept(const std::string& input, const Words& command,
                  const std::vector<std::string>& options) {
    const std::string before = ContentOf((*this)(input));
    ASSERT_FALSE(before.empty()) << input;
    for (const std::string& option : options) {
      std::vector<std::string> names = NamesOf((*this)(input));
      if (option != options.front()) names.resize(1);  // one option shows the other names
      for (const std::string& name : names) {
        Words words = command;
        words.insert(words.end(), {option, name});
        SCOPED_TRACE(ShellCommand(words));
        const ProgramRun run = Run(words);
        EXPECT_EQ(run.exit_code, 2) << run.err;
        // Another kind of file than the option writes is refused before.
        EXPECT_THAT(run.err,
                    AnyOf(HasSubstr("would be overwritten"), HasSubstr("lies in the light field"),
                          HasSubstr("the ending of an image file is expected")));
        EXPECT_EQ(ContentOf((*this)(input)), before);
      }
    }
  }

  static std::unique_ptr<TemporaryFolder> made_;
  TemporaryFolder work_;
  int links_ = 0;
};

std::unique_ptr<TemporaryFolder> RunFilesTest::made_;

TEST_F(RunFilesTest, CalibrateKeepsWhatItsSweepNames) {
  const Words command = {"calibrate", (*this)("sweep"), "--no-field"};
  for (const char* input : {"sweep/sweep.yaml", "sweep/camera.yaml", "sweep/truth.yaml",
                            "sweep/frames/frame_003.png"}) {
    ExpectKept(input, command, {"-o", "--json"});
  }
  ExpectKept("sweep/frames/frame_003.png", {"calibrate", (*this)("sweep"), "--dry-run"}, {"-o"});
}

TEST_F(RunFilesTest, CalibrateKeepsWhatItsTableNames) {
  const Words folder = {"calibrate",  (*this)("sweep/frames"),
                        "--readings", (*this)("sweep/table.csv"),
                        "--camera",   (*this)("sweep/camera.yaml")};
  for (const char* input : {"sweep/table.csv", "sweep/camera.yaml", "sweep/frames/frame_000.png"}) {
    ExpectKept(input, folder, {"-o", "--json"});
  }
  const Words by_file = {"calibrate", (*this)("sweep/by-table.yaml")};
  for (const char* input : {"sweep/table.csv", "sweep/camera.yaml", "sweep/frames/frame_000.png"}) {
    ExpectKept(input, by_file, {"-o", "--json"});
  }
  ExpectKept("floor.yaml", {"calibrate", (*this)("sweep/by-floor.yaml")}, {"-o", "--json"});
  ExpectKept("floor.yaml", {"calibrate", (*this)("sweep"), "--floor-from", (*this)("floor.yaml")},
             {"-o", "--json"});
}

TEST_F(RunFilesTest, SimulateKeepsWhatItsDescriptionNames) {
  const std::string out = work_ / "new";
  for (const char* input : {"sw.yaml", "case.yaml", "target.png"}) {
    ExpectKept(input, {"simulate", "sweep", (*this)("sw.yaml"), "-o", out}, {"--json"});
  }
  for (const char* what : {"image", "light-field"}) {
    for (const char* input : {"scene.yaml", "case.yaml", "target.png", "mask.png", "map.pfm"}) {
      ExpectKept(input, {"simulate", what, (*this)("scene.yaml"), "-o", out}, {"--json"});
    }
  }
  ExpectKept("sw.yaml",
             {"simulate", "image", (*this)("scene.yaml"), "--ablate", "--sweep", (*this)("sw.yaml"),
              "-o", out},
             {"--json"});
  EXPECT_FALSE(fs::exists(out));
}

// A link to a file that is still to be made names that file: once the camera is written, the link
// would lead to it, and the summary would take its place.
TEST_F(RunFilesTest, ALinkToAnotherOutputIsThatOutput) {
  const std::string out = work_ / "new.yaml";
  fs::create_symlink("new.yaml", work_ / "link.json");
  fs::create_symlink("link.json", work_ / "twice.json");
  for (const char* link : {"link.json", "twice.json"}) {
    const ProgramRun run = Run({"calibrate", (*this)("sweep"), "-o", out, "--json", work_ / link});
    EXPECT_EQ(run.exit_code, 2) << run.err;
    EXPECT_THAT(run.err, HasSubstr("two outputs have this name"));
    EXPECT_FALSE(fs::exists(out));
  }
}

TEST_F(RunFilesTest, LightFieldsAreKept) {
  const Words renders = {"render", (*this)("lf"), "--as-captured"};
  for (const char* input : {"lf/lightfield.yaml", "lf/camera.yaml", "lf/views/view_01_00.png"}) {
    ExpectKept(input, renders, {"-o"});
    ExpectKept(input, {"render", (*this)("lf"), "--mosaic", "-o", work_ / "new.png"}, {"--json"});
    ExpectKept(input, {"compare", (*this)("lf"), (*this)("lf")}, {"--json"});
    ExpectKept(input, {"report", (*this)("lf")}, {"-o"});
  }
  for (const char* input : {"hci/input_Cam001.png", "hci/parameters.cfg"}) {
    ExpectKept(input, {"render", (*this)("hci"), "--as-captured"}, {"-o"});
  }
  // A view that is a link to a file outside.
  fs::rename((*this)("lf/views/view_00_00.png"), (*this)("outside.png"));
  fs::create_symlink((*this)("outside.png"), (*this)("lf/views/view_00_00.png"));
  ExpectKept("outside.png", renders, {"-o"});
}

TEST_F(RunFilesTest, EstimateKeepsItsInputs) {
  const Words command = {"estimate",
                         (*this)("pic/picture.png"),
                         (*this)("pic/depth.pfm"),
                         "--depth-kind",
                         "z",
                         "--depth-unit",
                         "mm",
                         "--camera",
                         (*this)("pic/camera.yaml"),
                         "--solver",
                         "blocks"};
  for (const char* input : {"pic/picture.png", "pic/depth.pfm", "pic/camera.yaml"}) {
    Words with_output = command;
    with_output.insert(with_output.end(), {"-o", work_ / "new"});
    ExpectKept(input, with_output, {"--json", "--checkpoint"});
  }
  // The folder is replaced as a whole.
  const ProgramRun run = [&] {
    Words into = command;
    into.insert(into.end(), {"-o", (*this)("pic")});
    return Run(into);
  }();
  EXPECT_EQ(run.exit_code, 2) << run.err;
  EXPECT_THAT(run.err, HasSubstr("this folder holds the input"));
  EXPECT_TRUE(fs::exists((*this)("pic/picture.png")));
}

TEST_F(RunFilesTest, TheOtherCommandsKeepTheirInputs) {
  const std::string image = (*this)("target.png");
  ExpectKept("calibrated.yaml", {"explain", (*this)("calibrated.yaml"), "--depth-range", "290:310"},
             {"--json", "--figure"});
  ExpectKept("map.pfm",
             {"explain", (*this)("calibrated.yaml"), "--depth", (*this)("map.pfm"), "--depth-kind",
              "z", "--depth-unit", "mm"},
             {"--json", "--figure"});
  ExpectKept("target.png", {"compare", image, (*this)("mask.png")}, {"--json"});
  ExpectKept("target.png", {"camera", "init", "--from-exif", image}, {"-o", "--json"});
  ExpectKept(
      "case.yaml",
      {"target", "--camera", (*this)("case.yaml"), "--distance-mm", "300", "-o", work_ / "new.pdf"},
      {"--json"});
  ExpectKept("sw.yaml", {"bench", "calibration", "--sweep", (*this)("sw.yaml")}, {"--json"});
  ExpectKept("case.yaml", {"bench", "calibration", "--sweep", (*this)("sw.yaml")}, {"--json"});
  ExpectKept("scene.yaml", {"bench", "accuracy", "--scene", (*this)("scene.yaml")}, {"--json"});
  ExpectKept("target.png",
             {"bench", "paper", "--image", image, "--depth", (*this)("map.pfm"), "--depth-kind",
              "disparity"},
             {"--json"});
  // No frame that the page shows, but one of the sweep.
  ExpectKept("sweep/frames/frame_001.png",
             {"report", (*this)("lf"), "--sweep", (*this)("sweep"), "--photo", image}, {"-o"});
}

// A run that is refused early does not know all of its inputs.
TEST_F(RunFilesTest, ARefusalIsNotWrittenOverWhatIsNoSummary) {
  const std::string frame = (*this)("sweep/frames/frame_002.png");
  const std::string before = ContentOf(frame);
  work_.Put("w/sweep/sweep.yaml", "schema: thicklens/sweep/1\ncamera: [\n");
  const ProgramRun run = Run({"calibrate", (*this)("sweep"), "--json", frame});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.err, AllOf(HasSubstr("is not overwritten"), HasSubstr("not valid YAML")));
  EXPECT_EQ(ContentOf(frame), before);
  const std::string older = work_.Put("older.json", "{\"status\": \"ok\"}\n");
  EXPECT_EQ(Run({"calibrate", (*this)("sweep"), "--json", older}).exit_code, 1);
  EXPECT_EQ(nlohmann::json::parse(ContentOf(older))["status"], "refused");
}

TEST_F(RunFilesTest, OutputsAreApart) {
  const std::string camera = (*this)("calibrated.yaml");
  const Words explain = {"explain", camera, "--depth-range", "290:310", "--quiet"};
  Words same = explain;
  same.insert(same.end(), {"--figure", work_ / "a.svg", "--json", work_ / "w/../a.svg"});
  EXPECT_EQ(Run(same).exit_code, 2);
  const ProgramRun run = Run({"render", (*this)("hci"), "--convert", "thicklens", "-o",
                              (*this)("lf"), "--json", (*this)("lf/summary.json")});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, HasSubstr("lies in the output folder"));
  // The folder of the frames is a good place for the results.
  Words beside = explain;
  beside.insert(beside.end(), {"--json", (*this)("sweep/explained.json")});
  EXPECT_EQ(Run(beside).exit_code, 0);
}

TEST_F(RunFilesTest, ADashIsStandardOutputForSummaries) {
  const std::string camera = (*this)("calibrated.yaml");
  const ProgramRun run = Run({"explain", camera, "--depth-range", "290:310", "--json", "-"});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(nlohmann::json::parse(run.out)["status"], "ok");
  const ProgramRun refused =
      Run({"explain", camera + "x", "--depth-range", "290:310", "--json", "-"});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_EQ(nlohmann::json::parse(refused.out)["status"], "refused");
  const Words init = {"camera",     "init", "--focal-mm", "50",    "--f-number", "2",
                      "--pitch-um", "5",    "--size",     "64x48", "-o",         "-"};
  EXPECT_THAT(Run(init).out, StartsWith("schema: thicklens/camera/"));
  Words both = init;
  both.insert(both.end(), {"--json", "-"});
  EXPECT_EQ(Run(both).exit_code, 2);
  EXPECT_FALSE(fs::exists(work_ / "-"));
}

TEST_F(RunFilesTest, ADashIsRefusedWhereItCannotBeStandardOutput) {
  const std::string sweep = (*this)("sweep"), camera = (*this)("calibrated.yaml");
  const std::string lf = (*this)("lf");
  const Words estimate = {"estimate",
                          (*this)("pic/picture.png"),
                          (*this)("pic/depth.pfm"),
                          "--depth-kind",
                          "disparity",
                          "--solver",
                          "blocks"};
  const auto with = [](Words words, const Words& more) {
    words.insert(words.end(), more.begin(), more.end());
    return words;
  };
  for (const Words& words :
       {Words{"calibrate", sweep, "-o", "-"}, Words{"calibrate", sweep, "--report", "-"},
        Words{"render", lf, "--mosaic", "-o", "-"},
        Words{"render", lf, "--convert", "hci", "-o", "-"}, Words{"report", lf, "-o", "-"},
        Words{"simulate", "sweep", (*this)("sw.yaml"), "-o", "-"},
        Words{"simulate", "image", (*this)("scene.yaml"), "-o", "-"},
        Words{"simulate", "light-field", (*this)("scene.yaml"), "-o", "-"},
        Words{"explain", camera, "--depth-range", "290:310", "--figure", "-"},
        Words{"target", "-o", "-"}, Words{"bench", "calibration", "--report", "-"},
        Words{"bench", "accuracy", "--report", "-"},
        Words{"bench", "accuracy", "--save-profile", "-"},
        Words{"doctor", "--hard-cases", "--keep", "-"}, with(estimate, {"-o", "-"}),
        with(estimate, {"-o", work_ / "new", "--report", "-"}),
        with(estimate, {"-o", work_ / "new", "--checkpoint", "-"})}) {
    SCOPED_TRACE(ShellCommand(words));
    const ProgramRun run = Run(words);
    EXPECT_THAT(run.exit_code, AnyOf(1, 2)) << run.err;
    EXPECT_FALSE(run.timed_out);
    EXPECT_FALSE(fs::exists(work_ / "-"));
    EXPECT_THAT(run.err, HasSubstr("-"));
  }
  EXPECT_FALSE(fs::exists(work_ / "new"));
}

}  // namespace
}  // namespace thicklens::tools

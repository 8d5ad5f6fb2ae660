// Every reader of a file refuses at once what is not a regular file, and names its kind.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/base/output_file.h"
#include "thicklens/io/block_checkpoint.h"
#include "tools/support/child_process.h"
#include "tools/system/program_run.h"

namespace thicklens::io {
namespace {

using tools::ChildProgram;
using tools::MakeWithProgram;
using tools::ProgramResult;
using tools::ProgramRun;
using tools::RunProgram;
using tools::ShellCommand;
namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using thicklens::testing::ErrorOf;
using thicklens::testing::TemporaryFolder;
using Words = std::vector<std::string>;

constexpr double kMaxSecondsToRefuse = 30;

class InputKinds : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    made_ = std::make_unique<TemporaryFolder>();
    const std::string configs = std::string(THICKLENS_SOURCE_DIR) + "/configs/";
    fs::copy_file(configs + "cameras/case-ii.yaml", *made_ / "case.yaml");
    fs::copy_file(configs + "cameras/macro-bench.yaml", *made_ / "calibrated.yaml");
    const std::string scene = configs + "scenes/in-focus.yaml";
    MakeWithProgram({"simulate", "image", scene, "-o", *made_ / "pic"});
    MakeWithProgram({"simulate", "light-field", scene, "--views", "2x2", "-o", *made_ / "lf"});
    MakeWithProgram({"render", *made_ / "lf", "--convert", "hci", "-o", *made_ / "hci"});
    made_->Put("frames/a.png", ReadWholeFile(*made_ / "pic/picture.png"));
    made_->Put("table.csv", "a.png,300\n");
    made_->Put("sweep.yaml",
               "schema: thicklens/sweep/1\ncamera: case.yaml\n"
               "frames: [{image: frames/a.png, reading_mm: 300}]\n");
    made_->Put("sw.yaml",
               "schema: thicklens/simulate-sweep/1\ncamera: case.yaml\n"
               "truth: {focus_depth_mm: 300, blur_ratio: 0.45, blur_floor_px: 0.5}\n"
               "size_px: [64, 64]\ntarget: {kind: image, image: frames/a.png}\n"
               "bench: {first_depth_mm: 290, step_mm: 4, frames: 6}\n");
    made_->Put("scene.yaml",
               "schema: thicklens/simulate-scene/1\ncamera: case.yaml\n"
               "truth: {focus_depth_mm: 300, blur_ratio: 0.45}\nsize_px: [64, 64]\n"
               "layers:\n  - plane: {depth_mm: 300}\n"
               "    texture: {kind: image, image: frames/a.png}\n");
    made_->Put("record.json", "{}");
    made_->Put("page.html", "<html></html>");
  }
  static void TearDownTestSuite() { made_.reset(); }
  InputKinds() { fs::copy(made_->path(), work_ / "w", fs::copy_options::recursive); }
  std::string operator()(const std::string& name) const { return work_ / "w/" + name; }

  // The command reads the file, which is a pipe and then a device.
  void ExpectRefused(const std::string& input, const Words& command) {
    const std::string path = (*this)(input);
    const std::string aside = (*this)("aside");
    fs::rename(path, aside);
    ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
    ExpectOne(path, command, "a named pipe");
    fs::remove(path);
    fs::create_symlink("/dev/zero", path);
    ExpectOne(path, command, "a character device");
    fs::remove(path);
    fs::rename(aside, path);
  }
  void ExpectOne(const std::string& path, const Words& command, const std::string& kind) {
    SCOPED_TRACE(ShellCommand(command) + " with " + path + " as " + kind);
    const ProgramRun run =
        RunProgram(THICKLENS_PROGRAM, command, work_.path(), kMaxSecondsToRefuse);
    EXPECT_FALSE(run.timed_out);
    EXPECT_EQ(run.exit_code, 1) << run.err;
    EXPECT_THAT(run.err, AllOf(HasSubstr(fs::path(path).filename().string()), HasSubstr(kind)));
  }

  static std::unique_ptr<TemporaryFolder> made_;
  TemporaryFolder work_;
};

std::unique_ptr<TemporaryFolder> InputKinds::made_;

TEST_F(InputKinds, CalibrateRefusesPipesAndDevices) {
  for (const char* input : {"sweep.yaml", "case.yaml", "frames/a.png"})
    ExpectRefused(input, {"calibrate", (*this)("sweep.yaml")});
  ExpectRefused("table.csv", {"calibrate", (*this)("frames"), "--readings", (*this)("table.csv"),
                              "--camera", (*this)("case.yaml")});
  ExpectRefused("record.json",
                {"calibrate", (*this)("sweep.yaml"), "--truth", (*this)("record.json")});
  ExpectRefused("calibrated.yaml",
                {"calibrate", (*this)("sweep.yaml"), "--floor-from", (*this)("calibrated.yaml")});
}

TEST_F(InputKinds, SimulateRefusesPipesAndDevices) {
  const std::string out = work_ / "new";
  for (const char* input : {"sw.yaml", "case.yaml", "frames/a.png"})
    ExpectRefused(input, {"simulate", "sweep", (*this)("sw.yaml"), "-o", out});
  for (const char* input : {"scene.yaml", "case.yaml", "frames/a.png"})
    ExpectRefused(input, {"simulate", "image", (*this)("scene.yaml"), "-o", out});
  EXPECT_FALSE(fs::exists(out));
}

TEST_F(InputKinds, EstimateRefusesPipesAndDevices) {
  const Words command = {"estimate",
                         (*this)("pic/picture.png"),
                         (*this)("pic/depth.pfm"),
                         "--depth-kind",
                         "z",
                         "--depth-unit",
                         "mm",
                         "--camera",
                         (*this)("pic/camera.yaml"),
                         "-o",
                         work_ / "new"};
  for (const char* input : {"pic/picture.png", "pic/depth.pfm", "pic/camera.yaml"})
    ExpectRefused(input, command);
  Words by_profile = command;
  by_profile.insert(by_profile.end(), {"--quality", "draft", "--profile", (*this)("record.json")});
  ExpectRefused("record.json", by_profile);
  EXPECT_FALSE(fs::exists(work_ / "new"));
}

TEST_F(InputKinds, CommandsOfLightFieldsRefusePipesAndDevices) {
  for (const char* input : {"lf/lightfield.yaml", "lf/camera.yaml", "lf/views/view_01_00.png"})
    ExpectRefused(input, {"render", (*this)("lf"), "--mosaic", "-o", work_ / "new.png"});
  for (const char* input : {"hci/input_Cam001.png", "hci/parameters.cfg"})
    ExpectRefused(input, {"render", (*this)("hci"), "--mosaic", "-o", work_ / "new.png"});
  const Words report = {"report", (*this)("lf"), "-o", work_ / "new.html"};
  const auto with = [&](const std::string& option, const std::string& input) {
    Words words = report;
    words.insert(words.end(), {option, (*this)(input)});
    ExpectRefused(input, words);
  };
  with("--estimate", "record.json");
  with("--comparison", "record.json");
  with("--calibration", "page.html");
  with("--photo", "pic/picture.png");
  with("--sweep", "sweep.yaml");
}

TEST_F(InputKinds, OtherCommandsRefusePipesAndDevices) {
  const std::string image = (*this)("pic/picture.png");
  ExpectRefused("calibrated.yaml",
                {"explain", (*this)("calibrated.yaml"), "--depth-range", "280:320"});
  ExpectRefused("frames/a.png", {"compare", (*this)("frames/a.png"), image, "--border", "0"});
  ExpectRefused("frames/a.png", {"camera", "init", "--from-exif", (*this)("frames/a.png")});
  ExpectRefused("case.yaml", {"target", "--camera", (*this)("case.yaml"), "--distance-mm", "300",
                              "-o", work_ / "new.pdf"});
  ExpectRefused("sw.yaml", {"bench", "calibration", "--sweep", (*this)("sw.yaml")});
  ExpectRefused("scene.yaml", {"bench", "accuracy", "--scene", (*this)("scene.yaml")});
}

TEST_F(InputKinds, ResumedEstimatesRefusePipesAndDevices) {
  const std::string path = work_ / "checkpoint";
  ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
  EXPECT_THAT(ErrorOf([&] { BlockCheckpoint file(path, "a version"); }), HasSubstr("a named pipe"));
  EXPECT_THAT(ErrorOf([] { BlockCheckpoint file("/dev/zero", "a version"); }),
              HasSubstr("a character device"));
  EXPECT_THAT(ErrorOf([] { BlockCheckpoint file("-", "a version"); }),
              HasSubstr("standard output"));
  fs::create_symlink("ring", work_ / "ring");
  EXPECT_THAT(ErrorOf([&] { BlockCheckpoint file(work_ / "ring", "a version"); }),
              HasSubstr("not a regular file but a symbolic link"));
}

}  // namespace
}  // namespace thicklens::io

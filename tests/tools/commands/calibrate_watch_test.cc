// thicklens calibrate --watch, as a person starts it. What the frames show is tested with a clock
// of the test's own (FolderWatchTest); here the folder is complete, or ends by a signal.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "support/temporary_folder.h"
#include "thicklens/simulate.h"
#include "tools/support/bench_simulation.h"
#include "tools/support/child_process.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;
using thicklens::testing::ContentOf;
using thicklens::testing::SmallBenchSimulation;
using thicklens::testing::TemporaryFolder;

class CalibrateWatch : public ::testing::Test {
 protected:
  CalibrateWatch() {
    const Sweep sweep = SimulateSweep(SmallBenchSimulation(), folder_ / "sweep");
    camera_ = sweep.description.camera_path;
    fs::create_directories(frames_);
    std::ofstream table(table_);
    table << "file,reading_mm\n";
    for (const model::SweepFrame& frame : sweep.description.frames) {
      fs::copy(frame.image, frames_);
      table << fs::path(frame.image).filename().string() << "," << frame.reading_mm << "\n";
    }
  }
  std::vector<std::string> Arguments(const std::vector<std::string>& more) const {
    std::vector<std::string> arguments = {"calibrate",  frames_,      "--readings",  table_,
                                          "--camera",   camera_,      "--offset-mm", "20",
                                          "--no-field", "--floor-px", "0.5:0.01"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
  ProgramResult Run(const std::vector<std::string>& more) const {
    return ChildProgram(Arguments(more), folder_.path(), 0).Wait();
  }
  nlohmann::json Json() const { return nlohmann::json::parse(ContentOf(folder_ / "out.json")); }

  TemporaryFolder folder_;
  std::string frames_ = folder_ / "frames", table_ = folder_ / "table.csv", camera_;
};

TEST_F(CalibrateWatch, GivesTheResultOfTheFolder) {
  folder_.Put("frames/done");
  const ProgramResult watched =
      Run({"--watch", "-o", folder_ / "camera.yaml", "--json", folder_ / "out.json"});
  ASSERT_EQ(watched.exit_code, 0) << watched.err;
  EXPECT_THAT(watched.out, HasSubstr("frame_000.png: reading "));
  EXPECT_THAT(watched.out, HasSubstr("focus at reading 2"));
  EXPECT_THAT(watched.out, HasSubstr("ended by the file done: 10 frames, 10 of them usable"));
  const nlohmann::json json = Json();
  EXPECT_EQ(json.at("watch").at("ended_by"), "the file done");
  EXPECT_EQ(json.at("watch").at("frames").size(), 10U);
  const ProgramResult direct = Run({"--json", folder_ / "out.json"});
  ASSERT_EQ(direct.exit_code, 0) << direct.err;
  EXPECT_EQ(json.at("focus_depth_mm"), Json().at("focus_depth_mm"));
  EXPECT_EQ(json.at("blur_ratio"), Json().at("blur_ratio"));
  EXPECT_FALSE(Json().contains("watch"));
}

TEST_F(CalibrateWatch, IsSilentIfAsked) {
  folder_.Put("frames/done");
  const ProgramResult quiet = Run({"--watch", "--quiet", "-o", folder_ / "camera.yaml"});
  EXPECT_EQ(quiet.exit_code, 0) << quiet.err;
  EXPECT_EQ(quiet.out, "");
  EXPECT_TRUE(fs::exists(folder_ / "camera.yaml"));
  const ProgramResult json = Run({"--watch", "--json", "-"});
  EXPECT_EQ(json.exit_code, 0) << json.err;
  EXPECT_EQ(nlohmann::json::parse(json.out).at("watch").at("frames").size(), 10U);
}

// Without a way to end, one interrupt ends the sweep, with its result.
TEST_F(CalibrateWatch, AnInterruptEndsTheSweep) {
  ChildProgram program(Arguments({"--watch", "-o", folder_ / "camera.yaml"}), folder_.path(), 0);
  // It has begun to watch once it has printed its first line.
  const std::string out = folder_ / "stdout";
  const auto start = std::chrono::steady_clock::now();
  while (program.Running() && ContentOf(out).find("10 usable") == std::string::npos) {
    ASSERT_LT(std::chrono::steady_clock::now() - start, std::chrono::minutes(5)) << ContentOf(out);
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  program.Interrupt();
  const ProgramResult result = program.Wait();
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("ended by an interrupt: 10 frames"));
  EXPECT_TRUE(fs::exists(folder_ / "camera.yaml"));
}

TEST_F(CalibrateWatch, APauseEndsTheSweep) {
  const ProgramResult result = Run({"--watch", "--watch-pause", "1.5s"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("ended by a pause of 1.5 s"));
}

TEST_F(CalibrateWatch, RefusesWhatMakesNoSense) {
  EXPECT_EQ(Run({"--watch-pause", "5"}).exit_code, 2);
  EXPECT_EQ(Run({"--watch", "--watch-pause", "soon"}).exit_code, 2);
  EXPECT_EQ(Run({"--watch", "--dry-run"}).exit_code, 2);
  const ProgramResult none =
      ChildProgram({"calibrate", "--watch", frames_, "--camera", camera_}, folder_.path(), 0)
          .Wait();
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_THAT(none.err, HasSubstr("--readings"));
  const ProgramResult missing = ChildProgram({"calibrate", "--watch", folder_ / "none", "--camera",
                                              camera_, "--readings", table_},
                                             folder_.path(), 0)
                                    .Wait();
  EXPECT_EQ(missing.exit_code, 1);
  EXPECT_THAT(missing.err, Not(HasSubstr("interrupted")));
}

}  // namespace
}  // namespace thicklens::tools

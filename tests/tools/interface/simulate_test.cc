// The folder of a simulated sweep, read again; and folders that are not replaced.
#include "thicklens/simulate.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/special_numbers.h"
#include "support/temporary_folder.h"
#include "tools/support/bench_simulation.h"
#include "tools/support/option_error.h"

namespace thicklens {
namespace {

using ::testing::AllOf;
using testing::ContentOf;
using ::testing::ElementsAre;
using testing::ErrorOf;
using testing::FieldOfOptionError;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::SmallBenchSimulation;
using testing::TemporaryFolder;

// Content of every file below a folder, by its path from there.
std::map<std::string, std::string> FilesBelow(const std::string& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) {
      files[std::filesystem::relative(entry.path(), folder).string()] =
          ContentOf(entry.path().string());
    }
  }
  return files;
}

// Four small frames, which take a few milliseconds.
SweepSimulation FourFrames() {
  SweepSimulation simulation = SmallBenchSimulation();
  simulation.camera.sensor.width_px = 48;
  simulation.camera.sensor.height_px = 32;
  simulation.camera.sensor.principal_point_px = {23.5, 15.5};
  simulation.frame_count = 4;
  return simulation;
}

// Sum of squared differences of neighbours, relative to the squared sum: larger for a sharper
// frame.
double SharpnessOf(const std::string& png) {
  cv::Mat frame;
  cv::imread(png, cv::IMREAD_UNCHANGED).convertTo(frame, CV_64F);
  const cv::Mat step = frame.colRange(1, frame.cols) - frame.colRange(0, frame.cols - 1);
  return step.dot(step) / std::pow(cv::sum(frame)[0], 2);
}

TEST(SimulateInterfaceTest, TheFolderHasTheFramesAndTheirDescriptions) {
  const TemporaryFolder folder;
  const Sweep sweep = SimulateSweep(SmallBenchSimulation(), folder / "sweep");
  EXPECT_THAT(folder.Entries(), ElementsAre("sweep"));
  const auto files = FilesBelow(folder / "sweep");
  EXPECT_EQ(files.size(), 13U);  // ten frames and three descriptions
  for (const char* name : {"camera.yaml", "sweep.yaml", "truth.yaml"}) {
    EXPECT_EQ(files.count(name), 1U) << name;
  }
  ASSERT_EQ(sweep.description.frames.size(), 10U);
  for (const model::SweepFrame& frame : sweep.description.frames) {
    const cv::Mat read = cv::imread(frame.image, cv::IMREAD_UNCHANGED);
    EXPECT_EQ(read.type(), CV_8UC1) << frame.image;
    EXPECT_EQ(read.size(), cv::Size(144, 144)) << frame.image;
    EXPECT_EQ(std::filesystem::path(frame.image).parent_path(), folder / "sweep/frames");
  }
}

// z = offset + reading, the blur K |1/z - 1/zf| of a thin lens, and the parameters that were asked
// for.
TEST(SimulateInterfaceTest, TheTruthIsThatOfTheThinLens) {
  const TemporaryFolder folder;
  const SweepSimulation simulation = SmallBenchSimulation();
  const Sweep sweep = SimulateSweep(simulation, folder / "sweep");
  ASSERT_TRUE(sweep.truth);
  EXPECT_NEAR(sweep.truth->image_distance_mm, 50 * 300 / 250.0, 1e-9);
  EXPECT_NEAR(sweep.truth->focus_depth_mm, 300, 1e-9);
  EXPECT_EQ(sweep.truth->blur_ratio, 0.45);
  EXPECT_EQ(sweep.truth->blur_floor_px, 0.5);
  EXPECT_EQ(sweep.truth->bench_offset_mm, 20);
  ASSERT_EQ(sweep.truth->frames.size(), 10U);
  double square_mm2 = 0;
  for (std::size_t i = 0; i < 10; ++i) {
    SCOPED_TRACE(i);
    const model::SweepTruth::Frame& frame = sweep.truth->frames[i];
    const double depth_mm = 286 + 3 * static_cast<double>(i);
    EXPECT_NEAR(frame.depth_mm, depth_mm, 1e-9);
    const double radius_px = 8.9286 * 60 * std::abs(1 / depth_mm - 1 / 300.0) / 0.0045;
    EXPECT_NEAR(frame.blur_sigma_px, std::hypot(0.5, 0.45 * radius_px), 1e-6);
    EXPECT_EQ(sweep.description.frames[i].reading_mm, frame.reading_mm);
    EXPECT_LT(std::abs(20 + frame.reading_mm - depth_mm), 5 * simulation.reading_sigma_mm);
    square_mm2 += std::pow(20 + frame.reading_mm - depth_mm, 2);
  }
  EXPECT_GT(std::sqrt(square_mm2 / 10), simulation.reading_sigma_mm / 3);  // there are errors
}

TEST(SimulateInterfaceTest, ExactReadingsAreOffsetAndDepth) {
  for (const auto direction : {model::BenchDirection::kAway, model::BenchDirection::kToward}) {
    const TemporaryFolder folder;
    SweepSimulation simulation = FourFrames();
    simulation.reading_sigma_mm = 0;
    simulation.direction = direction;
    const Sweep sweep = SimulateSweep(simulation, folder / "sweep");
    ASSERT_EQ(sweep.description.frames.size(), 4U);
    EXPECT_EQ(sweep.description.direction, direction);
    for (std::size_t i = 0; i < 4; ++i) {
      const double away_mm = 286 + 3 * static_cast<double>(i) - 20;
      EXPECT_NEAR(sweep.description.frames[i].reading_mm,
                  direction == model::BenchDirection::kAway ? away_mm : -away_mm, 1e-9);
    }
  }
}

// The frames at 298 and 301 mm are the nearest to the plane of focus at 300 mm.
TEST(SimulateInterfaceTest, TheFramesAreSharpestAtThePlaneOfFocus) {
  const TemporaryFolder folder;
  const Sweep sweep = SimulateSweep(SmallBenchSimulation(), folder / "sweep");
  std::vector<double> sharpness;
  for (const model::SweepFrame& frame : sweep.description.frames) {
    sharpness.push_back(SharpnessOf(frame.image));
  }
  ASSERT_EQ(sharpness.size(), 10U);
  for (std::size_t i = 1; i <= 4; ++i) EXPECT_GT(sharpness[i], sharpness[i - 1]) << i;
  for (std::size_t i = 6; i < 10; ++i) EXPECT_LT(sharpness[i], sharpness[i - 1]) << i;
  EXPECT_GT(sharpness[5], 2 * sharpness[0]);
}

TEST(SimulateInterfaceTest, TheSweepIsWhatReadSweepFinds) {
  const TemporaryFolder folder;
  const Sweep written = SimulateSweep(FourFrames(), folder / "sweep");
  const Sweep read = ReadSweep(folder / "sweep");
  EXPECT_EQ(written.camera.name, "case-ii");
  EXPECT_EQ(written.camera.lens.aperture_radius_mm, 8.9286);
  EXPECT_FALSE(written.camera.calibration);  // a calibration has to find it
  EXPECT_EQ(written.description.offset_mm.value().value, 20);
  EXPECT_EQ(written.description.reading_sigma_mm, 0.05);
  EXPECT_EQ(written.description.target, model::SweepTarget::kTexture);
  EXPECT_EQ(model::SweepToYaml(written.description), model::SweepToYaml(read.description));
  EXPECT_EQ(model::SweepTruthToYaml(*written.truth), model::SweepTruthToYaml(read.truth.value()));
}

TEST(SimulateInterfaceTest, AnUnknownOffsetIsInTheTruthOnly) {
  const TemporaryFolder folder;
  const Sweep sweep = SimulateSweep(FourFrames(), folder / "sweep", true);
  EXPECT_FALSE(sweep.description.offset_mm);
  EXPECT_EQ(sweep.truth.value().bench_offset_mm, 20);
}

TEST(SimulateInterfaceTest, TheSeedDeterminesEveryBit) {
  const TemporaryFolder folder;
  RunControl one, three;
  one.threads = 1;
  three.threads = 3;
  SimulateSweep(FourFrames(), folder / "one", false, one);
  SimulateSweep(FourFrames(), folder / "three", false, three);
  SweepSimulation other = FourFrames();
  other.seed = 2;
  SimulateSweep(other, folder / "other");
  const auto files = FilesBelow(folder / "one");
  EXPECT_EQ(files, FilesBelow(folder / "three"));
  const auto of_other = FilesBelow(folder / "other");
  ASSERT_EQ(of_other.size(), files.size());
  for (const auto& [name, content] : files) {
    EXPECT_EQ(of_other.at(name) == content, name == "camera.yaml") << name;
  }
}

TEST(SimulateInterfaceTest, EveryFrameIsReported) {
  const TemporaryFolder folder;
  RunControl run;
  std::vector<int> done;
  run.progress = [&](const Progress& progress) {
    EXPECT_EQ(progress.stage, "rendering");
    EXPECT_EQ(progress.total, 4);
    done.push_back(progress.done);
  };
  SimulateSweep(FourFrames(), folder / "sweep", false, run);
  EXPECT_THAT(done, ElementsAre(1, 2, 3, 4));
}

TEST(SimulateInterfaceTest, AClaimedFolderAppearsWhenItIsCommitted) {
  const TemporaryFolder folder;
  SweepSimulation simulation = FourFrames();
  simulation.bits = 16;
  {
    OutputFolder claimed = ClaimSweepFolder(folder / "sweep");
    const SimulatedSweep simulated = SimulateSweep(simulation, &claimed);
    EXPECT_EQ(simulated.bits, 16);
    EXPECT_EQ(simulated.truth.frames.size(), 4U);
    EXPECT_NEAR(simulated.truth.image_distance_mm, 60, 1e-9);
    EXPECT_TRUE(simulated.effects.on.Has(Effect::kShotNoise));
    claimed.Write("attribution.csv", "effect,error\n");
    EXPECT_FALSE(std::filesystem::exists(folder / "sweep"));
    claimed.Commit();
  }
  EXPECT_EQ(ContentOf(folder / "sweep/attribution.csv"), "effect,error\n");
  const Sweep sweep = ReadSweep(folder / "sweep");
  EXPECT_EQ(cv::imread(sweep.description.frames.at(3).image, cv::IMREAD_UNCHANGED).type(),
            CV_16UC1);
  // It is recognized, with the files that are allowed beside the sweep, and replaced.
  simulation.frame_count = 2;
  SimulateSweep(simulation, folder / "sweep");
  EXPECT_EQ(FilesBelow(folder / "sweep").size(), 5U);
}

TEST(SimulateInterfaceTest, AFolderThatIsNotCommittedLeavesNothing) {
  const TemporaryFolder folder;
  {
    OutputFolder claimed = ClaimSweepFolder(folder / "sweep");
    SimulateSweep(FourFrames(), &claimed);
    EXPECT_EQ(FilesBelow(claimed.staging_path()).size(), 7U);
  }
  EXPECT_THAT(folder.Entries(), IsEmpty());
}

TEST(SimulateInterfaceTest, FilesOfOthersAreNotReplaced) {
  const TemporaryFolder folder;
  const auto expect_refused = [&](const std::string& name, const std::string& entry) {
    const auto before = FilesBelow(folder.path());
    EXPECT_THAT(ErrorOf([&] { ClaimSweepFolder(folder / name); }),
                AllOf(HasSubstr(name), HasSubstr(entry)));
    RunControl run;
    run.progress = [](const Progress&) { ADD_FAILURE() << "it was rendered"; };
    EXPECT_THAT(ErrorOf([&] { SimulateSweep(FourFrames(), folder / name, false, run); }),
                HasSubstr(entry));
    EXPECT_EQ(FilesBelow(folder.path()), before);
  };
  folder.Put("photos/holiday.jpg", "mine");
  expect_refused("photos", "no truth.yaml");
  // Somebody's own sweep, which has no truth.
  folder.Put("measured/sweep.yaml", "mine");
  folder.Put("measured/frames/0.png", "mine");
  expect_refused("measured", "no truth.yaml");
  // A sweep of an older run to which somebody added a file.
  SimulateSweep(FourFrames(), folder / "older");
  folder.Put("older/camera-calibrated.yaml", "mine");
  expect_refused("older", "camera-calibrated.yaml");
  const std::string file = folder.Put("file", "mine");
  expect_refused("file", "file");
  // An empty folder has nothing to lose.
  std::filesystem::create_directory(folder / "empty");
  EXPECT_EQ(ErrorOf([&] { ClaimSweepFolder(folder / "empty"); }), "(no error)");
}

TEST(SimulateInterfaceTest, AFolderIsClaimedOnce) {
  const TemporaryFolder folder;
  const OutputFolder claimed = ClaimSweepFolder(folder / "sweep");
  EXPECT_THAT(ErrorOf([&] { ClaimSweepFolder(folder / "sweep"); }), HasSubstr(folder / "sweep"));
  EXPECT_EQ(ErrorOf([&] { ClaimSweepFolder(folder / "other"); }), "(no error)");
}

TEST(SimulateInterfaceTest, AnEmptyPathIsRefused) {
  EXPECT_NE(ErrorOf([] { ClaimSweepFolder(""); }), "(no error)");
  EXPECT_NE(ErrorOf([] { SimulateSweep(FourFrames(), ""); }), "(no error)");
  EXPECT_NE(ErrorOf([] { ReadSweepSimulation(""); }), "(no error)");
}

TEST(SimulateInterfaceTest, WrongOptionsLeaveNothing) {
  const TemporaryFolder folder;
  const auto message_of = [&](const std::function<void(SweepSimulation*)>& change) {
    SweepSimulation simulation = FourFrames();
    change(&simulation);
    std::string message = ErrorOf([&] { SimulateSweep(simulation, folder / "sweep"); });
    EXPECT_THAT(folder.Entries(), IsEmpty()) << message;
    return message;
  };
  constexpr double kNone = testing::kNan;
  EXPECT_THAT(message_of([](auto* s) { s->first_depth_mm = kNone; }), HasSubstr("depths"));
  EXPECT_THAT(message_of([](auto* s) { s->step_mm = kNone; }), HasSubstr("depths"));
  EXPECT_THAT(message_of([](auto* s) { s->step_mm = -100; }), HasSubstr("depths"));  // behind
  EXPECT_THAT(message_of([](auto* s) { s->frame_count = 0; }), HasSubstr("frames is 0"));
  EXPECT_THAT(message_of([](auto* s) { s->bench_offset_mm = kNone; }), HasSubstr("offset_mm"));
  EXPECT_THAT(message_of([](auto* s) { s->reading_sigma_mm = kNone; }),
              HasSubstr("reading_sigma_mm"));
  EXPECT_THAT(message_of([](auto* s) { s->light_level = kNone; }), HasSubstr("light.level"));
  EXPECT_THAT(message_of([](auto* s) { s->flicker = kNone; }), HasSubstr("flicker"));
  EXPECT_THAT(message_of([](auto* s) { s->bits = 12; }), HasSubstr("bits"));
  EXPECT_THAT(message_of([](auto* s) { s->camera.calibration->blur_floor_px.reset(); }),
              HasSubstr("blur_floor_px"));
  RunControl run;
  run.threads = 1025;
  EXPECT_EQ(FieldOfOptionError([&] { SimulateSweep(FourFrames(), folder / "sweep", false, run); }),
            "threads");
  EXPECT_THAT(folder.Entries(), IsEmpty());
}

TEST(SimulateInterfaceTest, ACancelledRunLeavesWhatThereWas) {
  const TemporaryFolder folder;
  SimulateSweep(FourFrames(), folder / "older");
  const auto before = FilesBelow(folder.path());
  SweepSimulation other = FourFrames();
  other.seed = 2;
  for (const std::string name : {"older", "new"}) {
    for (const int frames_before : {0, 1, 4}) {  // at once, in the middle, after the last frame
      SCOPED_TRACE(fmt::format("{} {}", name, frames_before));
      CancelToken token;
      RunControl run;
      run.threads = 1;
      run.cancel = &token;
      if (frames_before == 0) token.Cancel();
      int rendered = 0;
      run.progress = [&](const Progress& progress) {
        rendered = progress.done;
        if (progress.done == frames_before) token.Cancel();
      };
      EXPECT_THROW(SimulateSweep(other, folder / name, false, run), Interrupted);
      EXPECT_EQ(rendered, frames_before);
      EXPECT_EQ(FilesBelow(folder.path()), before);
      EXPECT_THAT(folder.Entries(), ElementsAre("older"));
    }
  }
}

}  // namespace
}  // namespace thicklens

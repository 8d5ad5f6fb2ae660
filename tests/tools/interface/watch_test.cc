// A folder that is watched while the frames of a sweep are written into it. The times are those of
// the test: no clock is read.
#include "thicklens/watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/base/output_file.h"
#include "thicklens/calibrate.h"
#include "thicklens/io/image_file.h"
#include "tools/support/bench_simulation.h"
#include "tools/support/option_error.h"

namespace thicklens {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using testing::ContentOf;
using testing::ErrorOf;
using testing::FieldOfOptionError;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using testing::SmallBenchSimulation;
using testing::TemporaryFolder;

class FolderWatchTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = std::make_unique<TemporaryFolder>();
    simulated_ = std::make_unique<Sweep>(SimulateSweep(SmallBenchSimulation(), *shared_ / "sweep"));
  }
  static void TearDownTestSuite() {
    simulated_.reset();
    shared_.reset();
  }

  FolderWatchTest() { fs::create_directories(frames_); }

  static std::size_t Count() { return simulated_->description.frames.size(); }
  static std::string Source(std::size_t i) { return simulated_->description.frames[i].image; }
  static std::string Name(std::size_t i) { return fs::path(Source(i)).filename().string(); }
  std::string Path(std::size_t i) const { return frames_ + "/" + Name(i); }

  // Writes a part of a frame's file.
  void Write(std::size_t i, double part = 1) const {
    const std::string bytes = ContentOf(Source(i));
    std::ofstream(Path(i), std::ios::binary)
        << bytes.substr(0, static_cast<std::size_t>(part * static_cast<double>(bytes.size())));
  }
  void AddRow(std::size_t i, double off_mm = 0) const {
    const bool is_new = !fs::exists(table_);
    std::ofstream table(table_, std::ios::app);
    if (is_new) table << "file,reading_mm\n";
    table << Name(i) << "," << simulated_->description.frames[i].reading_mm + off_mm << "\n";
  }
  SweepOverrides Overrides() const {
    SweepOverrides overrides;
    overrides.camera_path = simulated_->description.camera_path;
    overrides.offset_mm = 20;
    overrides.floor_px = Measured{0.5, 0.01};
    return overrides;
  }
  std::unique_ptr<FolderWatch> Watch(const WatchOptions& options = {}) const {
    return std::make_unique<FolderWatch>(frames_, table_, Overrides(), options);
  }
  static std::vector<std::string> NamesOf(const WatchUpdate& update) {
    std::vector<std::string> names;
    for (const std::size_t i : update.added)
      names.push_back(fs::path(update.progress.frames[i].image).filename().string());
    return names;
  }

  static std::unique_ptr<TemporaryFolder> shared_;
  static std::unique_ptr<Sweep> simulated_;
  TemporaryFolder folder_;
  std::string frames_ = folder_ / "frames";
  std::string table_ = folder_ / "table.csv";
};

std::unique_ptr<TemporaryFolder> FolderWatchTest::shared_;
std::unique_ptr<Sweep> FolderWatchTest::simulated_;

TEST_F(FolderWatchTest, MeasuresEachFrameOnceAndGivesTheResultOfTheFolder) {
  const auto watch = Watch();
  double now_s = 0;
  std::size_t measured = 0;
  const std::size_t order[] = {4, 0, 9, 2, 7, 1, 8, 3, 6, 5};
  for (const std::size_t i : order) {
    Write(i);
    AddRow(i);
    EXPECT_THAT(watch->Look(now_s += 0.5).added, IsEmpty());  // it may still grow
    const WatchUpdate update = watch->Look(now_s += 2);
    ASSERT_THAT(NamesOf(update), ::testing::ElementsAre(Name(i)));
    EXPECT_EQ(update.progress.frames.size(), ++measured);
    EXPECT_FALSE(update.is_ended);
  }
  const WatchUpdate last = watch->Look(now_s += 2);
  EXPECT_THAT(last.added, IsEmpty());
  EXPECT_EQ(last.waiting, 0U);
  EXPECT_TRUE(last.progress.sharpest.done) << last.progress.sharpest.message;
  // The table is in the order of arrival, and so is the sweep.
  CalibrateOptions options;
  options.map_field = false;
  const Calibration watched = Calibrate(watch->Finish(), options);
  const Calibration direct = Calibrate(ReadSweepFolder(frames_, table_, Overrides()), options);
  EXPECT_EQ(watched.summary.focus_depth_mm->value, direct.summary.focus_depth_mm->value);
  EXPECT_EQ(watched.summary.blur_ratio->sigma, direct.summary.blur_ratio->sigma);
}

TEST_F(FolderWatchTest, WaitsForAFileThatGrows) {
  const auto watch = Watch();
  AddRow(0);
  double now_s = 0;
  for (const double part : {0.2, 0.5, 0.9}) {
    Write(0, part);
    const WatchUpdate update = watch->Look(now_s += 0.9);
    EXPECT_THAT(update.added, IsEmpty());
    EXPECT_EQ(update.waiting, 1U);
    EXPECT_THAT(update.waiting_reason, HasSubstr("is still being written"));
  }
  Write(0);
  watch->Look(now_s += 0.9);
  const WatchUpdate update = watch->Look(now_s += 1.5);
  EXPECT_THAT(update.added, SizeIs(1));
  EXPECT_THAT(update.left_out, IsEmpty());
}

// A slow copy may pause for longer than a file needs to settle.
TEST_F(FolderWatchTest, TriesAHalfWrittenFileAgainAndThenLeavesItOut) {
  const auto watch = Watch();
  for (const std::size_t i : {0U, 1U}) AddRow(i);
  Write(0, 0.5);
  Write(1, 0.5);
  watch->Look(0);
  EXPECT_EQ(watch->Look(2).waiting, 2U);
  Write(0);
  watch->Look(3);
  EXPECT_THAT(NamesOf(watch->Look(5)), ::testing::ElementsAre(Name(0)));
  EXPECT_THAT(watch->Look(9).left_out, IsEmpty());
  const WatchUpdate late = watch->Look(13);
  ASSERT_THAT(late.left_out, SizeIs(1));
  EXPECT_THAT(late.left_out.front().image, HasSubstr(Name(1)));
  EXPECT_EQ(late.waiting, 0U);
  // It arrives after all.
  Write(1);
  watch->Look(14);
  EXPECT_THAT(NamesOf(watch->Look(16)), ::testing::ElementsAre(Name(1)));
}

TEST_F(FolderWatchTest, ReadsATableThatGrows) {
  const auto watch = Watch();
  for (const std::size_t i : {0U, 1U, 2U}) Write(i);
  watch->Look(0);
  EXPECT_THAT(watch->Look(2).waiting_reason, HasSubstr("table of readings does not exist yet"));
  AddRow(2);
  watch->Look(3);
  const WatchUpdate one = watch->Look(5);
  EXPECT_THAT(NamesOf(one), ::testing::ElementsAre(Name(2)));
  EXPECT_EQ(one.waiting, 2U);
  EXPECT_THAT(one.waiting_reason, HasSubstr("has no reading yet"));
  AddRow(0);
  AddRow(1);
  EXPECT_THAT(watch->Look(6).added, IsEmpty());  // a row may be half written
  EXPECT_THAT(watch->Look(8).added, SizeIs(2));
}

// "31" of "31.5": the reading is read again when the table has grown.
TEST_F(FolderWatchTest, TakesAReadingThatWasHalfWritten) {
  const auto watch = Watch();
  Write(0);
  folder_.Put("table.csv", "file,reading_mm\n" + Name(0) + ",3");
  watch->Look(0);
  EXPECT_EQ(watch->Look(2).progress.frames.at(0).reading_mm, 3);
  folder_.Put("table.csv", "file,reading_mm\n" + Name(0) + ",31.5\n");
  watch->Look(3);
  EXPECT_EQ(watch->Look(5).progress.frames.at(0).reading_mm, 31.5);
}

TEST_F(FolderWatchTest, EndsByAFileOrAPause) {
  WatchOptions options;
  options.pause_s = 60;
  const auto watch = Watch(options);
  Write(0);
  AddRow(0);
  watch->Look(0);
  EXPECT_THAT(watch->Look(2).added, SizeIs(1));
  EXPECT_FALSE(watch->Look(59).is_ended);
  EXPECT_EQ(watch->Look(61).ended_by, "a pause of 60 s");
  Write(1);
  AddRow(1);
  EXPECT_FALSE(watch->Look(62).is_ended);
  folder_.Put("frames/done");
  EXPECT_FALSE(watch->Look(62.5).is_ended);  // a file is not whole
  EXPECT_THAT(watch->Look(64).added, SizeIs(1));
  const WatchUpdate end = watch->Look(65);
  EXPECT_TRUE(end.is_ended);
  EXPECT_EQ(end.ended_by, "the file done");
}

TEST_F(FolderWatchTest, MeasuresNoMoreThanAFewFramesPerLook) {
  for (std::size_t i = 0; i < Count(); ++i) {
    Write(i);
    AddRow(i);
  }
  folder_.Put("frames/done");
  WatchOptions options;
  options.most_per_look = 4;
  const auto watch = Watch(options);
  watch->Look(0);
  EXPECT_THAT(watch->Look(2).added, SizeIs(4));
  EXPECT_THAT(watch->Look(2).added, SizeIs(4));
  EXPECT_THAT(watch->Look(2).added, SizeIs(2));
  EXPECT_TRUE(watch->Look(2).is_ended);
}

TEST_F(FolderWatchTest, FilesThatAreLeftOutAreNamedInTheNotices) {
  const auto watch = Watch();
  for (std::size_t i = 0; i < 6; ++i) {
    Write(i, i == 3 ? 0.5 : 1);
    if (i != 5) AddRow(i);
  }
  watch->Look(0);
  watch->Look(2);
  watch->Look(20);
  const Sweep sweep = watch->Finish();
  EXPECT_THAT(sweep.description.frames, SizeIs(4));
  EXPECT_THAT(sweep.notices, Contains(HasSubstr(Name(3) + " is left out: ")));
  EXPECT_THAT(sweep.notices, Contains(HasSubstr(Name(5) + " is left out: ")));
}

// The first frame of the table is still being copied, and more than five others are whole.
TEST_F(FolderWatchTest, ExaminesTheFramesThatCanBeDecoded) {
  const auto watch = Watch();
  for (std::size_t i = 0; i < 7; ++i) {
    Write(i, i == 0 || i == 3 ? 0.5 : 1);
    AddRow(i);
  }
  watch->Look(0);
  const WatchUpdate update = watch->Look(2);
  EXPECT_THAT(update.added, SizeIs(5));
  EXPECT_EQ(update.waiting, 2U);
  Write(0);
  watch->Look(3);
  EXPECT_THAT(NamesOf(watch->Look(5)), ::testing::ElementsAre(Name(0)));
}

// Values of 16 bits up to 759: they are of 10 bits, or dark.
TEST_F(FolderWatchTest, SaysAtTheEndThatTheFullScaleIsNotKnown) {
  cv::Mat frame(144, 144, CV_16U);
  for (int i = 0; i < 144 * 144; ++i)
    frame.at<std::uint16_t>(i / 144, i % 144) = static_cast<std::uint16_t>(i % 760);
  io::ImageWriting linear;
  linear.is_linear = true;
  for (const char* name : {"a.tif", "b.tif"})
    WriteFileAtomically(frames_ + "/" + name,
                        io::EncodeImageFile(frame, io::ImageFormat::kTiff, linear));
  folder_.Put("table.csv", "file,reading_mm\na.tif,1\nb.tif,2\n");
  const auto watch = Watch();
  watch->Look(0);
  const WatchUpdate update = watch->Look(2);
  EXPECT_THAT(update.added, IsEmpty());
  EXPECT_THAT(update.waiting_reason, HasSubstr("more frames are needed to find which value"));
  folder_.Put("frames/done");
  EXPECT_TRUE(watch->Look(4).is_ended);
  EXPECT_THAT(ErrorOf([&] { watch->Finish(); }), HasSubstr("nothing is clipped"));
}

// More frames do not help.
TEST_F(FolderWatchTest, SaysWhatIsWrongWithTheCorrection) {
  SweepOverrides overrides = Overrides();
  overrides.correction.dark = {folder_ / "no-dark.png"};
  FolderWatch watch(frames_, table_, overrides, {});
  Write(0);
  AddRow(0);
  watch.Look(0);
  EXPECT_THAT(ErrorOf([&] { watch.Look(2); }), HasSubstr("no-dark.png"));
}

TEST_F(FolderWatchTest, NoticesSayWhatTheFilesWaitedFor) {
  WatchOptions options;
  options.most_per_look = 4;
  const auto watch = Watch(options);
  for (std::size_t i = 0; i < 6; ++i) {
    Write(i);
    if (i != 5) AddRow(i);
  }
  watch->Look(0);
  EXPECT_THAT(watch->Look(2).added, SizeIs(4));
  Write(6);
  EXPECT_THAT(watch->Look(2.5).added, SizeIs(1));
  Write(7);
  AddRow(7);
  watch->Look(3);
  const Sweep sweep = watch->Finish();
  EXPECT_THAT(sweep.description.frames, SizeIs(5));
  EXPECT_THAT(sweep.notices, Contains(HasSubstr(Name(5) + " is left out: it had no reading")));
  EXPECT_THAT(sweep.notices, Contains(HasSubstr(Name(7) + " is left out: it was still being "
                                                          "written")));
}

TEST_F(FolderWatchTest, AFrameThatIsNotMeasuredYetIsNotSaidToBeIncomplete) {
  WatchOptions options;
  options.most_per_look = 4;
  const auto watch = Watch(options);
  for (std::size_t i = 0; i < 6; ++i) {
    Write(i);
    AddRow(i);
  }
  watch->Look(0);
  watch->Look(2);
  EXPECT_THAT(watch->Finish().notices,
              Contains(HasSubstr(Name(5) + " is left out: it was not measured yet")));
}

// "31" of "31.5" when the sweep ends.
TEST_F(FolderWatchTest, TakesTheReadingsOfTheLastTableThatWasWhole) {
  const auto watch = Watch();
  for (const std::size_t i : {0U, 1U}) Write(i);
  folder_.Put("table.csv", "file,reading_mm\n" + Name(0) + ",31.5\n" + Name(1) + ",34.5\n");
  watch->Look(0);
  EXPECT_THAT(watch->Look(2).added, SizeIs(2));
  folder_.Put("table.csv", "file,reading_mm\n" + Name(0) + ",31.5\n" + Name(1) + ",3");
  watch->Look(3);
  const Sweep early = watch->Finish();
  ASSERT_THAT(early.description.frames, SizeIs(2));
  EXPECT_EQ(early.description.frames[1].reading_mm, 34.5);
  EXPECT_THAT(early.notices, Contains(HasSubstr("it was still being written when the sweep")));
  // A row that is gone from a table that is whole.
  folder_.Put("table.csv", "file,reading_mm\n" + Name(0) + ",31.25\n");
  watch->Look(4);
  watch->Look(6);
  const Sweep late = watch->Finish();
  ASSERT_THAT(late.description.frames, SizeIs(1));
  EXPECT_EQ(late.description.frames[0].reading_mm, 31.25);
  EXPECT_THAT(late.notices, Contains(HasSubstr("its reading is not in the table any more")));
}

TEST_F(FolderWatchTest, SaysAtTheEndThatTheTableCannotBeRead) {
  const auto watch = Watch();
  Write(0);
  folder_.Put("table.csv", "file,reading_mm\n" + Name(0) + ",high\n");
  folder_.Put("frames/done");
  watch->Look(0);
  const WatchUpdate update = watch->Look(2);
  EXPECT_TRUE(update.is_ended);
  EXPECT_THAT(update.waiting_reason, HasSubstr("high"));
  EXPECT_THAT(ErrorOf([&] { watch->Finish(); }), HasSubstr("high"));
}

TEST_F(FolderWatchTest, ReadsReadingsFromTheNames) {
  SweepOverrides overrides = Overrides();
  overrides.readings.name_pattern = "z{reading}mm";
  FolderWatch watch(frames_, "", overrides, {});
  fs::copy(Source(0), frames_ + "/z12.5mm.png");
  fs::copy(Source(1), frames_ + "/preview.png");
  watch.Look(0);
  const WatchUpdate update = watch.Look(2);
  ASSERT_THAT(update.added, SizeIs(1));
  EXPECT_EQ(update.progress.frames[0].reading_mm, 12.5);
  EXPECT_THAT(watch.Look(13).left_out, SizeIs(1));  // its name has no reading
}

TEST_F(FolderWatchTest, RefusesWhatCannotWork) {
  EXPECT_THAT(ErrorOf([&] { FolderWatch(folder_ / "none", table_, Overrides(), {}); }),
              HasSubstr("a folder into which the frames are written is expected"));
  EXPECT_EQ(FieldOfOptionError([&] { FolderWatch(frames_, "", Overrides(), {}); }), "readings");
  EXPECT_EQ(FieldOfOptionError([&] { FolderWatch(frames_, table_, {}, {}); }), "camera_path");
  WatchOptions options;
  options.pause_s = 0;
  EXPECT_EQ(FieldOfOptionError([&] { Watch(options); }), "pause_s");
  EXPECT_THAT(ErrorOf([&] { Watch()->Finish(); }), HasSubstr("no frame arrived"));
}

}  // namespace
}  // namespace thicklens

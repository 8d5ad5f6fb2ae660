// The frames of a video as frames of a sweep.
#include "thicklens/model/video_sweep.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::model {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using testing::ErrorOf;
using ::testing::HasSubstr;
using testing::TemporaryFolder;

// Frames 0.1 s apart.
std::vector<VideoFrame> FramesOfVideo(int count) {
  std::vector<VideoFrame> frames(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < frames.size(); ++i) frames[i].time_s = 0.1 * static_cast<double>(i);
  return frames;
}

VideoTable TableOf(const std::string& text) {
  VideoTable table;
  if (HasTimes(text, "t.csv", {})) {
    table.by_time = TimedReadingsOfTable(text, "t.csv", {});
  } else {
    table.by_frame = ReadingsOfTable(text, "t.csv", {});
  }
  return table;
}

VideoSelection Speed(double start, double end) {
  VideoSelection selection;
  selection.reading_start = start;
  selection.reading_end = end;
  return selection;
}

SweepFile SweepOf(const std::vector<VideoFrame>& frames, const VideoTable& table,
                  const VideoSelection& selection = {},
                  std::vector<std::string>* notices = nullptr) {
  return SweepFromVideo("a/v.mp4", frames, table, selection, {}, "c.yaml", notices);
}

std::vector<int> NumbersOf(const SweepFile& sweep) {
  std::vector<int> numbers;
  for (const SweepFrame& frame : sweep.frames) numbers.push_back(frame.page.value_or(-1));
  return numbers;
}

TEST(VideoSweep, ConstantSpeed) {
  const SweepFile sweep = SweepOf(FramesOfVideo(5), {}, Speed(10, 12));
  EXPECT_THAT(NumbersOf(sweep), ElementsAre(0, 1, 2, 3, 4));
  EXPECT_EQ(sweep.frames[0].Name(), "a/v.mp4[0]");
  for (int i = 0; i < 5; ++i)
    EXPECT_NEAR(sweep.frames[static_cast<std::size_t>(i)].reading_mm, 10 + 0.5 * i, 1e-12);
  EXPECT_THAT(sweep.readings, HasSubstr("10 mm at 0 s to 12 mm at 0.4 s"));

  VideoSelection part = Speed(20, 10);
  part.time_start_s = 0.05;
  part.time_end_s = 0.25;
  std::vector<std::string> notices;
  const SweepFile some = SweepOf(FramesOfVideo(5), {}, part, &notices);
  EXPECT_THAT(NumbersOf(some), ElementsAre(1, 2));
  EXPECT_NEAR(some.frames[0].reading_mm, 17.5, 1e-9);
  EXPECT_NEAR(some.frames[1].reading_mm, 12.5, 1e-9);
  EXPECT_THAT(notices, Contains(HasSubstr("3 of 5 frames are left out: 3 lie outside")));
}

TEST(VideoSweep, MotionEndsInTheVideo) {
  VideoSelection selection = Speed(0, 10);
  selection.time_end_s = 0.5;  // the length that a player shows
  EXPECT_NEAR(SweepOf(FramesOfVideo(5), {}, selection).frames[4].reading_mm, 8, 1e-9);
  selection.time_end_s = 400;
  EXPECT_THAT(ErrorOf([&] { SweepOf(FramesOfVideo(5), {}, selection); }),
              AllOf(HasSubstr("--time-end is 400 s"), HasSubstr("the last frame is at 0.4 s")));
  selection.time_end_s = 500;
  selection.time_start_s = 300;
  EXPECT_THAT(ErrorOf([&] { SweepOf(FramesOfVideo(5), {}, selection); }), HasSubstr("--time-end"));
}

TEST(VideoSweep, SpeedInAnotherUnit) {
  ReadingOptions options;
  options.unit = "um";
  const SweepFile sweep =
      SweepFromVideo("v.mp4", FramesOfVideo(3), {}, Speed(0, 100), options, "c", nullptr);
  EXPECT_NEAR(sweep.frames[2].reading_mm, 0.1, 1e-12);
}

TEST(VideoSweep, TableByTimeIsInterpolated) {
  std::vector<std::string> notices;
  const SweepFile sweep =
      SweepOf(FramesOfVideo(6), TableOf("time_s,z_mm\n0.1,1\n0.15,2\n0.35,6\n"), {}, &notices);
  EXPECT_THAT(NumbersOf(sweep), ElementsAre(1, 2, 3));
  EXPECT_NEAR(sweep.frames[0].reading_mm, 1, 1e-9);
  EXPECT_NEAR(sweep.frames[1].reading_mm, 3, 1e-9);
  EXPECT_NEAR(sweep.frames[2].reading_mm, 5, 1e-9);
  EXPECT_THAT(notices, Contains(HasSubstr("3 lie outside of the times of t.csv")));
}

TEST(VideoSweep, ClockOfTheTable) {
  const VideoTable table = TableOf("time,z_mm\n10:00:00.0,1\n10:00:00.4,5\n");
  EXPECT_THAT(ErrorOf([&] { SweepOf(FramesOfVideo(5), table); }),
              AllOf(HasSubstr("36000.000000 s to 36000.400000 s"), HasSubstr("--time-offset")));
  VideoSelection selection;
  selection.time_offset = "10:00:00";
  const SweepFile sweep = SweepOf(FramesOfVideo(5), table, selection);
  ASSERT_EQ(sweep.frames.size(), 5U);
  EXPECT_NEAR(sweep.frames[2].reading_mm, 3, 1e-6);
}

TEST(VideoSweep, TimesWithoutAUnitMustBePlausible) {
  const std::string rows = "0,1\n100,2\n200,3\n300,4\n";
  EXPECT_THAT(ErrorOf([&] { SweepOf(FramesOfVideo(4), TableOf("time,z_mm\n" + rows)); }),
              AllOf(HasSubstr("no unit"), HasSubstr("--time-unit")));
  EXPECT_EQ(SweepOf(FramesOfVideo(4), TableOf("time_ms,z_mm\n" + rows)).frames.size(), 4U);
}

TEST(VideoSweep, TableByFrame) {
  std::vector<std::string> notices;
  const std::vector<VideoFrame> untimed(6);
  const SweepFile sweep = SweepOf(untimed, TableOf("frame,z_mm\n0,1\n2,3\n5,4\n"), {}, &notices);
  EXPECT_THAT(NumbersOf(sweep), ElementsAre(0, 2, 5));
  EXPECT_THAT(notices, Contains(HasSubstr("3 of 6 frames are left out: 3 have no row in t.csv")));
  EXPECT_THAT(NumbersOf(SweepOf(untimed, TableOf("frame,z_mm\n1,1\n6,3\n"))), ElementsAre(0, 5))
      << "a row is the number of all frames: counted from 1";
  EXPECT_THAT(NumbersOf(SweepOf(untimed, TableOf("frame,z_mm\nv.mp4[4],1\nv.mp4[1],3\n"))),
              ElementsAre(1, 4));
  EXPECT_THAT(ErrorOf([&] { SweepOf(untimed, TableOf("frame,z_mm\n0,1\n6,3\n")); }),
              AllOf(HasSubstr("t.csv:3: '6' is not a frame of v.mp4"), HasSubstr("which has 6")));
}

TEST(VideoSweep, RepeatedAndDamagedFramesAreLeftOutByName) {
  std::vector<VideoFrame> frames = FramesOfVideo(6);
  frames[2].repeats_previous = frames[3].repeats_previous = true;
  frames[4].is_damaged = true;
  std::vector<std::string> notices;
  EXPECT_THAT(NumbersOf(SweepOf(frames, {}, Speed(0, 5), &notices)), ElementsAre(0, 1, 5));
  EXPECT_THAT(notices, Contains(AllOf(HasSubstr("1 damaged (frame 4)"),
                                      HasSubstr("2 repeat the frame before (frames 2, 3)"))));
}

// Another program may count the frames that cannot be decoded here.
TEST(VideoSweep, LostFramesMakeNumbersUncertain) {
  std::vector<VideoFrame> frames = FramesOfVideo(5);
  frames[3].lost_before = 1;
  const std::string by_frame = "frame,z\n0,10\n1,11\n2,12\n3,13\n4,14\n";
  EXPECT_THAT(ErrorOf([&] { SweepOf(frames, TableOf(by_frame)); }),
              AllOf(HasSubstr("a/v.mp4"), HasSubstr("1 frame after frame 2"), HasSubstr("t.csv"),
                    HasSubstr("a table by time")));
  std::vector<std::string> notices;
  EXPECT_THAT(NumbersOf(SweepOf(frames, {}, Speed(10, 14), &notices)), ElementsAre(0, 1, 2, 3, 4));
  EXPECT_THAT(notices, Contains(HasSubstr("1 frame after frame 2 cannot be decoded")));
  EXPECT_EQ(SweepOf(frames, TableOf("t_s,z\n0,10\n1,11\n")).frames.size(), 5U);
  frames = FramesOfVideo(5);
  frames.back().is_count_doubtful = true;
  EXPECT_THAT(ErrorOf([&] { SweepOf(frames, TableOf(by_frame)); }), HasSubstr("may be lost"));
  frames = FramesOfVideo(5);
  frames.front().lost_before = 2;
  EXPECT_THAT(ErrorOf([&] { SweepOf(frames, {}, Speed(10, 14)); }),
              HasSubstr("2 frames before the first one"));
}

// A file that was cut off ends at another time than the motion.
TEST(VideoSweep, ADamagedEndIsNotTheEndOfTheMotion) {
  for (const int kind : {0, 1, 2}) {
    std::vector<VideoFrame> frames = FramesOfVideo(5);
    if (kind == 0) frames.back().is_damaged = true;
    if (kind == 1) frames.back().may_be_cut = true;
    if (kind == 2) frames.back().lost_after = 1;
    EXPECT_THAT(ErrorOf([&] { SweepOf(frames, {}, Speed(10, 14)); }),
                AllOf(HasSubstr("may have been longer"), HasSubstr("--time-end"),
                      HasSubstr("a table by time")))
        << kind;
    VideoSelection stated = Speed(10, 13);
    stated.time_end_s = 0.3;
    EXPECT_EQ(SweepOf(frames, {}, stated).frames.size(), 4U) << kind;
    EXPECT_GE(SweepOf(frames, TableOf("t_s,z\n0,10\n1,11\n")).frames.size(), 4U) << kind;
  }
}

TEST(VideoSweep, ManyFramesAreThinnedOut) {
  std::vector<std::string> notices;
  const SweepFile sweep = SweepOf(FramesOfVideo(1000), {}, Speed(0, 5), &notices);
  EXPECT_EQ(sweep.frames.size(), 250U);
  EXPECT_EQ(sweep.frames[1].page, 4);
  EXPECT_THAT(notices, Contains(AllOf(HasSubstr("250 of 1000 usable frames are used, one of 4"),
                                      HasSubstr("--every"), HasSubstr("--frames"))));
  VideoSelection selection = Speed(0, 5);
  selection.every = 1;
  EXPECT_EQ(SweepOf(FramesOfVideo(1000), {}, selection).frames.size(), 1000U);
  selection.every.reset();
  selection.frames = 5;
  EXPECT_THAT(NumbersOf(SweepOf(FramesOfVideo(9), {}, selection)), ElementsAre(0, 2, 4, 6, 8));
  EXPECT_EQ(SweepOf(FramesOfVideo(4), {}, selection).frames.size(), 4U);
  selection.frames = 300;
  EXPECT_EQ(NumbersOf(SweepOf(FramesOfVideo(1000), {}, selection)).back(), 999);
}

TEST(VideoSweep, TimesAreRequiredWhereTheyAreUsed) {
  std::vector<VideoFrame> frames = FramesOfVideo(4);
  frames[2].time_s.reset();
  EXPECT_THAT(ErrorOf([&] { SweepOf(frames, {}, Speed(0, 1)); }),
              AllOf(HasSubstr("a/v.mp4: frame 2"), HasSubstr("no time stamp"),
                    HasSubstr("table by frame")));
  frames[2].time_s = 0.1;
  EXPECT_THAT(ErrorOf([&] { SweepOf(frames, {}, Speed(0, 1)); }), HasSubstr("do not rise"));
  EXPECT_THAT(ErrorOf([&] { SweepOf({}, {}, Speed(0, 1)); }), HasSubstr("no frames"));
  EXPECT_THAT(ErrorOf([&] { SweepOf(FramesOfVideo(4), {}); }), HasSubstr("--reading-start"));
  EXPECT_THAT(
      ErrorOf([&] { SweepOf(FramesOfVideo(4), TableOf("time_s,z\n0,1\n1,2\n"), Speed(0, 1)); }),
      HasSubstr("one of them is expected"));
}

TEST(VideoSweep, SelectionsThatMakeNoSense) {
  const auto reason = [](const VideoSelection& selection) {
    std::string why;
    return selection.IsValid(&why) ? "valid" : why;
  };
  EXPECT_EQ(reason({}), "valid");
  EXPECT_EQ(reason(Speed(1, 2)), "valid");
  EXPECT_THAT(reason(Speed(1, 1)), HasSubstr("reading_end"));
  VideoSelection selection;
  selection.reading_start = 1;
  EXPECT_THAT(reason(selection), HasSubstr("reading_end"));
  selection = {};
  selection.every = 2;
  selection.frames = 3;
  EXPECT_THAT(reason(selection), HasSubstr("excludes every"));
  selection = {};
  selection.time_start_s = 2;
  selection.time_end_s = 1;
  EXPECT_THAT(reason(selection), HasSubstr("time_end_s"));
  selection = {};
  selection.time_offset = "noon";
  EXPECT_THAT(reason(selection), HasSubstr("'noon'"));
}

// A sweep's file may name the frames of a video as it names the pages of a stack.
TEST(VideoSweep, IsWrittenAsASweepFile) {
  const TemporaryFolder folder;
  folder.Put("v.mp4", "x");
  SweepFile sweep =
      SweepFromVideo("v.mp4", FramesOfVideo(3), {}, Speed(10, 12), {}, "c.yaml", nullptr);
  const std::string yaml = folder.Put("sweep.yaml", SweepToYaml(sweep));
  const SweepFile read = ReadSweep(yaml, nullptr);
  ASSERT_EQ(read.frames.size(), 3U);
  EXPECT_THAT(NumbersOf(read), ElementsAre(0, 1, 2));
  EXPECT_EQ(read.frames[1].Name(), folder / "v.mp4[1]");
  EXPECT_EQ(read.frames[1].reading_mm, sweep.frames[1].reading_mm);
}

}  // namespace
}  // namespace thicklens::model

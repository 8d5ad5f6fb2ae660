// A sweep file that states a video and its readings.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/base/input_file.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::model {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using testing::ErrorOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::StartsWith;
using testing::TemporaryFolder;

// bench/s.yaml and what it names; the video has eleven frames, 0.1 s apart.
class SweepVideo : public ::testing::Test {
 protected:
  SweepVideo() {
    folder_.Put("bench/v.mp4");
    folder_.Put("bench/times.csv", "time_s,z_mm\n0,100\n1,110\n");
    reading_.video_reader = [this](const std::string& path, std::vector<std::string>* notices) {
      read_paths_.push_back(path);
      notices->push_back("of the video");
      std::vector<VideoFrame> frames(11);
      for (std::size_t i = 0; i < frames.size(); ++i)
        frames[i].time_s = 0.1 * static_cast<double>(i);
      return frames;
    };
  }

  SweepFile Read(const std::string& rest) {
    const std::string path =
        folder_.Put("bench/s.yaml", "schema: thicklens/sweep/1\ncamera: c.yaml\n" + rest);
    notices_.clear();
    return ReadSweep(path, reading_, &notices_);
  }
  std::string ErrorWith(const std::string& rest) {
    return ErrorOf([&] { Read(rest); });
  }

  TemporaryFolder folder_;
  SweepReading reading_;
  std::vector<std::string> notices_, read_paths_;
};

std::vector<double> ReadingsOf(const SweepFile& sweep) {
  std::vector<double> readings_mm;
  for (const SweepFrame& frame : sweep.frames) readings_mm.push_back(frame.reading_mm);
  return readings_mm;
}

TEST_F(SweepVideo, ATableByTimeAndPathsFromTheFolderOfTheFile) {
  const SweepFile sweep =
      Read("video: v.mp4\nframes_csv: times.csv\nreading_sigma_mm: 0.1\noffset_mm: 5\n");
  ASSERT_THAT(sweep.frames, SizeIs(11));
  EXPECT_THAT(read_paths_, ElementsAre(folder_ / "bench/v.mp4"));
  EXPECT_EQ(sweep.source, folder_ / "bench/s.yaml");
  EXPECT_EQ(sweep.camera_path, folder_ / "bench/c.yaml");
  EXPECT_EQ(sweep.offset_mm.value().value, 5);
  EXPECT_EQ(sweep.frames[3].image, folder_ / "bench/v.mp4");
  EXPECT_EQ(sweep.frames[3].page, 3);
  for (std::size_t i = 0; i < 11; ++i)
    EXPECT_NEAR(sweep.frames[i].reading_mm, 100 + static_cast<double>(i), 1e-9);
  EXPECT_THAT(sweep.readings, HasSubstr("times.csv"));
  // The file states the error of the readings.
  EXPECT_THAT(notices_, Contains("of the video"));
  EXPECT_THAT(notices_, Each(Not(HasSubstr("reading_sigma_mm"))));
}

TEST_F(SweepVideo, AConstantSpeedInAnyUnit) {
  const SweepFile sweep = Read(
      "readings_unit: cm\n"
      "video:\n"
      "  file: v.mp4\n"
      "  reading_start: 10\n"
      "  reading_end: 11\n"
      "  time_start_s: 0.2\n"
      "  time_end_s: 0.7\n"
      "  every: 5\n");
  ASSERT_THAT(sweep.frames, SizeIs(2));
  EXPECT_EQ(sweep.frames[0].page, 2);
  EXPECT_EQ(sweep.frames[1].page, 7);
  EXPECT_NEAR(sweep.frames[0].reading_mm, 100, 1e-9);
  EXPECT_NEAR(sweep.frames[1].reading_mm, 110, 1e-9);
  EXPECT_THAT(notices_, Contains(HasSubstr("video.every (--every)")));
}

TEST_F(SweepVideo, ColumnsTimesAndTheirOffset) {
  folder_.Put("bench/log.csv", "clock,other,stage\n5000,1,10\n6000,2,20\n");
  const SweepFile sweep = Read(
      "frames_csv: log.csv\n"
      "readings_column: stage\n"
      "readings_time_column: clock\n"
      "readings_time_unit: ms\n"
      "readings_unit: um\n"
      "video: {file: v.mp4, time_offset: 5.5, frames: 2}\n");
  // The first frame is at 5.5 s of the table, which ends at the sixth.
  ASSERT_THAT(sweep.frames, SizeIs(2));
  EXPECT_NEAR(sweep.frames[0].reading_mm, 0.015, 1e-12);
  EXPECT_EQ(sweep.frames[1].page, 5);
  EXPECT_NEAR(sweep.frames[1].reading_mm, 0.020, 1e-12);
}

TEST_F(SweepVideo, ATableByFrame) {
  folder_.Put("bench/f.csv", "frame,z_mm\n0,1\n4,2\n10,7\n");
  EXPECT_THAT(ReadingsOf(Read("video: v.mp4\nframes_csv: f.csv\n")), ElementsAre(1, 2, 7));
  folder_.Put("bench/f.csv", "frame,z_mm\n0,1\n11,2\n");
  EXPECT_THAT(ErrorWith("video: v.mp4\nframes_csv: f.csv\n"), HasSubstr("f.csv:3"));
}

// The options complete the file; a value that both state must be equal.
TEST_F(SweepVideo, OptionsCompleteTheFileAndDoNotContradictIt) {
  const std::string speed =
      "video: {file: v.mp4, reading_start: 100, reading_end: 110, every: 5}\n";
  reading_.video.time_end_s = 0.5;
  EXPECT_THAT(Read(speed).frames, SizeIs(2));
  reading_.video.every = 5;
  EXPECT_THAT(Read(speed).frames, SizeIs(2));
  reading_.video.every = 2;
  EXPECT_THAT(ErrorWith(speed), AllOf(StartsWith(folder_ / "bench/s.yaml:3:"),
                                      HasSubstr("video.every: 5 contradicts --every 2")));
  reading_.video.every.reset();
  reading_.video.frames = 3;
  EXPECT_THAT(ErrorWith(speed),
              AllOf(HasSubstr("s.yaml:3:8: video: frames: excludes every"), HasSubstr("options")));
  reading_.video = {};
  reading_.video.reading_start = 100;
  reading_.video.reading_end = 120;
  EXPECT_THAT(ErrorWith(speed), HasSubstr("video.reading_end: 110 contradicts --reading-end 120"));
  EXPECT_THAT(ErrorWith("video: v.mp4\nframes_csv: times.csv\n"),
              AllOf(HasSubstr("s.yaml:4:13: frames_csv: "),
                    HasSubstr("--reading-start, --reading-end"), HasSubstr("one of them")));
  EXPECT_NEAR(Read("video: v.mp4\n").frames.at(10).reading_mm, 120, 1e-9);
  reading_.video = {};
  reading_.video.time_offset = "0.5";
  EXPECT_THAT(ErrorWith("video: {file: v.mp4, time_offset: 0.25}\nframes_csv: times.csv\n"),
              HasSubstr("video.time_offset: 0.25 contradicts --time-offset 0.5"));
  reading_.video = {};
  reading_.readings.source = "exif";
  EXPECT_THAT(ErrorWith("video: v.mp4\nframes_csv: times.csv\n"), HasSubstr("--reading-from"));
}

TEST_F(SweepVideo, WhatContradictsTheVideoIsNamed) {
  const std::string table = "video: v.mp4\nframes_csv: times.csv\n";
  for (const char* extra :
       {"frames_glob: '*.png'\n", "frames_dir: x\n", "readings_from: exif\n",
        "readings_from_name: 'z{reading}'\n", "frames: [{image: v.mp4, reading_mm: 1}]\n"}) {
    SCOPED_TRACE(extra);
    const std::string key = std::string(extra).substr(0, std::string(extra).find(':'));
    EXPECT_THAT(ErrorWith(table + extra), AllOf(HasSubstr("s.yaml:5:"), HasSubstr(": " + key),
                                                HasSubstr("'video' states the frames")));
  }
  EXPECT_THAT(
      ErrorWith("video: {file: v.mp4, reading_start: 1, reading_end: 2}\nframes_csv: times.csv\n"),
      AllOf(HasSubstr("frames_csv: "), HasSubstr("video.reading_start")));
  EXPECT_THAT(ErrorWith("video: {file: v.mp4, reading_start: 1, reading_end: 2}\n"
                        "readings_column: z\n"),
              AllOf(HasSubstr("readings_column: "), HasSubstr("constant speed")));
  EXPECT_THAT(ErrorWith("frames_csv: times.csv\nreadings_time_unit: ms\n"),
              AllOf(HasSubstr("readings_time_unit: "), HasSubstr("only to a 'video'")));
  EXPECT_THAT(ErrorWith(table + "readings_time_column: t\nreadings_file_column: f\n"),
              HasSubstr("time_column: excludes file_column"));
}

TEST_F(SweepVideo, WhatIsWrongOrMissingIsNamedWithItsPlace) {
  EXPECT_THAT(ErrorWith("video: v.mp4\n"),
              AllOf(HasSubstr("s.yaml:3:8: video: "), HasSubstr("'frames_csv'"),
                    HasSubstr("'reading_start'")));
  EXPECT_THAT(ErrorWith("video: {file: v.mp4, reading_start: 1}\n"), HasSubstr("reading_end"));
  EXPECT_THAT(ErrorWith("video: {reading_start: 1, reading_end: 2}\n"), HasSubstr("file"));
  EXPECT_THAT(ErrorWith("video: {file: v.mp4, reading_start: 1, reading_end: 1}\n"),
              HasSubstr("another reading than reading_start"));
  EXPECT_THAT(ErrorWith("video: {file: v.mp4, readings_start: 1}\n"), HasSubstr("readings_start"));
  EXPECT_THAT(ErrorWith("video: {file: v.mp4, every: 0}\n"), HasSubstr("video.every: "));
  EXPECT_THAT(ErrorWith("video: {file: v.mp4, time_start_s: -1}\n"),
              HasSubstr("video.time_start_s: "));
  EXPECT_THAT(ErrorWith("video: {file: v.mp4, time_offset: soon}\nframes_csv: times.csv\n"),
              AllOf(HasSubstr("time_offset: a time is expected"), HasSubstr("'soon'")));
  EXPECT_THAT(ErrorWith("video: none.mp4\nframes_csv: times.csv\n"),
              AllOf(HasSubstr("s.yaml:3:8: video: "), HasSubstr("none.mp4")));
  EXPECT_THAT(ErrorWith("video: v.mp4\nframes_csv: none.csv\n"), HasSubstr("none.csv"));
  EXPECT_THAT(ErrorWith("video: {file: v.mp4, reading_start: 1, reading_end: 2, time_end_s: 9}\n"),
              HasSubstr("video.time_end_s (--time-end) is 9 s"));
  EXPECT_THAT(ErrorWith("video: {file: v.mp4, time_offset: 60}\nframes_csv: times.csv\n"),
              HasSubstr("state by video.time_offset (--time-offset)"));
  reading_.video_reader = {};
  EXPECT_THAT(ErrorWith("video: v.mp4\nframes_csv: times.csv\n"), HasSubstr("reads no videos"));
}

// No output may replace the video or its table.
TEST_F(SweepVideo, TheVideoAndItsTableAreInputs) {
  std::vector<std::string> inputs;
  WatchInputs([&inputs](const std::string& path) { inputs.push_back(path); });
  EXPECT_EQ(ErrorWith("video: v.mp4\nframes_csv: times.csv\n"), "(no error)");
  WatchInputs({});
  EXPECT_THAT(inputs, Contains(folder_ / "bench/v.mp4"));
  EXPECT_THAT(inputs, Contains(folder_ / "bench/times.csv"));
}

}  // namespace
}  // namespace thicklens::model

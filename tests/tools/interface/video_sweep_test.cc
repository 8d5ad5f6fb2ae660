// A sweep whose frames are those of a video.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <filesystem>
#include <opencv2/core.hpp>
#include <string>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/io/frame_files.h"
#include "thicklens/sweep.h"
#include "tools/io/image_library.h"

namespace thicklens {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using testing::ErrorOf;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::TemporaryFolder;

constexpr char kVideos[] = THICKLENS_SOURCE_DIR "/tests/data/video/";

// tests/data/video/constant.mp4 has 12 frames of 48 x 32 px, 0.1 s apart.
class VideoSweepTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!io::HasImageLibrary()) GTEST_SKIP() << "a build without GPL parts";
    video_ = folder_ / "constant.mp4";
    fs::copy_file(std::string(kVideos) + "constant.mp4", video_);
    overrides_.camera_path = folder_.Put(
        "camera.yaml",
        "schema: thicklens/camera/2\nname: bench\n"
        "lens: {front_focal_length_mm: 50, rear_focal_length_mm: 50, lens_thickness_mm: 0, "
        "aperture_radius_mm: 9}\n"
        "sensor: {width_px: 48, height_px: 32, pixel_pitch_mm: 0.005, principal_point_px: [24, "
        "16], "
        "transfer: srgb}\n");
  }

  TemporaryFolder folder_;
  std::string video_;
  SweepOverrides overrides_;
};

TEST_F(VideoSweepTest, ConstantSpeed) {
  overrides_.video.reading_start = 100;
  overrides_.video.reading_end = 122;
  const Sweep sweep = ReadSweepFolder(video_, "", overrides_);
  ASSERT_EQ(sweep.description.frames.size(), 12U);
  EXPECT_EQ(sweep.description.frames[3].page, 3);
  EXPECT_NEAR(sweep.description.frames[3].reading_mm, 106, 1e-6);
  EXPECT_THAT(sweep.notices,
              Contains(AllOf(HasSubstr("constant.mp4: its frames are compressed (H.264, "),
                             HasSubstr("bit/s"), HasSubstr("bits per pixel"))));
}

TEST_F(VideoSweepTest, TableByTime) {
  const std::string table = folder_.Put("t.csv", "time_ms,z_um\n200,0\n700,500\n");
  const Sweep sweep = ReadSweepFolder(video_, table, overrides_);
  ASSERT_EQ(sweep.description.frames.size(), 6U);
  EXPECT_EQ(sweep.description.frames[0].page, 2);
  EXPECT_NEAR(sweep.description.frames[1].reading_mm, 0.1, 1e-6);
  EXPECT_THAT(sweep.notices, Contains(HasSubstr("6 of 12 frames are left out")));
}

TEST_F(VideoSweepTest, WrittenFileGivesTheSameFrames) {
  overrides_.video.reading_start = 100;
  overrides_.video.reading_end = 122;
  overrides_.video.every = 4;
  Sweep sweep = ReadSweepFolder(video_, "", overrides_);
  io::FrameFiles files(sweep.description.frames);
  const cv::Mat last = files.Read(2);
  for (model::SweepFrame& frame : sweep.description.frames) frame.image = "constant.mp4";
  sweep.description.camera_path = "camera.yaml";
  const std::string yaml = folder_.Put("sweep.yaml", model::SweepToYaml(sweep.description));
  const Sweep read = ExamineFrames(ReadSweep(yaml));
  ASSERT_EQ(read.description.frames.size(), 3U);
  io::FrameFiles again(read.description.frames);
  EXPECT_EQ(cv::norm(again.Read(2), last, cv::NORM_INF), 0);
  EXPECT_EQ(again.DataSha256(), files.DataSha256());
  EXPECT_THAT(read.notices, Contains(HasSubstr("its frames are compressed (H.264)")));
}

// A sweep file with the video and its readings gives what the options give.
TEST_F(VideoSweepTest, ASweepFileStatesTheVideo) {
  overrides_.video.reading_start = 100;
  overrides_.video.reading_end = 122;
  overrides_.video.every = 4;
  const Sweep by_options = ReadSweepFolder(video_, "", overrides_);
  const std::string yaml =
      folder_.Put("sweep.yaml",
                  "schema: thicklens/sweep/1\ncamera: camera.yaml\nreading_sigma_mm: 0.1\n"
                  "video: {file: constant.mp4, reading_start: 100, reading_end: 122, every: 4}\n");
  const Sweep by_file = ReadSweep(yaml);
  ASSERT_EQ(by_file.description.frames.size(), by_options.description.frames.size());
  for (std::size_t i = 0; i < by_file.description.frames.size(); ++i) {
    const model::SweepFrame &a = by_file.description.frames[i],
                            &b = by_options.description.frames[i];
    EXPECT_EQ(a.image, b.image);
    EXPECT_EQ(a.page, b.page);
    EXPECT_EQ(a.reading_mm, b.reading_mm);
  }
  EXPECT_EQ(by_file.description.source, yaml);
  EXPECT_THAT(by_file.notices,
              Contains(HasSubstr("constant.mp4: its frames are compressed (H.264, ")));
  EXPECT_THAT(by_file.notices, Not(Contains(HasSubstr("reading_sigma_mm"))));
  EXPECT_EQ(ReadSweep(folder_.path()).description.frames.size(), 3U);

  // Options complete the file, and may not contradict it.
  SweepOverrides options;
  options.video.time_end_s = 0.5;
  EXPECT_EQ(ReadSweep(yaml, options).description.frames.size(), 2U);
  options.video.every = 3;
  EXPECT_THAT(ErrorOf([&] { ReadSweep(yaml, options); }),
              HasSubstr("video.every: 4 contradicts --every 3"));
}

TEST_F(VideoSweepTest, ASweepFileStatesTheTable) {
  folder_.Put("t.csv", "time_ms,z_um\n200,0\n700,500\n");
  const std::string head = "schema: thicklens/sweep/1\ncamera: camera.yaml\nframes_csv: t.csv\n";
  const std::string yaml = folder_.Put("s.yaml", head + "video: constant.mp4\n");
  const Sweep sweep = ReadSweep(yaml);
  ASSERT_EQ(sweep.description.frames.size(), 6U);
  EXPECT_EQ(sweep.description.frames[0].page, 2);
  EXPECT_NEAR(sweep.description.frames[1].reading_mm, 0.1, 1e-6);
  // Times are of no use to a sweep without a video.
  SweepOverrides options;
  options.readings.time_unit = "s";
  folder_.Put("list.yaml",
              "schema: thicklens/sweep/1\ncamera: camera.yaml\n"
              "frames: [{image: constant.mp4, page: 0, reading_mm: 1}]\n");
  EXPECT_THAT(ErrorOf([&] { ReadSweep(folder_ / "list.yaml", options); }),
              AllOf(HasSubstr("for a video"), HasSubstr("is none")));
  // The message names a file that is no video.
  folder_.Put("s.yaml", head + "video: t.csv\n");
  EXPECT_THAT(ErrorOf([&] { ReadSweep(yaml); }), HasSubstr("t.csv"));
}

TEST_F(VideoSweepTest, TransferOfTheVideoIsCompared) {
  overrides_.video.reading_start = 100;
  overrides_.video.reading_end = 122;
  const Sweep sweep = ExamineFrames(ReadSweepFolder(video_, "", overrides_));
  EXPECT_THAT(sweep.notices, Contains(AllOf(HasSubstr("states the transfer curve BT.709"),
                                            HasSubstr("the camera file's is used"))));
  EXPECT_EQ(sweep.full_scale_reason, "values of 8 bits");
}

TEST_F(VideoSweepTest, WhatIsMissingIsNamed) {
  EXPECT_THAT(ErrorOf([&] { ReadSweepFolder(video_, "", overrides_); }),
              AllOf(HasSubstr("table"), HasSubstr("constant speed")));
  overrides_.video.reading_start = 100;
  EXPECT_THAT(ErrorOf([&] { ReadSweepFolder(video_, "", overrides_); }),
              HasSubstr("video.reading_end"));
  overrides_.video.reading_end = 122;
  const std::string table = folder_.Put("t.csv", "frame,z_mm\n0,1\n1,2\n");
  EXPECT_THAT(ErrorOf([&] { ReadSweepFolder(video_, table, overrides_); }),
              HasSubstr("either a table"));
  EXPECT_THAT(ErrorOf([&] { ReadSweepFolder(folder_.path(), table, overrides_); }),
              AllOf(HasSubstr("for a video"), HasSubstr("is none")));
  overrides_.readings.source = "exif";
  EXPECT_THAT(ErrorOf([&] { ReadSweepFolder(video_, "", overrides_); }),
              HasSubstr("readings.source"));
}

}  // namespace
}  // namespace thicklens

// Videos, see tests/data/video/README.md.
#include "thicklens/io/video_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <opencv2/core.hpp>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/io/data_hash.h"
#include "thicklens/io/files_read.h"
#include "thicklens/io/frame_files.h"
#include "tools/io/image_library.h"

namespace thicklens::io {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using testing::ContentOf;
using ::testing::ElementsAre;
using testing::ErrorOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using testing::TemporaryFolder;

#define SKIP_WITHOUT_VIDEO() \
  if (!HasImageLibrary()) GTEST_SKIP() << "a build without GPL parts"

std::string VideoPath(const std::string& name) {
  return std::string(THICKLENS_SOURCE_DIR) + "/tests/data/video/" + name;
}

// The formula of the files.
double ColourOf(int n, int x, int y, int channel) {
  const bool is_left = x < 24, is_top = y < 16;
  if (!is_left) return is_top ? 200 - 8 * n : 100 + 4 * n;
  const double top[3] = {60.0 + 8 * n, 120, 180.0 - 8 * n};
  const double bottom[3] = {40, 60.0 + 8 * n, 100};
  return (is_top ? top : bottom)[channel];
}

// The largest difference from frame n, of 255, away from the borders of the areas, where samples of
// colour that are shared by neighbours differ.
double DifferenceOf(const cv::Mat& pixels, int n) {
  constexpr int kBorder = 4;
  const double unit = pixels.depth() == CV_8U ? 1 : 257;
  cv::Mat values;
  pixels.convertTo(values, CV_64F);
  double largest = 0;
  for (int y = 0; y < pixels.rows; ++y) {
    for (int x = 0; x < pixels.cols; ++x) {
      if (std::abs(x - 24) < kBorder || std::abs(y - 16) < kBorder) continue;
      for (int c = 0; c < 3; ++c) {
        const double value = values.ptr<double>(y)[3 * x + c] / unit;
        largest = std::max(largest, std::abs(value - ColourOf(n, x, y, c)));
      }
    }
  }
  return largest;
}

struct VideoCase {
  std::string name;
  double tolerance;  // of 255
};

TEST(VideoFileTest, EveryFrameIsFoundInAnyOrder) {
  SKIP_WITHOUT_VIDEO();
  for (const VideoCase& known :
       {VideoCase{"constant.mp4", 4}, VideoCase{"variable.mkv", 4}, VideoCase{"full_range.mp4", 4},
        VideoCase{"ten_bits.webm", 1.5}, VideoCase{"motion_jpeg.avi", 4},
        VideoCase{"colours.mkv", 0}, VideoCase{"stream.ts", 4}, VideoCase{"turned.mp4", 4},
        VideoCase{"raw.h264", 4}, VideoCase{"raw.mjpeg", 4}}) {
    VideoFile video(VideoPath(known.name));
    for (int n = 11; n >= 0; --n)
      EXPECT_LE(DifferenceOf(video.Read(n).pixels, n), known.tolerance) << known.name << " " << n;
    std::mt19937 random(1);
    for (int i = 0; i < 30; ++i) {
      const int n = static_cast<int>(random() % 12);
      EXPECT_LE(DifferenceOf(video.Read(n).pixels, n), known.tolerance) << known.name << " " << n;
    }
    EXPECT_THAT(ErrorOf([&] { video.Read(12); }),
                AllOf(StartsWith(VideoPath(known.name)), HasSubstr("frame 12 is not there"),
                      HasSubstr("12 frames")));
  }
}

TEST(VideoFileTest, AJumpAndCountingGiveTheSameValues) {
  SKIP_WITHOUT_VIDEO();
  for (const std::string name : {"constant.mp4", "variable.mkv", "stream.ts"}) {
    VideoFile counted(VideoPath(name));
    std::vector<cv::Mat> frames;
    for (int n = 0; n < 12; ++n) frames.push_back(counted.Read(n).pixels);
    for (int n = 0; n < 12; ++n) {
      VideoFile jumping(VideoPath(name));
      jumping.Survey();
      jumping.Read(11);
      EXPECT_EQ(cv::norm(jumping.Read(n).pixels, frames[static_cast<std::size_t>(n)], cv::NORM_INF),
                0)
          << name << " " << n;
    }
  }
}

TEST(VideoFileTest, SeveralThreadsRead) {
  SKIP_WITHOUT_VIDEO();
  VideoFile video(VideoPath("constant.mp4"));
  std::vector<double> worst(4, 0);
  std::vector<std::thread> threads;
  for (std::size_t t = 0; t < worst.size(); ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < 24; ++i) {
        const int n = static_cast<int>(5 * static_cast<std::size_t>(i) + 3 * t) % 12;
        worst[t] = std::max(worst[t], DifferenceOf(video.Read(n).pixels, n));
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (const double difference : worst) EXPECT_LE(difference, 4);
}

TEST(VideoFileTest, FramesHaveTheirTimes) {
  SKIP_WITHOUT_VIDEO();
  const VideoSurvey variable = VideoFile(VideoPath("variable.mkv")).Survey();
  ASSERT_EQ(variable.frames.size(), 12U);
  for (int n = 0; n < 12; ++n) {
    const double expected = n < 6 ? 0.1 * n : 0.6 + 0.25 * (n - 6);
    // The rate of the encoder was 10 frames per second, and it rounds times to its steps.
    EXPECT_NEAR(variable.frames[static_cast<std::size_t>(n)].time_s.value_or(-1), expected, 0.051)
        << n;
  }
  for (const std::string name : {"constant.mp4", "stream.ts", "motion_jpeg.avi"}) {
    const VideoSurvey survey = VideoFile(VideoPath(name)).Survey();
    ASSERT_EQ(survey.frames.size(), 12U) << name;
    for (int n = 0; n < 12; ++n) {
      EXPECT_NEAR(survey.frames[static_cast<std::size_t>(n)].time_s.value_or(-1), 0.1 * n, 1e-3)
          << name;
    }
  }
  for (const std::string name : {"raw.h264", "raw.mjpeg"}) {
    const VideoSurvey survey = VideoFile(VideoPath(name)).Survey();
    ASSERT_EQ(survey.frames.size(), 12U) << name;
    EXPECT_FALSE(survey.frames[3].time_s) << name << ": the stream states none";
    EXPECT_FALSE(survey.compression.bits_per_second) << name;
  }
}

TEST(VideoFileTest, RepeatedFramesAreFound) {
  SKIP_WITHOUT_VIDEO();
  const VideoSurvey survey = VideoFile(VideoPath("repeated.mkv")).Survey();
  std::vector<bool> repeats;
  for (const model::VideoFrame& frame : survey.frames) repeats.push_back(frame.repeats_previous);
  EXPECT_THAT(repeats, ElementsAre(false, false, true, false, false, true, true, false));
}

TEST(VideoFileTest, GreyOfTenBits) {
  SKIP_WITHOUT_VIDEO();
  VideoFile video(VideoPath("grey10.mkv"));
  const DecodedImage image = video.Read(2);
  ASSERT_EQ(image.pixels.type(), CV_16U);
  EXPECT_EQ(image.facts.significant_bits, 10);
  for (int x = 0; x < 48; ++x) {
    EXPECT_EQ(image.pixels.at<unsigned short>(7, x),
              std::floor((64 + 8 * x + 32) * 65535.0 / 1023 + 0.5));
  }
}

TEST(VideoFileTest, StatesWhatWasRead) {
  SKIP_WITHOUT_VIDEO();
  const auto line = [](const std::string& name) {
    return VideoFile(VideoPath(name)).Read(0).facts.OneLine();
  };
  EXPECT_EQ(line("constant.mp4"),
            "H.264 video (MP4 or MOV), 48 x 32 px, 3 channels (R G B), unsigned 8-bit integers, "
            "BT.709; yuv420p, chroma 4:2:0, matrix BT.709, limited range");
  EXPECT_THAT(line("variable.mkv"),
              AllOf(HasSubstr("transfer not stated"), HasSubstr("matrix BT.601 (assumed)")));
  EXPECT_THAT(line("full_range.mp4"), AllOf(HasSubstr("sRGB"), HasSubstr("full range")));
  EXPECT_THAT(line("ten_bits.webm"), AllOf(HasSubstr("(10 significant in 16 bits)"),
                                           HasSubstr("matrix BT.2020, limited range")));
  EXPECT_THAT(line("turned.mp4"), HasSubstr("orientation 8 (not applied: as stored)"));
  EXPECT_TRUE(VideoFile(VideoPath("colours.mkv")).Read(0).facts.video->is_lossless);
  EXPECT_FALSE(VideoFile(VideoPath("constant.mp4")).Read(0).facts.video->is_lossless);
}

TEST(VideoFileTest, CompressionIsMeasured) {
  SKIP_WITHOUT_VIDEO();
  const VideoSurvey survey = VideoFile(VideoPath("raw.mjpeg")).Survey();
  // The stream has nothing but its frames.
  const double bytes = static_cast<double>(fs::file_size(VideoPath("raw.mjpeg")));
  EXPECT_NEAR(survey.compression.bits_per_pixel, 8 * bytes / (12 * 48 * 32), 1e-3);
  const VideoSurvey timed = VideoFile(VideoPath("motion_jpeg.avi")).Survey();
  EXPECT_NEAR(timed.compression.bits_per_second.value_or(0), 8 * bytes / 1.2, 8 * bytes * 0.02);
}

TEST(VideoFileTest, KindIsFoundByContent) {
  for (const std::string name : {"constant.mp4", "variable.mkv", "motion_jpeg.avi", "stream.ts",
                                 "raw.h264", "raw.mjpeg", "sound.mp4"}) {
    EXPECT_TRUE(IsVideoFile(VideoPath(name))) << name;
    EXPECT_TRUE(IsNameOfVideo(name)) << name;
  }
  EXPECT_FALSE(IsVideoFile(VideoPath("README.md")));
  EXPECT_FALSE(IsVideoFile(std::string(THICKLENS_SOURCE_DIR) + "/tests/data/images/rgb.heic"));
  EXPECT_FALSE(IsVideoFile(VideoPath("missing.mp4")));
  EXPECT_TRUE(IsNameOfVideo("A/B.MP4"));
  EXPECT_FALSE(IsNameOfVideo("b.png"));
}

class BrokenVideoTest : public ::testing::Test {
 protected:
  // A copy of a file without its last bytes, or with other ones in one place.
  std::string CutCopy(const std::string& name, double share) const {
    const std::string content = ContentOf(VideoPath(name));
    const auto size = static_cast<std::size_t>(share * static_cast<double>(content.size()));
    return folder_.Put(name, content.substr(0, size));
  }
  static std::string Refusal(const std::string& path) {
    return ErrorOf([&] { VideoFile(path).Survey(); });
  }

  TemporaryFolder folder_;
};

TEST_F(BrokenVideoTest, TruncatedFiles) {
  SKIP_WITHOUT_VIDEO();
  for (const std::string name :
       {"constant.mp4", "variable.mkv", "motion_jpeg.avi", "ten_bits.webm"}) {
    for (const double share : {0.3, 0.6, 0.95}) {
      const std::string path = CutCopy(name, share);
      EXPECT_THAT(Refusal(path), AllOf(StartsWith(path), HasSubstr("truncated"))) << share;
    }
  }
}

// Nothing in MPEG-TS states its length.
TEST_F(BrokenVideoTest, TruncatedTransportStreams) {
  SKIP_WITHOUT_VIDEO();
  const std::string whole = ContentOf(VideoPath("stream.ts"));
  constexpr std::size_t kPacket = 188;
  ASSERT_EQ(whole.size() % kPacket, 0U);
  EXPECT_THAT(Refusal(folder_.Put("part.ts", whole.substr(0, whole.size() - 100))),
              AllOf(HasSubstr("part.ts"), HasSubstr("truncated"), HasSubstr("188")));
  // Bytes that begin no packet are no part of the video.
  EXPECT_EQ(
      VideoFile(folder_.Put("padded.ts", whole + std::string(20, '\0'))).Survey().frames.size(),
      VideoFile(VideoPath("stream.ts")).Survey().frames.size());
  EXPECT_FALSE(VideoFile(VideoPath("stream.ts")).Survey().frames.back().may_be_cut);
  // The first packet of a frame, which needs more of them, has the time and no stuffing.
  std::string first(kPacket, '\x11');
  first.replace(0, 19, std::string("\x47\x41\x00\x30\x07\x10\0\0\0\0\0\0\0\0\x01\xE0\0\0\x80", 19));
  EXPECT_TRUE(VideoFile(folder_.Put("cut.ts", whole + first)).Survey().frames.back().may_be_cut);
  // One that states 4096 bytes is known to be incomplete.
  first.replace(16, 2, std::string("\x10\0", 2));
  EXPECT_THAT(Refusal(folder_.Put("stated.ts", whole + first)),
              AllOf(HasSubstr("truncated"), HasSubstr("4102 bytes")));
}

// The frames of a damaged file that cannot be decoded are counted where they are missing.
TEST_F(BrokenVideoTest, LostFramesArePlaced) {
  SKIP_WITHOUT_VIDEO();
  for (const std::string name : {"motion_jpeg.avi", "constant.mp4"}) {
    EXPECT_EQ(VideoFile(VideoPath(name)).Survey().frames.back().lost_after, 0) << name;
  }
  // One frame has zeros in place of its tables and its bits.
  std::string content = ContentOf(VideoPath("motion_jpeg.avi"));
  std::size_t at = 0;
  for (int i = 0; i < 6; ++i) at = content.find("\xFF\xD8", at + 1);
  ASSERT_NE(at, std::string::npos);
  const std::size_t end = content.find("\xFF\xD9", at);
  ASSERT_NE(end, std::string::npos);
  content.replace(at, end - at, std::string(end - at, '\0'));
  const VideoSurvey survey = VideoFile(folder_.Put("lost.avi", content)).Survey();
  std::size_t present = survey.frames.size();
  for (const model::VideoFrame& frame : survey.frames)
    present += static_cast<std::size_t>(frame.lost_before + frame.lost_after);
  EXPECT_EQ(present, 12U);
}

TEST_F(BrokenVideoTest, FilesThatAreNoVideo) {
  const std::string text = folder_.Put("text.mp4", "this is a text, not a video\n");
  EXPECT_THAT(Refusal(text), AllOf(StartsWith(text), HasSubstr("a video is expected")));
  fs::copy_file(std::string(THICKLENS_SOURCE_DIR) + "/tests/data/images/srgb.png",
                folder_ / "image.mp4");
  EXPECT_THAT(Refusal(folder_ / "image.mp4"), HasSubstr("it is a file of the kind PNG"));
  EXPECT_THAT(Refusal(folder_.Put("v.y4m", "YUV4MPEG2 W48 H32 F10:1\nFRAME\n")),
              AllOf(HasSubstr("YUV4MPEG2"), HasSubstr("ffv1")));
  EXPECT_THAT(Refusal(folder_.Put("v.yuv", std::string(4608, '\x80'))), HasSubstr("-video_size"));
  EXPECT_THAT(Refusal(folder_.Put("v.gif", "GIF89a")), HasSubstr("256 colours"));
  for (const char* name : {"a.y4m", "a.YUV", "a.gif", "a.264", "a.265", "a.h264"})
    EXPECT_TRUE(IsNameOfVideo(name)) << name;
  EXPECT_THAT(Refusal(folder_.Put("empty.mp4")), HasSubstr("empty"));
  EXPECT_NE(Refusal(folder_ / "missing.mp4"), "(no error)");
  EXPECT_NE(Refusal(folder_.path()), "(no error)");
}

TEST_F(BrokenVideoTest, NoPictures) {
  SKIP_WITHOUT_VIDEO();
  EXPECT_THAT(Refusal(VideoPath("sound.mp4")),
              AllOf(HasSubstr("no stream of images"), HasSubstr("aac (audio)")));
}

TEST_F(BrokenVideoTest, HugeStatedSize) {
  SKIP_WITHOUT_VIDEO();
  std::string content = ContentOf(VideoPath("motion_jpeg.avi"));
  const std::size_t header = content.find("strf");
  ASSERT_NE(header, std::string::npos);
  for (const std::size_t at : {header + 12, header + 16})
    content.replace(at, 4, "\xFF\xFF\xFF\x3F");
  const std::string path = folder_.Put("huge.avi", content);
  EXPECT_THAT(Refusal(path), AllOf(StartsWith(path), HasSubstr("MiB")));
}

TEST_F(BrokenVideoTest, UnfinishedRecording) {
  SKIP_WITHOUT_VIDEO();
  std::string content = ContentOf(VideoPath("constant.mp4"));
  const std::size_t index = content.find("moov");
  ASSERT_NE(index, std::string::npos);
  EXPECT_THAT(Refusal(folder_.Put("unfinished.mp4", content.substr(0, index - 4))),
              HasSubstr("no index"));
}

// No change of bytes may do more than refuse the file or change frames.
TEST_F(BrokenVideoTest, ChangedBytes) {
  SKIP_WITHOUT_VIDEO();
  std::mt19937 random(7);
  for (const std::string name : {"constant.mp4", "variable.mkv", "motion_jpeg.avi", "stream.ts"}) {
    const std::string content = ContentOf(VideoPath(name));
    for (int i = 0; i < 20; ++i) {
      std::string changed = content;
      for (int k = 0; k < 5; ++k) changed[random() % changed.size()] = static_cast<char>(random());
      const std::string why = Refusal(folder_.Put("changed" + name, changed));
      EXPECT_THAT(why, ::testing::AnyOf("(no error)", HasSubstr("changed" + name)));
    }
  }
}

TEST(VideoFileTest, BuildsWithoutItRefuseByName) {
  if (HasImageLibrary()) GTEST_SKIP() << "a build with GPL parts";
  EXPECT_THAT(ErrorOf([] { VideoFile video(VideoPath("constant.mp4")); }),
              HasSubstr("video: this build reads none"));
}

TEST(VideoFramesTest, FramesOfASweep) {
  SKIP_WITHOUT_VIDEO();
  const std::string path = VideoPath("constant.mp4");
  FrameFiles files({{path, 1.5, 9}, {path, 1, 2}});
  EXPECT_LE(DifferenceOf(files.Read(0), 9), 4);
  EXPECT_LE(DifferenceOf(files.Read(1), 2), 4);
  EXPECT_THAT(FilesReadLine(files.Files()), StartsWith("2 frames of constant.mp4: H.264 video"));
  const std::string digest = Sha256Hex(ContentOf(path));
  EXPECT_EQ(files.DataSha256(), Sha256Hex(digest + " 9 1.5\n" + digest + " 2 1\n"));
  EXPECT_EQ(FrameFiles({{path, 1.5, 9}, {path, 1, 2}}).DataSha256(), files.DataSha256());
  EXPECT_LE(DifferenceOf(ReadFrame({path, 0, 7}), 7), 4);
  EXPECT_THAT(ErrorOf([&] { ReadFrame({path, 0}); }), HasSubstr("'page' states the number"));
}

}  // namespace
}  // namespace thicklens::io

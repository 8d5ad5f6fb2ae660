// The text about rejected frames, which shortens what they have in common and keeps each amount.
#include "tools/report/rejection_words.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace thicklens::tools {
namespace {

using calib::FrameMeasurement;
using ::testing::HasSubstr;
using ::testing::Not;

std::vector<FrameMeasurement> Frames(int count) {
  std::vector<FrameMeasurement> frames(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < frames.size(); ++i)
    frames[i].image = "/somewhere/f" + std::to_string(i) + ".png";
  return frames;
}

TEST(RejectionLines, ShowEveryFramesOwnAmount) {
  std::vector<FrameMeasurement> frames = Frames(9);
  const std::string about = "mm, or frame damaged: its image scale belongs to the reading ";
  frames[2].rejection = "reading off by -12.0 " + about + "312.1 mm; swapped with f3.png";
  frames[3].rejection = "reading off by 12.0 " + about + "300.1 mm; swapped with f2.png";
  frames[7].rejection = "reading off by 4.5 " + about + "330.2 mm";
  EXPECT_EQ(RejectionLines(frames),
            "  reading off (3 frames):\n"
            "    f2.png: by -12.0 " +
                about +
                "312.1 mm; swapped with f3.png\n"
                "    f3.png: by 12.0 " +
                about +
                "300.1 mm; swapped with f2.png\n"
                "    f7.png: by 4.5 " +
                about + "330.2 mm\n");
}

TEST(RejectionLines, ALoneFrameOrRunIsOneLine) {
  std::vector<FrameMeasurement> frames = Frames(9);
  frames[1].rejection = "dark: the mean is 0.001";
  for (const std::size_t i : {4U, 5U, 6U}) frames[i].rejection = "raw mosaic: develop it first";
  EXPECT_EQ(RejectionLines(frames),
            "  f1.png: dark: the mean is 0.001\n  f4.png .. f6.png (3 frames): raw mosaic: develop "
            "it first\n");
  EXPECT_EQ(RejectionLines(Frames(9)), "");
}

TEST(RejectionLines, LeaveOutWhatAllHaveInCommonButNoAmount) {
  std::vector<FrameMeasurement> frames = Frames(6);
  const std::string rest = " % of the pixels are clipped at 255, but at most 5 % may be";
  frames[0].rejection = "saturated: 91" + rest;
  frames[1].rejection = "saturated: 81" + rest;  // the last digit is the same
  frames[4].rejection = "saturated: 91" + rest;
  EXPECT_EQ(RejectionLines(frames),
            "  saturated (3 frames):\n"
            "    f0.png: 91" +
                rest +
                "\n"
                "    f1.png: 81 % ...\n"
                "    f4.png: as f0.png\n");
}

TEST(RejectionLines, CountWhatTheyDoNotName) {
  std::vector<FrameMeasurement> frames = Frames(30);
  for (std::size_t i = 0; i < 20; ++i)
    frames[i].rejection = "dark: the mean is 0.0" + std::to_string(10 + i / 2);
  const std::string text = RejectionLines(frames);
  EXPECT_THAT(text, HasSubstr("dark (20 frames)"));
  // Six runs of two frames are named.
  EXPECT_THAT(text, HasSubstr("f10.png .. f11.png (2 frames): the mean is 0.015\n    and 8 more"));
  EXPECT_THAT(text, Not(HasSubstr("0.016")));
}

}  // namespace
}  // namespace thicklens::tools

// How rejected frames are put together without losing what each of them has of its own.
#include "tools/report/rejection_groups.h"

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

TEST(RejectionGroups, PutsFramesOfOneKindTogetherWhereverTheyStand) {
  std::vector<FrameMeasurement> frames = Frames(9);
  frames[0].rejection = "dark: mean 0.001 below 0.016";
  frames[1].rejection = "dark: mean 0.002 below 0.016";
  frames[2].rejection = "saturated: 12 % of samples";
  frames[4].rejection = "dark: mean 0.002 below 0.016";
  frames[5].rejection = "dark: mean 0.002 below 0.016";
  frames[7].rejection = "blank";
  frames[8].rejection = "blank";
  const std::vector<RejectionGroup> groups = RejectionGroups(frames);
  ASSERT_EQ(groups.size(), 3u);
  EXPECT_EQ(groups[0].kind, "dark");
  EXPECT_EQ(groups[0].frames, 4);
  ASSERT_EQ(groups[0].runs.size(), 3u);
  EXPECT_EQ(groups[0].runs[0].detail, "mean 0.001 below 0.016");
  EXPECT_EQ(groups[0].runs[1].last, 1) << "frame 4 is no neighbour of frame 1";
  EXPECT_EQ(groups[0].runs[2].first, 4);
  EXPECT_EQ(groups[0].runs[2].last, 5);
  EXPECT_EQ(groups[1].kind, "saturated");
  EXPECT_EQ(groups[2].kind, "blank");
  ASSERT_EQ(groups[2].runs.size(), 1u);
  EXPECT_EQ(groups[2].runs[0].detail, "");
  EXPECT_EQ(groups[2].runs[0].count(), 2);
}

TEST(RejectionLines, ShowEveryFramesOwnAmount) {
  std::vector<FrameMeasurement> frames = Frames(9);
  const std::string about = "mm, or frame damaged: its image scale is that of reading ";
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
  frames[1].rejection = "dark: mean 0.001";
  for (const std::size_t i : {4U, 5U, 6U}) frames[i].rejection = "raw mosaic: develop it first";
  EXPECT_EQ(RejectionLines(frames),
            "  f1.png: dark: mean 0.001\n"
            "  f4.png .. f6.png (3 frames): raw mosaic: develop it first\n");
  EXPECT_EQ(RejectionLines(Frames(9)), "");
}

TEST(RejectionLines, LeaveOutWhatAllHaveInCommonButNoAmount) {
  std::vector<FrameMeasurement> frames = Frames(6);
  const std::string rest = " % of the pixels pile up at 255, at most 5 % may";
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
    frames[i].rejection = "dark: mean 0.0" + std::to_string(10 + i / 2);
  const std::string text = RejectionLines(frames);
  EXPECT_THAT(text, HasSubstr("dark (20 frames)"));
  // Six runs of two frames are named.
  EXPECT_THAT(text, HasSubstr("f10.png .. f11.png (2 frames): mean 0.015\n    and 8 more"));
  EXPECT_THAT(text, Not(HasSubstr("0.016")));
}

}  // namespace
}  // namespace thicklens::tools

// Which frames are excluded, and the text of the reasons.
#include "calib/sweep/frame_selection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace thicklens::calib {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

FrameStatistics GoodStatistics() {
  FrameStatistics s;
  s.mean_encoded = 0.4;
  s.mean_linear = 0.2;
  s.contrast = 0.3;
  s.noise_sigma = 0.01;
  s.top_gradient = 0.1;
  s.coarse_texture = 10;
  return s;
}

// `count` frames that pass every quality check, at every fifth millimetre.
std::vector<FrameMeasurement> GoodFrames(int count) {
  std::vector<FrameMeasurement> frames;
  for (int i = 0; i < count; ++i) {
    FrameMeasurement frame;
    frame.image = "/somewhere/frame-" + std::to_string(i) + ".png";
    frame.reading_mm = 300 + 5.0 * i;
    frame.depth_mm = frame.reading_mm;
    frame.statistics = GoodStatistics();
    frame.edge_count = 100;
    frames.push_back(frame);
  }
  return frames;
}

std::string KindOf(const FrameStatistics& statistics) {
  const auto reason = RejectionReason(statistics, 0.3, {});
  return reason ? FailedCheck(*reason) : "none";
}

TEST(FailedCheck, IsReadableTextForEveryCheck) {
  EXPECT_EQ(KindOf(GoodStatistics()), "none");
  FrameStatistics s = GoodStatistics();
  s.mean_encoded = 0.001;
  EXPECT_EQ(KindOf(s), "dark");
  s = GoodStatistics();
  s.is_mosaic = true;
  EXPECT_EQ(KindOf(s), "raw mosaic");
  s = GoodStatistics();
  s.saturated_fraction = 0.5;
  EXPECT_EQ(KindOf(s), "saturated");
  s = GoodStatistics();
  s.black_fraction = 0.5;
  EXPECT_EQ(KindOf(s), "black");
  s = GoodStatistics();
  s.top_gradient = s.coarse_texture = 0;
  EXPECT_EQ(KindOf(s), "no texture above the noise");
  s = GoodStatistics();
  s.contrast = 0.01;
  EXPECT_EQ(KindOf(s), "blank");
}

TEST(FailedCheck, KeepsTheAmountsAndNamesOfTheSingleFrameOut) {
  EXPECT_EQ(FailedCheck("reading off by 15.1 mm, or frame damaged: its image scale belongs to"),
            "reading off");
  EXPECT_EQ(
      FailedCheck("reading off by -0.7 mm, or frame damaged: its blur deviates by 9 standard"),
      "reading off");
  EXPECT_EQ(FailedCheck("repeated image: the same as frame-3.png at reading 300 mm"),
            "repeated image");
  EXPECT_EQ(FailedCheck("frame damaged: its blur deviates by 9 standard deviations"),
            "frame damaged");
  EXPECT_EQ(FailedCheck("does not show what the others show: its spectrum deviates 6 times"),
            "does not show what the others show");
  EXPECT_EQ(FailedCheck("blank"), "blank");
  EXPECT_EQ(FailedCheck(""), "");
}

TEST(FrameSelection, ThrowsOutWhatFailsAndKeepsTheRest) {
  auto frames = GoodFrames(9);
  frames[2].statistics.mean_encoded = 0.001;
  frames[5].statistics.saturated_fraction = 0.5;
  frames[7].statistics.contrast = 0.05;  // a sixth of the median
  FrameSelection selection(&frames);
  EXPECT_EQ(selection.used().size(), 9u);
  EXPECT_FALSE(selection.KeepMeasurable({}));
  EXPECT_EQ(selection.used(), (std::vector<std::size_t>{0, 1, 3, 4, 6, 8}));
  EXPECT_THAT(frames[2].rejection, StartsWith("dark"));
  EXPECT_THAT(frames[5].rejection, AllOf(StartsWith("saturated"), HasSubstr("lower the exposure")));
  EXPECT_THAT(frames[7].rejection, StartsWith("blank"));
  EXPECT_EQ(frames[3].rejection, "");
}

// A frame passes if any of the three measures shows the target.
TEST(FrameSelection, WithoutEdgesContrastAndTextureTheTargetIsNotToBeSeen) {
  auto frames = GoodFrames(9);
  for (const std::size_t i : {1U, 2U, 3U, 4U}) {
    frames[i].edge_count = 11;
    frames[i].statistics.contrast = 0.14;  // less than half of the median
    frames[i].statistics.coarse_texture = 2.9;
  }
  frames[1].edge_count = 12;
  frames[2].statistics.contrast = 0.16;
  frames[3].statistics.coarse_texture = 3.1;
  FrameSelection selection(&frames);
  EXPECT_FALSE(selection.KeepThoseWithEdges());
  EXPECT_EQ(selection.used(), (std::vector<std::size_t>{0, 1, 2, 3, 5, 6, 7, 8}));
  EXPECT_EQ(FailedCheck(frames[4].rejection), "no edges");
}

TEST(FrameSelection, NoImageFormsNearerThanTheFrontFocalPoint) {
  auto frames = GoodFrames(9);
  frames[0].depth_mm = 12.5;
  frames[1].depth_mm = 12.6;
  FrameSelection selection(&frames);
  EXPECT_FALSE(selection.KeepPossibleDepths(-287.5, 12.5));
  EXPECT_EQ(selection.used().front(), 1u);
  EXPECT_EQ(FailedCheck(frames[0].rejection), "impossible depth");
  EXPECT_THAT(frames[0].rejection, AllOf(HasSubstr("12.500 mm"), HasSubstr("-287.500 mm"),
                                         HasSubstr("check offset_mm")));
}

TEST(FrameSelection, TakesTheRejectionsOfOthers) {
  auto frames = GoodFrames(9);
  frames[4].rejection = "reading off by 3.0 mm, or frame damaged";
  FrameSelection selection(&frames);
  EXPECT_FALSE(selection.KeepUnrejected());
  EXPECT_EQ(selection.used().size(), 8u);
  EXPECT_EQ(frames[4].rejection, "reading off by 3.0 mm, or frame damaged");
}

TEST(TooFewUsable, CountsEveryKindMostFramesFirst) {
  auto frames = GoodFrames(9);
  frames[0].rejection = "blank: the contrast is 0.0100, but the median of the sweep is 0.3000";
  for (const std::size_t i : {1U, 3U, 5U, 6U})
    frames[i].rejection = "reading off by " + std::to_string(i) + ".0 mm, or frame damaged";
  FrameSelection selection(&frames);
  EXPECT_EQ(
      selection.KeepUnrejected(),
      "4 of 9 frames can be used, but 5 are needed. Rejected: reading off (4 frames), blank (1 "
      "frame), such as frame-1.png: reading off by 1.0 mm, or frame damaged");
}

TEST(TooFewUsable, SaysSoWhereReadingsAreEqual) {
  auto frames = GoodFrames(9);
  for (FrameMeasurement& frame : frames) frame.reading_mm = 300;
  frames[8].reading_mm = 310;
  FrameSelection selection(&frames);
  EXPECT_EQ(selection.KeepUnrejected(),
            "9 of 9 frames can be used at 2 different readings, but 5 are needed");
}

TEST(ExposureAdvice, SpeaksWhenMostFramesAreBadlyExposed) {
  auto frames = GoodFrames(10);
  const auto reject = [&](int from, int to, const char* reason) {
    for (int i = from; i < to; ++i) frames[static_cast<std::size_t>(i)].rejection = reason;
  };
  bool is_16_bit = false;
  const auto advice = [&] { return ExposureAdvice(frames, [&] { return is_16_bit; }); };
  EXPECT_EQ(advice(), "");
  reject(0, 5, "saturated: 80 % of the pixels are clipped at 255");
  EXPECT_EQ(advice(), "") << "half of them may have another cause";
  reject(5, 6, "saturated: 80 % of the pixels are clipped at 255");
  EXPECT_THAT(advice(),
              AllOf(StartsWith("6 of 10 frames are over-exposed: lower"), Not(HasSubstr("under"))));
  reject(0, 3, "dark: the mean is 0.003");
  reject(3, 6, "black: 60 % of the pixels are clipped at 0");
  EXPECT_THAT(advice(), StartsWith("6 of 10 frames are under-exposed: raise"));
  // The file is dark but the image is clear to the eye: with 16 bits stored, the light need not
  // be at fault.
  for (FrameMeasurement& frame : frames) {
    frame.statistics.mean_encoded = 400.0 / 65535;
    frame.statistics.noise_sigma = 4.0 / 65535;
    frame.statistics.top_gradient = 100.0 / 65535;
  }
  EXPECT_THAT(advice(), StartsWith("6 of 10 frames are under-exposed: raise"));
  is_16_bit = true;
  EXPECT_THAT(advice(),
              AllOf(StartsWith("6 of 10 frames are dark in their files (on average 400 of 65535)"),
                    HasSubstr("10 or 12 bits"), HasSubstr("or the frames are under-exposed")));
  reject(0, 6, "blank: the contrast is 0.01");
  EXPECT_EQ(advice(), "");
}

TEST(RegionAdvice, NamesTheSizeAndWhatIsNeeded) {
  FocusSweep sweep;
  sweep.camera.sensor.width_px = 640;
  sweep.camera.sensor.height_px = 480;
  EXPECT_EQ(RegionAdvice(sweep), "");
  EXPECT_EQ(RegionSidePx(sweep), 480);
  sweep.roi = {10, 20, 200, 63};
  EXPECT_EQ(RegionSidePx(sweep), 63);
  EXPECT_THAT(RegionAdvice(sweep), AllOf(HasSubstr("region of interest (roi_px) has 200 x 63 px"),
                                         HasSubstr("24 px"), HasSubstr("a texture at least 64")));
  sweep.roi.height = 64;
  EXPECT_EQ(RegionAdvice(sweep), "");
  sweep.roi = {};
  sweep.camera.sensor.width_px = 40;
  EXPECT_THAT(RegionAdvice(sweep), StartsWith("the image has 40 x 480 px"));
}

}  // namespace
}  // namespace thicklens::calib

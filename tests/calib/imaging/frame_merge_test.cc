#include "thicklens/calib/frame_merge.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "calib/imaging/painted_sweep.h"
#include "support/error_message.h"

namespace thicklens::calib {
namespace {

using ::testing::HasSubstr;

using thicklens::testing::ErrorOf;
using thicklens::testing::Paint;
using thicklens::testing::PaintedOptions;
using thicklens::testing::PaintedSweep;

double Disc(double x, double y) { return x * x + y * y <= 1 ? 1 : 0; }

// The sharp target as the reference frame would show it.
cv::Mat SharpTruth(const PaintedSweep& painted, int size_px) {
  const int corner = (painted.texture.cols - size_px) / 2;
  return painted.texture(cv::Rect(corner, corner, size_px, size_px));
}

// The PSNR of the inner part, which all frames show.
double PsnrDb(const cv::Mat& light, const cv::Mat& truth, int border) {
  const cv::Rect inner(border, border, light.cols - 2 * border, light.rows - 2 * border);
  cv::Mat grey = light(inner);
  const double rms =
      cv::norm(grey, truth(inner), cv::NORM_L2) / std::sqrt(static_cast<double>(inner.area()));
  return -20 * std::log10(rms);
}

cv::Mat LightOf(const PaintedSweep& painted, std::size_t frame) {
  return LinearGrey(painted.stored->at(frame), painted.sweep, frame);
}

PaintedOptions Tilted() {
  PaintedOptions options;
  options.size_px = 180;
  // The right side of the target is 14.4 mm nearer than the left one.
  options.height_mm = [](double x, double) { return 0.08 * x; };
  for (int i = -4; i <= 4; ++i) options.depths_mm.push_back(400 + 2 * i);
  return options;
}

const PaintedSweep& TiltedSweep() {
  static const PaintedSweep painted = Paint(Tilted(), Disc);
  return painted;
}

// The merge is sharp over the whole target, where each frame is sharp in one strip. The perspective
// of a tilted target displaces its texture by a part of a pixel.
TEST(FrameMerge, IsSharperThanEveryFrameOfATiltedTarget) {
  const PaintedOptions options = Tilted();
  const PaintedSweep& painted = TiltedSweep();
  const MergedFrames merged = MergeFrames(painted.sweep, painted.calibration, {});
  ASSERT_TRUE(merged.done) << merged.message;
  EXPECT_EQ(merged.frames, 9);
  EXPECT_EQ(merged.left_out, 0);
  EXPECT_EQ(merged.reference, 4);
  EXPECT_EQ(merged.light.channels(), 1);
  // The reference frame has the same perspective, with a pinhole.
  const cv::Mat truth = [&] {
    PaintedOptions sharp = options;
    sharp.noise = 0;
    return thicklens::testing::PaintedFrame(
        painted.texture, painted.sweep.camera, sharp, 400,
        [](double x, double y) { return std::hypot(x, y) < 0.05 ? 1 : 0; });
  }();
  const double best_frame_db = PsnrDb(LightOf(painted, 4), truth, 20);
  const double merged_db = PsnrDb(merged.light, truth, 20);
  EXPECT_GT(merged_db, best_frame_db + 6);
  EXPECT_GT(merged_db, 34);
}

// The energies to the power of 20 exceed what a float can hold.
TEST(FrameMerge, HasNoHolesWithTheLargestSelectivity) {
  const PaintedSweep& painted = TiltedSweep();
  MergeOptions options;
  options.selectivity = 20;
  const MergedFrames merged = MergeFrames(painted.sweep, painted.calibration, options);
  ASSERT_TRUE(merged.done) << merged.message;
  EXPECT_TRUE(cv::checkRange(merged.light));
  const MergedFrames usual = MergeFrames(painted.sweep, painted.calibration, {});
  EXPECT_GT(PsnrDb(merged.light, usual.light, 20), 25);
}

TEST(FrameMerge, MapsTheHeightOfTheTarget) {
  const PaintedOptions options = Tilted();
  const PaintedSweep& painted = TiltedSweep();
  const MergedFrames merged = MergeFrames(painted.sweep, painted.calibration, {});
  ASSERT_TRUE(merged.done) << merged.message;
  ASSERT_FALSE(merged.height_mm.empty());
  double squares = 0;
  int count = 0;
  for (int y = 25; y < 155; ++y) {
    for (int x = 25; x < 155; ++x) {
      const double height = merged.height_mm.at<float>(y, x);
      if (std::isnan(height)) continue;
      squares += std::pow(height - options.height_mm(x - 89.5, y - 89.5), 2);
      ++count;
    }
  }
  EXPECT_GT(count, 15000);
  EXPECT_LT(std::sqrt(squares / count), 1.1);  // the range is 10.4 mm, the step 2 mm
  // A point that is nearer by x is in focus at a reading that is farther by x.
  EXPECT_NEAR(merged.focus_reading_mm.at<float>(100, 100) - 400,
              merged.height_mm.at<float>(100, 100), 1e-3);
}

// A frame that stage or lamp have changed is brought back: shifted by pixels, and half as bright.
TEST(FrameMerge, AlignsFramesAndTheirLight) {
  const PaintedOptions options = Tilted();
  PaintedSweep painted = TiltedSweep();
  painted.stored = std::make_shared<std::vector<cv::Mat>>(*painted.stored);
  painted.sweep.read_frame = [stored = painted.stored](std::size_t i) { return stored->at(i); };
  const double before_db = PsnrDb(MergeFrames(painted.sweep, painted.calibration, {}).light,
                                  SharpTruth(painted, options.size_px), 20);
  cv::Mat moved = painted.stored->at(6).clone();
  const cv::Mat shift = cv::Mat(cv::Matx23d(1, 0, 3, 0, 1, -2));
  cv::warpAffine(moved, moved, shift, moved.size(), cv::INTER_NEAREST, cv::BORDER_REFLECT);
  painted.stored->at(6) = 0.5 * moved;
  const MergedFrames merged = MergeFrames(painted.sweep, painted.calibration, {});
  ASSERT_TRUE(merged.done) << merged.message;
  EXPECT_EQ(merged.left_out, 0);
  EXPECT_GT(PsnrDb(merged.light, SharpTruth(painted, options.size_px), 20), before_db - 0.5);
}

TEST(FrameMerge, KeepsColours) {
  PaintedOptions options = Tilted();
  options.size_px = 120;
  options.depths_mm = {396, 400, 404};
  PaintedSweep painted = Paint(options, Disc);
  for (cv::Mat& frame : *painted.stored) {
    cv::Mat half = frame * 0.5, quarter = frame * 0.25;
    cv::merge(std::vector<cv::Mat>{frame, half, quarter}, frame);
  }
  const MergedFrames merged = MergeFrames(painted.sweep, painted.calibration, {});
  ASSERT_TRUE(merged.done) << merged.message;
  ASSERT_EQ(merged.light.channels(), 3);
  const auto pixel = merged.light.at<cv::Vec3f>(60, 60);
  EXPECT_NEAR(pixel[1] / pixel[0], 0.5, 0.01);
  EXPECT_NEAR(pixel[2] / pixel[0], 0.25, 0.01);
}

TEST(FrameMerge, SaysWhyThereIsNone) {
  PaintedOptions options = Tilted();
  options.size_px = 120;
  options.depths_mm = {400};
  const PaintedSweep painted = Paint(options, Disc);
  const MergedFrames merged = MergeFrames(painted.sweep, painted.calibration, {});
  EXPECT_FALSE(merged.done);
  EXPECT_THAT(merged.message, HasSubstr("1 of 1 frames could be aligned, but 2 are needed"));
  MergeOptions wrong;
  wrong.selectivity = 0;
  EXPECT_THAT(ErrorOf([&] { MergeFrames(painted.sweep, painted.calibration, wrong); }),
              HasSubstr("selectivity is 0: 1 to 20 is expected"));
}

}  // namespace
}  // namespace thicklens::calib

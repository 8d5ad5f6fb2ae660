#include "calib/fit/source_recipe.h"

#include <gtest/gtest.h>

#include <vector>

#include "support/test_cameras.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::calib {
namespace {

FrameMeasurement Frame(double depth_mm, double slope, double normalised, double sigma_px) {
  FrameMeasurement frame;
  frame.depth_mm = depth_mm;
  frame.mean_edge_slope = slope;
  frame.normalised_edge_slope = normalised;
  frame.source_blur_sigma_px = sigma_px;
  return frame;
}

// f1 = f2 = 50 mm, r = 10 mm, 5 um, in focus at 300 mm: K = 60 mm, so that the radius of the blur
// is 10 60 |1/z - 1/300|/0.005 px.
model::Camera ThinCamera() {
  model::Camera camera;
  camera.lens = testing::ThinLens(50, 10);
  camera.sensor.pixel_pitch_mm = 0.005;
  return camera;
}

std::vector<FrameMeasurement> Frames() {
  return {Frame(250, 1, 1, 9),      // 80 px: ratio 9/80
          Frame(280, 5, 2.5, 0),    // no edge
          Frame(290, 9, 99, 50),    // not used
          Frame(300, 8, 2, 0.7),    // the sharpest
          Frame(310, 7, 3, 7),      // 400/31 px: ratio 7 31/400
          Frame(400, 2, 1.5, 20)};  // 100 px: ratio 20/100
}

TEST(RunSourceRecipe, IsTheSharpestFrameAndTheMeanOfRatios) {
  const SourceRecipe recipe = RunSourceRecipe(ThinCamera(), Frames(), {0, 1, 3, 4, 5});
  EXPECT_TRUE(recipe.done);
  EXPECT_EQ(recipe.message, "done");
  EXPECT_EQ(recipe.sharpest_frame, 3);
  EXPECT_EQ(recipe.focus_depth_mm, 300);
  EXPECT_NEAR(recipe.image_distance_mm, 60, 1e-12);
  EXPECT_EQ(recipe.ratio_frames, 3);
  EXPECT_NEAR(recipe.blur_ratio, (9.0 / 80 + 7 * 31.0 / 400 + 20.0 / 100) / 3, 1e-12);
  // Another frame is the sharpest if the index is divided by the brightness.
  EXPECT_EQ(recipe.sharpest_normalised_frame, 4);
  EXPECT_EQ(recipe.normalised_focus_depth_mm, 310);
}

TEST(RunSourceRecipe, WithoutABlurredEdgeThereIsNoRatio) {
  std::vector<FrameMeasurement> frames = Frames();
  for (FrameMeasurement& frame : frames) {
    if (frame.depth_mm != 300) frame.source_blur_sigma_px = 0;
  }
  const SourceRecipe recipe = RunSourceRecipe(ThinCamera(), frames, {0, 1, 3, 4, 5});
  EXPECT_FALSE(recipe.done);
  EXPECT_EQ(recipe.ratio_frames, 0);
  EXPECT_EQ(recipe.blur_ratio, 0);
  EXPECT_EQ(recipe.message, "no frame away from focus has measurable edges");
  EXPECT_EQ(recipe.focus_depth_mm, 300);
}

// Two frames are at the depth of the sharpest one. Neither determines the ratio.
TEST(RunSourceRecipe, FramesInThePlaneOfFocusAreLeftOut) {
  std::vector<FrameMeasurement> frames = Frames();
  frames.push_back(Frame(300, 4, 1, 3));
  const SourceRecipe recipe = RunSourceRecipe(ThinCamera(), frames, {0, 3, 6});
  EXPECT_EQ(recipe.ratio_frames, 1);
  EXPECT_NEAR(recipe.blur_ratio, 9.0 / 80, 1e-12);
}

}  // namespace
}  // namespace thicklens::calib

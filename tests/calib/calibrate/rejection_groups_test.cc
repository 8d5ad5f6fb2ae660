// How rejected frames are put together without losing what each of them has of its own.
#include "thicklens/calib/rejection_groups.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <vector>

namespace thicklens::calib {
namespace {

TEST(RejectionGroups, PutsFramesOfOneKindTogetherWhereverTheyStand) {
  std::vector<FrameMeasurement> frames(9);
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

}  // namespace
}  // namespace thicklens::calib

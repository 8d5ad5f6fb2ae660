// The lines of calibrate --watch.
#include "tools/report/watch_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace thicklens::tools {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

WatchUpdate OneFrame() {
  WatchUpdate update;
  update.added = {0};
  update.progress.frames = {{"a.png", 120, 0.5, ""}};
  update.progress.usable = 1;
  update.progress.sharpest.done = true;
  update.progress.sharpest.reading_mm = {118, 2};
  return update;
}

TEST(WatchTextTest, HasTheUnitOfTheReadings) {
  WatchUpdate update = OneFrame();
  const std::string in_mm = WatchText().Lines(update);
  EXPECT_THAT(in_mm, HasSubstr("a.png: reading 120 mm, "));
  EXPECT_THAT(in_mm, Not(HasSubstr("steps")));
  update.progress.readings_are_counts = true;
  const std::string in_steps = WatchText().Lines(update);
  EXPECT_THAT(in_steps, HasSubstr("a.png: reading 120 steps, "));
  EXPECT_THAT(in_steps, HasSubstr("focus at reading 118"));
  EXPECT_THAT(in_steps, Not(HasSubstr(" mm")));
}

TEST(WatchTextTest, SaysWhereAPredictionIsTheMost) {
  WatchUpdate update = OneFrame();
  update.progress.is_enough = true;
  update.progress.blur_ratio_error = 0.005;
  EXPECT_THAT(WatchText().Lines(update), HasSubstr("kappa is expected to 0.5 %, "));
  update.progress.is_error_at_most = true;
  EXPECT_THAT(WatchText().Lines(update), HasSubstr("kappa is expected to at most 0.5 %, "));
}

}  // namespace
}  // namespace thicklens::tools

#include "tools/system/progress_line.h"

#include <gtest/gtest.h>

namespace thicklens::tools {
namespace {

TEST(ProgressText, StatesTheTimeThatIsLeftAtTheSpeedSoFar) {
  EXPECT_EQ(ProgressText("measuring", 40, 6), "measuring 40 %, 9 s left");
  EXPECT_EQ(ProgressText("measuring", 99, 19.9), "measuring 99 %, 1 s left");
  EXPECT_EQ(ProgressText("measuring", 10, 60), "measuring 10 %, 9 min left");
}

TEST(ProgressText, StatesNoTimeWhereNothingShowsIt) {
  EXPECT_EQ(ProgressText("measuring", 40, 0.5), "measuring 40 %") << "the first second";
  EXPECT_EQ(ProgressText("measuring", 0, 5), "measuring 0 %");
  EXPECT_EQ(ProgressText("measuring", 100, 5), "measuring 100 %") << "nothing is left";
}

}  // namespace
}  // namespace thicklens::tools

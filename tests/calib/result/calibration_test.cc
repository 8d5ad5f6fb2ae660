#include "thicklens/calib/calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace thicklens::calib {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(CalibrationSummary, IsOneLine) {
  CalibrationSummary summary;
  summary.outcome = Outcome::kOk;
  summary.reason = "";
  summary.image_distance_mm = Result{57.25, 0.125, {}};
  summary.focus_depth_mm = Result{400, 0.5, {}};
  summary.blur_ratio = Result{0.4375, 0.001, {}};
  summary.frames_used = 19;
  summary.frames_rejected = 2;
  summary.seconds = 1.5;
  EXPECT_EQ(summary.BriefReport(),
            "calibrated: d1 57.25 +- 0.12 mm, zf 400 +- 0.5 mm, kappa 0.4375 +- 0.001; 19 "
            "frames used, 2 rejected, 1.5 s");
}

TEST(CalibrationSummary, SaysWhatIsNotDeterminedAndWhy) {
  CalibrationSummary summary;
  summary.reason = "too few frames";
  EXPECT_THAT(summary.BriefReport(), HasSubstr("d1 not determined"));
  EXPECT_THAT(summary.BriefReport(), HasSubstr("calibration refused"));
  EXPECT_THAT(summary.BriefReport(), EndsWith("; too few frames"));
  EXPECT_THAT(summary.BriefReport(), Not(HasSubstr("\n")));
}

}  // namespace
}  // namespace thicklens::calib

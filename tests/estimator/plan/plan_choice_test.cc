// Tests which plan is chosen for a quality target from a profile.
#include "thicklens/estimator/plan_choice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "support/sample_profile.h"
#include "thicklens/base/error.h"

namespace thicklens::estimator {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;
using thicklens::testing::kSampleWorkload;
using thicklens::testing::SampleProfile;

std::string ChosenFor(const QualityTarget& target, double speed_ratio = 1) {
  return ChoosePlan(SampleProfile(), target, "the target", kSampleWorkload, speed_ratio).plan.prior;
}
QualityTarget Quality(const std::string& name) { return {name, {}, {}}; }
QualityTarget Within(double seconds) { return {"", seconds, {}}; }
QualityTarget Loss(double db) { return {"", {}, db}; }

TEST(ChoosePlan, TakesTheFastestThatGainsEnough) {
  EXPECT_EQ(ChosenFor(Quality("draft")), "gradient");  // ridge gains 4.9 dB of 10
  EXPECT_EQ(ChosenFor(Quality("standard")), "tv");
  EXPECT_EQ(ChosenFor(Quality("best")), "patches");
}

TEST(ChoosePlan, TakesTheBestThatIsDoneByThen) {
  EXPECT_EQ(ChosenFor(Within(1)), "ridge");
  EXPECT_EQ(ChosenFor(Within(7.9)), "tv");
  EXPECT_EQ(ChosenFor(Within(100)), "patches");
  EXPECT_EQ(ChosenFor(Within(100), 20), "tv");  // on a machine that takes twenty times as long
}

TEST(ChoosePlan, TakesTheFastestThatLosesNoMore) {
  EXPECT_EQ(ChosenFor(Loss(0)), "patches");
  EXPECT_EQ(ChosenFor(Loss(0.8)), "tv");
  EXPECT_EQ(ChosenFor(Loss(50)), "ridge");
  EXPECT_EQ(ChosenFor({"", 4.0, 1.0}), "tv");
}

// The time that reading and the probe took counts against the target.
TEST(ChoosePlan, CountsWhatIsSpent) {
  EXPECT_EQ(
      ChoosePlan(SampleProfile(), Within(4.2), "the target", kSampleWorkload, 1, 0.1).plan.prior,
      "tv");
  EXPECT_EQ(
      ChoosePlan(SampleProfile(), Within(4.2), "the target", kSampleWorkload, 1, 0.3).plan.prior,
      "gradient");
  EXPECT_NEAR(
      ChoosePlan(SampleProfile(), Loss(0), "the target", kSampleWorkload, 2, 0.3).expected_seconds,
      16.3, 1e-9);
}

TEST(ChoosePlan, RefusesWithTheNearest) {
  const auto refusal = [](const QualityTarget& target) {
    try {
      ChosenFor(target);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("no refusal");
  };
  EXPECT_THAT(refusal(Within(0.5)),
              AllOf(StartsWith("the target cannot be met"), HasSubstr("scene ridge (1 s"),
                    HasSubstr("reading and writing files counts")));
  EXPECT_THAT(refusal({"", 3.0, 1.0}),
              AllOf(HasSubstr("scene gradient (2 s, 4.50"), HasSubstr("scene tv (4 s, 0.80")));
}

TEST(ChoosePlan, SaysInOneLineWhatItCostsAndGivesUp) {
  const PlanChoice choice =
      ChoosePlan(SampleProfile(), Quality("standard"), "the target", kSampleWorkload, 2);
  EXPECT_DOUBLE_EQ(choice.expected_seconds, 8);
  EXPECT_NEAR(choice.loss_db, 0.8, 1e-9);
  EXPECT_EQ(choice.message,
            "the target: scene tv, about 8 s (+- 10 %); 0.80 dB below scene patches "
            "(16 s); from a test's profile, scaled by 2 after a speed test (rough)");
  const PlanChoice best =
      ChoosePlan(SampleProfile(), Quality("best"), "the target", kSampleWorkload, 1);
  EXPECT_EQ(best.message,
            "the target: scene patches, about 8 s (+- 10 %); the best of its plans; from a test's "
            "profile");
  Workload large = kSampleWorkload;
  large.megapixels = 12;
  large.blur_sigma_px = 7;
  EXPECT_THAT(
      ChoosePlan(SampleProfile(), Quality("best"), "the target", large, 1).message,
      AllOf(HasSubstr("far beyond its megapixels of 1 with 12"),
            HasSubstr("far beyond its blur sigma in px of 3 with 7"), Not(HasSubstr("views"))));
}

// Files are timed here, all else there.
TEST(ChoosePlan, TakesTheTimeOfFilesAsItIsHere) {
  EstimateProfile profile = SampleProfile();
  for (PlanProfile& plan : profile.plans) {
    TimeModel::Terms terms = plan.time_model.coefficients();
    terms[TimeModel::kFileSeconds] = 0.5;
    plan.time_model = TimeModel(terms);
  }
  Workload load = kSampleWorkload;
  load.file_seconds = 6;
  EXPECT_DOUBLE_EQ(ChoosePlan(profile, Quality("best"), "the target", load, 1).expected_seconds,
                   8 + 3);
  EXPECT_DOUBLE_EQ(ChoosePlan(profile, Quality("best"), "the target", load, 4).expected_seconds,
                   32 + 3);
}

TEST(EstimateProfile, IsOfAMachineIfAllOfItIs) {
  EstimateProfile profile = SampleProfile();
  EXPECT_FALSE(profile.WasMeasuredBy("a build", "a machine", 4)) << "the user did not measure it";
  profile.is_own = true;
  EXPECT_TRUE(profile.WasMeasuredBy("a build", "a machine", 4));
  EXPECT_FALSE(profile.WasMeasuredBy("a build and more", "a machine", 4));
  EXPECT_FALSE(profile.WasMeasuredBy("a build", "another machine", 4));
  EXPECT_FALSE(profile.WasMeasuredBy("a build", "a machine", 3));
}

TEST(QualityTarget, HasAValueIfAnyPartIsGiven) {
  EXPECT_FALSE(QualityTarget().has_value());
  EXPECT_TRUE(Quality("draft").has_value());
  EXPECT_TRUE(Within(0).has_value());
  EXPECT_TRUE(Loss(0).has_value());
}

}  // namespace
}  // namespace thicklens::estimator

#include "tools/report/input_summary.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "support/test_cameras.h"

namespace thicklens::tools {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

// A sweep of one frame with a lens of 50 mm, and what a dry run would have found in it.
struct SummaryCase {
  Sweep sweep;
  Understanding found;

  SummaryCase() {
    sweep.camera.name = "bench";
    sweep.camera.lens = thicklens::testing::ThinLens(50, 5);
    sweep.camera.sensor = thicklens::testing::CentredSensor(64, 48, 0.005);
    sweep.description.frames = {{"a.png", 3}};
    found.frame_size_px = {64, 48};
    found.frame_bits = 8;
    found.frame_channels = 1;
    found.distinct_readings = 1;
  }
  std::string Text() const { return UnderstandingText(sweep, found, "joint", "none"); }
  nlohmann::json Json() const { return UnderstandingJson(sweep, found, "joint"); }
};

TEST(UnderstandingText, ShowsNoFocusThatIsNotStated) {
  const SummaryCase summary;
  EXPECT_THAT(summary.Text(), Not(HasSubstr("\nfocus ")));
  EXPECT_THAT(summary.Text(), Not(HasSubstr("objective")));
  EXPECT_THAT(summary.Text(), HasSubstr("unknown until the offset is estimated"));
  EXPECT_THAT(summary.Text(), HasSubstr("target     auto, blur floor unknown\n"));
  EXPECT_TRUE(summary.Json().at("stated_focus").empty());
  EXPECT_TRUE(summary.Json().at("target_period_mm").is_null());
}

// A sigma of 0 would claim readings without an error, and "the first 400 x 400 px" a crop.
TEST(UnderstandingText, ClaimsNoSigmaThatIsNotStated) {
  SummaryCase summary;
  EXPECT_THAT(summary.Text(), HasSubstr("(median), sigma not stated\n"));
  EXPECT_THAT(summary.Text(), HasSubstr("(the first one has "));
  EXPECT_TRUE(summary.Json().at("reading_sigma_mm").is_null());
  summary.sweep.description.reading_sigma_mm = 0.05;
  summary.sweep.description.reading_sigma_stated = true;
  EXPECT_THAT(summary.Text(), HasSubstr("(median), sigma 0.05 mm\n"));
}

TEST(UnderstandingText, ShowsWhatIsStatedOfTheFocusAndTheDepthThatFollows) {
  SummaryCase summary;
  summary.sweep.camera.aperture_behind_front_mm = 20;
  model::SweepFile& file = summary.sweep.description;
  file.focus_depth_mm = Measured{150, 1};
  file.working_distance_mm = Measured{130, 0.5};
  file.image_distance_mm = Measured{75, 0};
  // 1/0.5 in front of the focal point, in focal lengths, with the slope f1/m^2 = 200 mm.
  file.magnification = Measured{0.5, 0.01};
  file.target_period_mm = 0.25;
  const std::string text = summary.Text();
  EXPECT_THAT(text, HasSubstr("\nfocus      focus_depth_mm 150 +- 1 mm\n"
                              "           working_distance_mm 130 +- 0.5 mm: in focus at 150 +- "
                              "0.5 mm from the aperture\n"
                              "           image_distance_mm 75 mm: in focus at 150 mm from the "
                              "aperture\n"
                              "           magnification 0.5 +- 0.01: in focus at 150 +- 2 mm from "
                              "the aperture\n"));
  EXPECT_THAT(text, HasSubstr("depths     unknown until the frames are measured\n"));
  EXPECT_THAT(text, HasSubstr("target     auto, period 0.25 mm, blur floor unknown\n"));
  const nlohmann::json json = summary.Json();
  ASSERT_EQ(json.at("stated_focus").size(), 4U);
  EXPECT_EQ(json["stated_focus"][1]["name"], "working_distance_mm");
  EXPECT_EQ(json["stated_focus"][1]["value"], 130);
  EXPECT_EQ(json["stated_focus"][1]["focus_depth_mm"]["value"], 150);
  EXPECT_NEAR(json["stated_focus"][3]["focus_depth_mm"]["sigma"].get<double>(), 2, 1e-12);
  EXPECT_EQ(json.at("target_period_mm"), 0.25);
}

TEST(UnderstandingText, ShowsAnObjectiveWithItsEquivalentLens) {
  SummaryCase summary;
  summary.sweep.camera.objective = model::Objective{10, 0.25, 200};
  summary.sweep.camera.lens = model::LensOfObjective(*summary.sweep.camera.objective);
  const std::string text = summary.Text();
  EXPECT_THAT(text, HasSubstr("f1 20 mm"));
  EXPECT_THAT(text, HasSubstr("objective 10x, numerical aperture 0.25, tube lens 200 mm\n"));
  EXPECT_THAT(text,
              HasSubstr("focus      lens.magnification 10: in focus at 22 mm from the aperture"));
}

}  // namespace
}  // namespace thicklens::tools

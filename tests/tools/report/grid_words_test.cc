#include "tools/report/grid_words.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace thicklens::tools {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

calib::GridGeometry OpenGeometry() {
  calib::GridGeometry grid;
  grid.done = true;
  grid.message.clear();
  grid.grid = "chequerboard of 11 x 8 squares of 10 mm";
  grid.frames_searched = 31;
  grid.frames_used = 12;
  grid.points = 840;
  grid.combinations = {{"vanishing point of the motion, x, px", {331.5, 0.4}}};
  grid.open = {"principal point x +50 px, direction of the motion in x -2 degrees"};
  grid.verdict = "no distortion is seen beyond doubt";
  return grid;
}

// A quantity that is open has no number, and the combination has one.
TEST(GridWords, SayWhatIsFixedAndWhatIsOpen) {
  const std::vector<std::string> lines = GridLines(OpenGeometry());
  EXPECT_THAT(lines, Contains(HasSubstr("found in 12 of 31 frames")));
  EXPECT_THAT(lines, Contains(HasSubstr("vanishing point of the motion, x, px = 331.5 +- 0.4")));
  EXPECT_THAT(lines, Contains(HasSubstr("left open, and changing together: principal point x")));
  EXPECT_THAT(lines, Not(Contains(HasSubstr("image distance"))));
  const nlohmann::json json = GridJson(OpenGeometry());
  EXPECT_TRUE(json.at("focal_length_px").is_null());
  EXPECT_TRUE(json.at("principal_point_x_px").is_null());
  EXPECT_EQ(json.at("combinations").at(0).at("value"), 331.5);
  EXPECT_EQ(json.at("distortion_is_used"), false);
}

TEST(GridWords, AreAbsentWithoutAGrid) {
  EXPECT_THAT(GridLines({}), IsEmpty());
  EXPECT_TRUE(GridJson({}).is_null());
  EXPECT_TRUE(MarksJson({}).is_null());
  EXPECT_EQ(MarksLine({}), "");
}

TEST(GridWords, NameTheMarks) {
  calib::Calibration calibration;
  calib::SheetMarks& marks = calibration.diagnostics.marks;
  marks.done = true;
  marks.frames = 3;
  marks.marks = 4;
  marks.side_mm = 8;
  marks.scales = {{7.5, 0.2, 0.0006}};
  marks.tilt_right_deg = model::Estimate{2.5, 0.3};
  marks.tilt_down_deg = model::Estimate{-0.1, 0.3};
  EXPECT_THAT(MarksLine(calibration),
              ::testing::AllOf(HasSubstr("4 marks of 8 mm in 3 frame(s)"),
                               HasSubstr("magnification 0.2 +- 0.0006 at the reading 7.5 mm"),
                               HasSubstr("2.5 +- 0.3 degrees about the vertical axis")));
  EXPECT_EQ(MarksJson(marks).at("scales").at(0).at("reading_mm"), 7.5);
}

}  // namespace
}  // namespace thicklens::tools

#include "thicklens/model/target_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "support/test_cameras.h"
#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using thicklens::testing::TestSensor;
using thicklens::testing::ThickMacroLens;

constexpr SheetSize kA4 = {210, 297, true};

std::string RefusalOf(const TargetRequest& request) {
  try {
    LayOutTarget(request);
  } catch (const Error& error) {
    return error.what();
  }
  return "laid out";
}

// A camera of one px per `px_mm` of the target.
CameraView MadeUpView(double width_px, double height_px, double px_mm) {
  return {1000, px_mm, width_px * px_mm, height_px * px_mm, 50};
}

TEST(LayOutTarget, FillsAnA4SheetAndSaysSo) {
  TargetRequest request;
  request.sheet = kA4;
  const TargetPage page = LayOutTarget(request);
  EXPECT_EQ(page.width_mm, 210);
  EXPECT_EQ(page.height_mm, 297);
  EXPECT_DOUBLE_EQ(page.pattern.width, 180);
  EXPECT_DOUBLE_EQ(page.pattern.height, 240);
  EXPECT_DOUBLE_EQ(page.feature_mm, 0.5);
  EXPECT_DOUBLE_EQ(page.bar.width, 100);
  ASSERT_EQ(page.caption.size(), 3U);
  EXPECT_EQ(page.caption[0],
            "thicklens target, pattern 180.0 x 240.0 mm, smallest feature 0.5 mm, edge 5 degrees, "
            "seed 1");
  EXPECT_EQ(page.caption[1], "measure this bar: 100.0 mm; print at 100 %, no scaling");
}

TEST(LayOutTarget, KeepsEverythingOnTheSheetAndApart) {
  for (const SheetSize& sheet :
       {kA4, SheetSize{297, 420, true}, SheetSize{215.9, 279.4, true}, SheetSize{50, 50, false},
        SheetSize{60, 400, false}, SheetSize{400, 60, false}, SheetSize{841, 1189, false}}) {
    TargetRequest request;
    request.sheet = sheet;
    const TargetPage page = LayOutTarget(request);
    SCOPED_TRACE(page.choice);
    EXPECT_GE(page.pattern.x, 0.05 * std::min({page.width_mm, page.height_mm, 200.0}));
    EXPECT_LE(page.pattern.x + page.pattern.width, page.width_mm - page.pattern.x + 0.11);
    EXPECT_LT(page.pattern.y + page.pattern.height, page.bar.y);
    EXPECT_LE(page.bar.x + page.bar.width, page.width_mm);
    EXPECT_LT(page.bar.y + page.bar.height, page.first_baseline_y_mm - page.text_size_mm);
    const double last_line_mm =
        page.first_baseline_y_mm +
        static_cast<double>(page.caption.size() - 1) * kLineHeight * page.text_size_mm;
    EXPECT_LT(last_line_mm + 0.3 * page.text_size_mm, page.height_mm);
    // The patch is in the middle, and its edge leaves a plateau on both sides.
    EXPECT_NEAR(page.patch.x + page.patch.width / 2, page.pattern.x + page.pattern.width / 2, 1e-9);
    EXPECT_NEAR(page.patch.y + page.patch.height / 2, page.pattern.y + page.pattern.height / 2,
                1e-9);
    EXPECT_GT(page.EdgeX(page.patch.y + page.patch.height) - page.patch.x, 0.3 * page.patch.width);
    EXPECT_LT(page.EdgeX(page.patch.y) - page.patch.x, 0.7 * page.patch.width);
  }
}

// At 512 px over the field the edge is large enough for an edge estimator: 60 px of length, 30 px
// of plateau.
TEST(LayOutTarget, MakesTheEdgeLargeEnoughToBeMeasured) {
  for (const CameraView& view :
       {MadeUpView(512, 512, 0.25), MadeUpView(512, 384, 0.25), MadeUpView(384, 512, 0.25)}) {
    TargetRequest request;
    request.sheet = kA4;
    request.view = view;
    const TargetPage page = LayOutTarget(request);
    EXPECT_GE(page.patch.height / view.px_mm, 100);
    const double lower_mm = page.EdgeX(page.patch.y + page.patch.height) - page.patch.x;
    const double upper_mm = page.patch.x + page.patch.width - page.EdgeX(page.patch.y);
    EXPECT_GE(std::min(lower_mm, upper_mm) / view.px_mm, 45);
  }
}

TEST(LayOutTarget, OverfillsTheFieldOfACamera) {
  TargetRequest request;
  request.sheet = kA4;
  request.view = MadeUpView(640, 480, 0.2);  // 128 x 96 mm
  const TargetPage page = LayOutTarget(request);
  EXPECT_NEAR(page.pattern.width, 1.15 * 128, 0.1);
  EXPECT_NEAR(page.pattern.height, 1.15 * 96, 0.1);
  EXPECT_DOUBLE_EQ(page.feature_mm, 0.6);
  EXPECT_THAT(page.choice, AllOf(HasSubstr("0.6 mm (3.0 px"), HasSubstr("2 to 6 px"),
                                 HasSubstr("128.0 x 96.0 mm plus 15 %")));
  EXPECT_THAT(page.caption[2], HasSubstr("sees 128.0 x 96.0 mm at 1000 mm"));
}

TEST(LayOutTarget, TurnsASheetThatHoldsThePatternOnlyLying) {
  TargetRequest request;
  request.sheet = kA4;
  request.view = MadeUpView(640, 300, 0.33);  // 211.2 x 99 mm
  const TargetPage page = LayOutTarget(request);
  EXPECT_EQ(page.width_mm, 297);
  EXPECT_EQ(page.height_mm, 210);
  request.sheet.may_turn = false;
  EXPECT_THAT(RefusalOf(request), HasSubstr("does not fit the sheet of 210 x 297 mm"));
}

TEST(LayOutTarget, TakesTheFinestPrintWhereThreePixelsAreFiner) {
  TargetRequest request;
  request.sheet = kA4;
  request.view = MadeUpView(640, 480, 0.02);
  EXPECT_DOUBLE_EQ(LayOutTarget(request).feature_mm, 0.1);
  EXPECT_THAT(LayOutTarget(request).choice, HasSubstr("5.0 px of the image at 1000 mm"));
  request.finest_mm = 0.05;
  EXPECT_DOUBLE_EQ(LayOutTarget(request).feature_mm, 0.06);
}

TEST(LayOutTarget, RefusesWhatCannotBePrintedOrSeen) {
  TargetRequest request;
  request.sheet = kA4;
  request.view = MadeUpView(640, 480, 0.5);
  EXPECT_THAT(RefusalOf(request),
              AllOf(HasSubstr("sees 320.0 x 240.0 mm"), HasSubstr("larger sheet")));
  request.view = MadeUpView(640, 480, 0.01);
  EXPECT_THAT(RefusalOf(request), AllOf(HasSubstr("0.02 to 0.06 mm"), HasSubstr("0.1 mm"),
                                        HasSubstr("larger distance")));
  request.view.reset();
  request.feature_mm = 0.09;
  EXPECT_THAT(RefusalOf(request), HasSubstr("0.09 mm is below the 0.1 mm"));
  request.feature_mm = 7;
  EXPECT_THAT(RefusalOf(request), HasSubstr("no room for a texture"));
  request.feature_mm = 0.1;
  request.sheet = {297, 420, true};
  EXPECT_THAT(RefusalOf(request), HasSubstr("more than 5 million"));
}

TEST(LayOutTarget, FeaturesThatDoNotSuitTheCameraAreReported) {
  TargetRequest request;
  request.sheet = kA4;
  request.view = MadeUpView(640, 480, 0.2);
  request.feature_mm = 0.2;
  EXPECT_THAT(LayOutTarget(request).choice, HasSubstr("1.0 px of the image at 1000 mm, finer"));
  request.feature_mm = 2;
  EXPECT_THAT(LayOutTarget(request).choice, HasSubstr("10.0 px of the image at 1000 mm, coarser"));
  request.feature_mm = 0.8;
  EXPECT_THAT(LayOutTarget(request).choice, HasSubstr("4.0 px of the image at 1000 mm)"));
}

// In focus m = f1/(zf - f1), whatever f2 and the thickness are. The distance that a refusal names
// is one that is accepted.
TEST(ViewOfTarget, IsWhatAThickLensSeesInFocus) {
  Camera camera;
  camera.lens = {50, 52, 4, 10};
  camera.sensor.width_px = 640;
  camera.sensor.height_px = 480;
  camera.sensor.pixel_pitch_mm = 0.004;
  const CameraView view = ViewOfTarget(camera, 800);
  EXPECT_NEAR(view.px_mm, 0.004 * (800 - 50) / 50, 1e-12);
  EXPECT_NEAR(view.width_mm, 38.4, 1e-9);
  EXPECT_NEAR(view.height_mm, 28.8, 1e-9);
  EXPECT_THROW(ViewOfTarget(camera, 50), Error);

  TargetRequest request;
  request.sheet = kA4;
  request.view = ViewOfTarget(camera, 200);
  const std::string refusal = RefusalOf(request);
  const std::size_t at = refusal.find("distance (");
  ASSERT_NE(at, std::string::npos) << refusal;
  const double named_mm = std::stod(refusal.substr(at + 10));
  request.view = ViewOfTarget(camera, named_mm);
  EXPECT_THAT(RefusalOf(request), HasSubstr("laid out"));
  request.view = ViewOfTarget(camera, named_mm - 2);
  EXPECT_THAT(RefusalOf(request), HasSubstr("larger distance"));
}

// The marks stand outside of the texture, with a white border, at whole multiples of four sides.
TEST(LayOutTarget, MarksStandAroundTheTexture) {
  TargetRequest request;
  for (const SheetSize& sheet : {kA4, SheetSize{297, 420, true}, SheetSize{215.9, 279.4, true}}) {
    request.sheet = sheet;
    const TargetPage page = LayOutTarget(request);
    ASSERT_EQ(page.marks.size(), 4U);
    const double side = page.marks[0].area.width;
    for (const PlacedMark& mark : page.marks) {
      const std::optional<SheetMark> known = SheetMarkOf(mark.number);
      ASSERT_TRUE(known);
      EXPECT_EQ(known->side_mm, side);
      const double border = side / 8;
      const SheetRectangle& at = mark.area;
      const bool beside = at.x + side + border <= page.pattern.x ||
                          at.x - border >= page.pattern.x + page.pattern.width ||
                          at.y + side + border <= page.pattern.y ||
                          at.y - border >= page.pattern.y + page.pattern.height;
      EXPECT_TRUE(beside) << mark.number;
      EXPECT_GT(at.x - border, 0);
      EXPECT_LT(at.y + side + border, page.height_mm);
      const double columns = (at.x - page.marks[0].area.x) / (4 * side);
      const double rows = (at.y - page.marks[0].area.y) / (4 * side);
      EXPECT_NEAR(columns, std::round(columns), 1e-9);
      EXPECT_NEAR(rows, std::round(rows), 1e-9);
    }
    EXPECT_THAT(page.caption.back(), HasSubstr("apriltag_36h11"));
    EXPECT_GT(page.marks[3].area.x, page.marks[0].area.x);
  }
  request.has_marks = false;
  EXPECT_TRUE(LayOutTarget(request).marks.empty());
}

// The marks for a camera are in its field, where they replace the texture.
TEST(LayOutTarget, MarksOfACameraAreInItsField) {
  TargetRequest request;
  request.sheet = kA4;
  request.view = MadeUpView(640, 480, 0.2);
  const TargetPage page = LayOutTarget(request);
  ASSERT_EQ(page.marks.size(), 4U);
  const double left = page.pattern.x + (page.pattern.width - request.view->width_mm) / 2;
  const double top = page.pattern.y + (page.pattern.height - request.view->height_mm) / 2;
  EXPECT_GT(page.marks[0].area.x, left);
  EXPECT_GT(page.marks[0].area.y, top);
  EXPECT_LT(page.marks[3].area.x + page.marks[3].area.width, left + request.view->width_mm);
  EXPECT_LT(page.marks[3].area.y + page.marks[3].area.height, top + request.view->height_mm);
}

TEST(LayOutTarget, AGridHasItsSizeAndIsStated) {
  TargetRequest request;
  request.sheet = kA4;
  request.grid = TargetGrid();
  request.grid->pattern = GridPattern::kCharuco;
  request.grid->columns = 11;
  request.grid->rows = 8;
  request.grid->square_mm = 18;
  request.grid->marker_mm = 12;
  const TargetPage page = LayOutTarget(request);
  EXPECT_EQ(page.width_mm, 297) << "turned";
  EXPECT_EQ(page.pattern.width, 198);
  EXPECT_EQ(page.pattern.height, 144);
  EXPECT_TRUE(page.marks.empty());
  EXPECT_THAT(page.caption[0], HasSubstr("ChArUco board of 11 x 8 squares of 18 mm"));
  EXPECT_EQ(page.caption[1],
            "target_grid: {pattern: charuco, columns: 11, rows: 8, square_mm: 18, marker_mm: 12, "
            "dictionary: 4x4_250}");
}

// One number is odd and the other even, so that a chequerboard has one upright position.
TEST(LayOutTarget, AGridFillsTheSheetOrTheField) {
  TargetRequest request;
  request.sheet = kA4;
  request.grid = TargetGrid();
  request.grid->square_mm = 12;
  const TargetPage sheet = LayOutTarget(request);
  ASSERT_TRUE(sheet.grid);
  EXPECT_EQ((sheet.grid->columns + sheet.grid->rows) % 2, 1);
  EXPECT_GE(sheet.grid->columns, 14);
  EXPECT_GE(sheet.grid->rows, 19);
  request.view = MadeUpView(640, 480, 0.2);  // 128 x 96 mm
  const TargetPage field = LayOutTarget(request);
  EXPECT_LE(field.pattern.width, 0.9 * 128);
  EXPECT_LE(field.pattern.height, 0.9 * 96);
  request.grid->square_mm = 40;
  EXPECT_THAT(RefusalOf(request),
              HasSubstr("columns of a chequerboard must be from 4 to 200, found 1"));
  request.view.reset();
  request.grid->columns = request.grid->rows = 9;
  EXPECT_THAT(RefusalOf(request), HasSubstr("does not fit the sheet"));
  request.grid->square_mm = 0.5;
  EXPECT_THAT(RefusalOf(request), HasSubstr("ten times the 0.1 mm"));
}

}  // namespace
}  // namespace thicklens::model

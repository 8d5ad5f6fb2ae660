#include "thicklens/model/target_grid.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;

std::string ErrorOfGrid(const std::string& text) {
  try {
    ParseTargetGrid(text);
  } catch (const Error& error) {
    return error.what();
  }
  return "(no error)";
}

TEST(TargetGrid, IsReadFromALine) {
  const TargetGrid board = ParseTargetGrid("checkerboard:11x8:10");
  EXPECT_EQ(board.pattern, GridPattern::kChequerboard);
  EXPECT_EQ(board.columns, 11);
  EXPECT_EQ(board.rows, 8);
  EXPECT_EQ(board.square_mm, 10);
  EXPECT_EQ(board.Description(), "chequerboard of 11 x 8 squares of 10 mm");
  const TargetGrid charuco = ParseTargetGrid("charuco:7x5:6.5:4:5x5_100");
  EXPECT_EQ(charuco.marker_mm, 4);
  EXPECT_EQ(charuco.dictionary, "5x5_100");
  EXPECT_DOUBLE_EQ(ParseTargetGrid("charuco:7x5:10").marker_mm, 7);
  EXPECT_EQ(ParseTargetGrid("circles:9x7:12").pattern, GridPattern::kCircles);
}

TEST(TargetGrid, AWrongLineIsRefusedWithTheForm) {
  EXPECT_THAT(ErrorOfGrid("11x8"), HasSubstr("PATTERN:COLUMNSxROWS:SQUARE_MM"));
  EXPECT_THAT(ErrorOfGrid("dots:11x8:10"), HasSubstr("the pattern 'dots' is not known"));
  EXPECT_THAT(ErrorOfGrid("circles:2x8:10"), HasSubstr("columns must be from 3 to 200, found 2"));
  EXPECT_THAT(ErrorOfGrid("chequerboard:3x8:10"),
              HasSubstr("columns of a chequerboard must be from 4 to 200, found 3"));
  EXPECT_THAT(ErrorOfGrid("chequerboard:8x3:10"), HasSubstr("rows of a chequerboard must be"));
  EXPECT_THAT(ErrorOfGrid("charuco:4x3:10"), HasSubstr("at least 8 inner corners"));
  EXPECT_EQ(ParseTargetGrid("charuco:5x3:10").rows, 3);
  EXPECT_EQ(ParseTargetGrid("chequerboard:4x4:10").rows, 4);
  EXPECT_THAT(ErrorOfGrid("circles:9x8:0"), HasSubstr("square_mm must be from"));
  EXPECT_THAT(ErrorOfGrid("circles:9x8:5:3"), HasSubstr("is expected"));
  EXPECT_THAT(ErrorOfGrid("charuco:9x8:5:6"), HasSubstr("marker_mm must be above 0 and below"));
  EXPECT_THAT(ErrorOfGrid("charuco:9x8:5:3:9x9"), HasSubstr("dictionary must be one of 4x4_50"));
  EXPECT_THAT(ErrorOfGrid("circles:9by8:5"), HasSubstr("is expected"));
  EXPECT_THAT(ErrorOfGrid("circles:9x8:5mm"), HasSubstr("is expected"));
}

// Whether a point is black: in a rectangle or disc.
bool IsBlack(const std::vector<GridShape>& shapes, double x, double y) {
  for (const GridShape& shape : shapes) {
    if (shape.is_disc
            ? std::hypot(x - shape.x, y - shape.y) < 0.5 * shape.width
            : x > shape.x && x < shape.x + shape.width && y > shape.y && y < shape.y + shape.height)
      return true;
  }
  return false;
}

TEST(TargetGrid, FourSquaresMeetAtEachPoint) {
  const TargetGrid board = ParseTargetGrid("chequerboard:7x6:10");
  const std::vector<GridShape> black = BlackShapes(board);
  EXPECT_EQ(black.size(), 21U);
  EXPECT_TRUE(IsBlack(black, 5, 5)) << "the top left square";
  const std::vector<Eigen::Vector2d> points = GridPoints(board);
  ASSERT_EQ(points.size(), 30U);
  for (const Eigen::Vector2d& at : points) {
    const bool first = IsBlack(black, at.x() - 1, at.y() - 1);
    EXPECT_EQ(IsBlack(black, at.x() + 1, at.y() + 1), first);
    EXPECT_NE(IsBlack(black, at.x() + 1, at.y() - 1), first);
    EXPECT_NE(IsBlack(black, at.x() - 1, at.y() + 1), first);
  }
}

TEST(TargetGrid, CirclesLieAroundTheirPoints) {
  const TargetGrid grid = ParseTargetGrid("circles:5x4:10");
  const std::vector<GridShape> black = BlackShapes(grid);
  EXPECT_EQ(black.size(), 20U);
  for (const Eigen::Vector2d& at : GridPoints(grid)) {
    EXPECT_TRUE(IsBlack(black, at.x() + 2.9, at.y()));
    EXPECT_FALSE(IsBlack(black, at.x() + 3.1, at.y()));
  }
  EXPECT_DOUBLE_EQ(grid.SizeMm().x(), 46);
}

// A marker has a black border, lies in a white square, and no two are equal.
TEST(TargetGrid, MarkersLieInTheWhiteSquares) {
  const TargetGrid board = ParseTargetGrid("charuco:7x5:10");
  const std::vector<GridShape> black = BlackShapes(board);
  const auto markers = CharucoMarkers(board, false);
  EXPECT_EQ(markers.size(), 17U);
  for (const auto& corners : markers) {
    EXPECT_FALSE(IsBlack(black, corners[0].x() - 0.5, corners[0].y() - 0.5));
    EXPECT_TRUE(IsBlack(black, corners[0].x() + 0.1, corners[0].y() + 0.1));
    EXPECT_TRUE(IsBlack(black, corners[2].x() - 0.1, corners[2].y() - 0.1));
    EXPECT_DOUBLE_EQ(corners[2].x() - corners[0].x(), 7);
  }
  EXPECT_NE(MarkerModules("4x4_250", 0), MarkerModules("4x4_250", 1));
  EXPECT_EQ(MarkerModules("4x4_250", 0).size(), 6U);
  EXPECT_EQ(CharucoMarkers(board, true).size(), 18U);
  EXPECT_THROW(MarkerModules("4x4_50", 50), Error);
}

TEST(TargetGrid, ANumberOfAMarkStatesCornerAndSide) {
  for (int corner = 0; corner < 4; ++corner) {
    const std::optional<int> number = NumberOfSheetMark(corner, 9.5);
    ASSERT_TRUE(number);
    const std::optional<SheetMark> mark = SheetMarkOf(*number);
    ASSERT_TRUE(mark);
    EXPECT_EQ(mark->corner, corner);
    EXPECT_EQ(mark->side_mm, 8);
    EXPECT_EQ(MarkerModules(kSheetDictionary, *number).size(), 8U);
  }
  EXPECT_FALSE(NumberOfSheetMark(0, 1.9));
  EXPECT_FALSE(SheetMarkOf(0));
  EXPECT_FALSE(SheetMarkOf(576));
  EXPECT_EQ(SheetMarkOf(*NumberOfSheetMark(3, 1000))->side_mm, 50);
}

}  // namespace
}  // namespace thicklens::model

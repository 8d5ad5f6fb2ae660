#ifndef THICKLENS_MODEL_TARGET_GRID_H_
#define THICKLENS_MODEL_TARGET_GRID_H_

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"

namespace thicklens::model {

// The pattern of a grid.
enum class GridPattern {
  kChequerboard,  // black and white squares
  kCharuco,       // a chequerboard with a marker in each white square
  kCircles,       // black circles in rows and columns
};
// Name of the pattern: "chequerboard", "charuco" or "circles".
THICKLENS_EXPORT std::string GridPatternName(GridPattern pattern);
// The pattern of a name; "checkerboard" and "chessboard" are accepted, too. Absent: there is none.
THICKLENS_EXPORT std::optional<GridPattern> GridPatternOf(const std::string& name);

// A flat grid on the target. Positions are in mm from the top left corner of the grid, x to the
// right, y down. The top left square of a chequerboard is black. The markers of a ChArUco board
// have the numbers 0, 1, .. row by row; boards of OpenCV before 4.7 with an even number of rows,
// whose top left square is white, are found as well.
struct TargetGrid {
  GridPattern pattern = GridPattern::kChequerboard;  // what is drawn
  int columns = 0, rows = 0;           // squares along x and y; of kCircles the circles
  double square_mm = 0;                // side of a square; of kCircles the distance of the centres
  double marker_mm = 0;                // side of a marker of kCharuco, below square_mm
  std::string dictionary = "4x4_250";  // of the markers of kCharuco, as OpenCV names it

  // Returns whether the grid can be drawn and found. Otherwise `why`, if not null, gets the field,
  // the value and what would be right.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
  // Width and height of the grid, mm.
  THICKLENS_EXPORT Eigen::Vector2d SizeMm() const;
  // One line: "chequerboard of 11 x 8 squares of 10 mm".
  THICKLENS_EXPORT std::string Description() const;
};

// Part of square_mm that a marker's side has unless it is stated.
inline constexpr double kMarkerPart = 0.7;
// Radius of a circle as a part of the distance of the centres.
inline constexpr double kCirclePart = 0.3;

// Reads "PATTERN:COLUMNSxROWS:SQUARE_MM[:MARKER_MM[:DICTIONARY]]", such as "charuco:11x8:10".
// Throws Error with the form that is expected.
THICKLENS_EXPORT TargetGrid ParseTargetGrid(const std::string& text);

// A black rectangle or disc of a grid.
struct GridShape {
  bool is_disc = false;          // true: `x` and `y` are its centre and `width` its diameter
  double x = 0, y = 0;           // top left corner, mm from that of the grid
  double width = 0, height = 0;  // size, mm
};
// Everything that is black on white paper. Throws Error if the grid is not valid.
THICKLENS_EXPORT std::vector<GridShape> BlackShapes(const TargetGrid& grid);

// The points that are found in an image, row by row: inner corners of the squares, or centres of
// the circles, mm.
THICKLENS_EXPORT std::vector<Eigen::Vector2d> GridPoints(const TargetGrid& grid);

// The corners of the markers of a ChArUco board: [number][corner], clockwise from the top left, mm.
// With `first_is_white` the top left square is white and has the marker 0.
THICKLENS_EXPORT std::vector<std::vector<Eigen::Vector2d>> CharucoMarkers(const TargetGrid& grid,
                                                                          bool first_is_white);

// Number of OpenCV's predefined dictionary of that name; -1: there is none.
THICKLENS_EXPORT int DictionaryNumber(const std::string& name);
// Rows of modules of a marker with its black border, true: black. Throws Error if the dictionary
// has no such marker, or if the program was built without OpenCV's aruco.
THICKLENS_EXPORT std::vector<std::vector<bool>> MarkerModules(const std::string& dictionary,
                                                              int number);

// The dictionary of the marks at the corners of the sheet of a texture. A marker's number states
// the corner and the side.
inline constexpr char kSheetDictionary[] = "apriltag_36h11";
// The distances between marks along x and y are whole multiples of so many sides, so that two marks
// in view give the scale of the sheet without any statement.
inline constexpr int kMarkStep = 4;
// A mark of a sheet.
struct SheetMark {
  int corner = 0;      // 0 top left, 1 top right, 2 bottom left, 3 bottom right
  double side_mm = 0;  // side of the black square, mm
};
// The mark of a marker's number; absent: it is not on a sheet of this program.
THICKLENS_EXPORT std::optional<SheetMark> SheetMarkOf(int number);
// The number of the mark in a corner, of the largest side that is not above `side_mm`; absent: that
// is below the smallest side.
THICKLENS_EXPORT std::optional<int> NumberOfSheetMark(int corner, double side_mm);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_TARGET_GRID_H_

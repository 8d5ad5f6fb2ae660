#include "thicklens/model/target_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <opencv2/core.hpp>
#ifdef THICKLENS_HAS_ARUCO
#include <opencv2/aruco.hpp>
#endif

#include "thicklens/base/error.h"
#include "thicklens/base/validity.h"

namespace thicklens::model {
namespace {

constexpr int kMinCount = 3, kMaxCount = 200;  // squares or circles along a side
// OpenCV's detectors need as many: three inner corners along a side, and eight of a ChArUco board.
constexpr int kMinChequerCount = 4, kMinCharucoCorners = 8;
constexpr double kSmallestMm = 1e-4, kLargestMm = 1e4;

// The dictionaries that OpenCV 4.6 has, in the order of its enumeration.
constexpr std::array<const char*, 21> kDictionaries = {
    "4x4_50",        "4x4_100",        "4x4_250",       "4x4_1000",      "5x5_50",
    "5x5_100",       "5x5_250",        "5x5_1000",      "6x6_50",        "6x6_100",
    "6x6_250",       "6x6_1000",       "7x7_50",        "7x7_100",       "7x7_250",
    "7x7_1000",      "aruco_original", "apriltag_16h5", "apriltag_25h9", "apriltag_36h10",
    "apriltag_36h11"};

// Sides of the marks of a sheet, mm. A mark's number is kFirstMark + 4 (index of its side) +
// corner. Marks of other programs mostly have small numbers.
constexpr std::array<double, 14> kMarkSidesMm = {2, 3, 4, 5, 6, 8, 10, 12, 15, 20, 25, 30, 40, 50};
constexpr int kFirstMark = 520;
constexpr int kCorners = 4;

constexpr char kForm[] =
    "PATTERN:COLUMNSxROWS:SQUARE_MM, such as chequerboard:11x8:10, charuco:11x8:10[:MARKER_MM"
    "[:DICTIONARY]] or circles:9x7:12, is expected";

bool IsWhite(int column, int row, bool first_is_white) {
  return ((column + row) % 2 == 0) == first_is_white;
}

std::vector<std::string> Split(const std::string& text, char separator) {
  std::vector<std::string> parts(1);
  for (const char letter : text) {
    if (letter == separator) {
      parts.emplace_back();
    } else {
      parts.back() += letter;
    }
  }
  return parts;
}

template <typename Number>
std::optional<Number> NumberOf(const std::string& text) {
  Number number{};
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (failure != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return number;
}

}  // namespace

std::string GridPatternName(GridPattern pattern) {
  switch (pattern) {
    case GridPattern::kCharuco:
      return "charuco";
    case GridPattern::kCircles:
      return "circles";
    case GridPattern::kChequerboard:
      break;
  }
  return "chequerboard";
}

std::optional<GridPattern> GridPatternOf(const std::string& name) {
  if (name == "checkerboard" || name == "chessboard") return GridPattern::kChequerboard;
  for (const GridPattern pattern :
       {GridPattern::kChequerboard, GridPattern::kCharuco, GridPattern::kCircles}) {
    if (name == GridPatternName(pattern)) return pattern;
  }
  return std::nullopt;
}

bool TargetGrid::IsValid(std::string* why) const {
  const bool is_chequerboard = pattern == GridPattern::kChequerboard;
  const int least = is_chequerboard ? kMinChequerCount : kMinCount;
  for (const auto& [name, count] : {std::pair("columns", columns), {"rows", rows}}) {
    if (count < least || count > kMaxCount) {
      return Fail(
          why, fmt::format("{}{} must be from {} to {}, found {}", name,
                           is_chequerboard ? " of a chequerboard" : "", least, kMaxCount, count));
    }
  }
  const int corners = (columns - 1) * (rows - 1);
  if (pattern == GridPattern::kCharuco && corners < kMinCharucoCorners) {
    return Fail(why, fmt::format("columns and rows of a ChArUco board must give at least {} inner "
                                 "corners, such as 5 x 3 squares, found {} by {} x {}",
                                 kMinCharucoCorners, corners, columns, rows));
  }
  if (!(square_mm >= kSmallestMm && square_mm <= kLargestMm)) {
    return Fail(why, fmt::format("square_mm must be from {} to {} mm, found {}", kSmallestMm,
                                 kLargestMm, square_mm));
  }
  if (pattern != GridPattern::kCharuco) return true;
  if (!(marker_mm > 0 && marker_mm < square_mm)) {
    return Fail(why, fmt::format("marker_mm must be above 0 and below square_mm ({}), found {}",
                                 square_mm, marker_mm));
  }
  if (DictionaryNumber(dictionary) < 0) {
    return Fail(why, fmt::format("dictionary must be one of {}, found '{}'",
                                 fmt::join(kDictionaries, ", "), dictionary));
  }
  return true;
}

Eigen::Vector2d TargetGrid::SizeMm() const {
  if (pattern != GridPattern::kCircles) return {columns * square_mm, rows * square_mm};
  return {(columns - 1 + 2 * kCirclePart) * square_mm, (rows - 1 + 2 * kCirclePart) * square_mm};
}

std::string TargetGrid::Description() const {
  switch (pattern) {
    case GridPattern::kCharuco:
      return fmt::format("ChArUco board of {} x {} squares of {:g} mm, markers of {:g} mm, {}",
                         columns, rows, square_mm, marker_mm, dictionary);
    case GridPattern::kCircles:
      return fmt::format("{} x {} circles {:g} mm apart", columns, rows, square_mm);
    case GridPattern::kChequerboard:
      break;
  }
  return fmt::format("chequerboard of {} x {} squares of {:g} mm", columns, rows, square_mm);
}

TargetGrid ParseTargetGrid(const std::string& text) {
  const auto wrong = [&](const std::string& why) {
    return Error(fmt::format("'{}': {}{}{}", text, why, why.empty() ? "" : "; ", kForm));
  };
  const std::vector<std::string> parts = Split(text, ':');
  if (parts.size() < 3) throw wrong("");
  TargetGrid grid;
  const std::optional<GridPattern> pattern = GridPatternOf(parts[0]);
  if (!pattern) throw wrong(fmt::format("the pattern '{}' is not known", parts[0]));
  grid.pattern = *pattern;
  const std::vector<std::string> counts = Split(parts[1], 'x');
  const std::optional<int> columns = counts.size() == 2 ? NumberOf<int>(counts[0]) : std::nullopt;
  const std::optional<int> rows = counts.size() == 2 ? NumberOf<int>(counts[1]) : std::nullopt;
  const std::optional<double> square_mm = NumberOf<double>(parts[2]);
  if (!columns || !rows || !square_mm) throw wrong("");
  grid.columns = *columns;
  grid.rows = *rows;
  grid.square_mm = *square_mm;
  const bool is_charuco = grid.pattern == GridPattern::kCharuco;
  constexpr std::size_t kMaxParts = 5;
  if (parts.size() > (is_charuco ? kMaxParts : 3)) throw wrong("");
  if (is_charuco) grid.marker_mm = kMarkerPart * grid.square_mm;
  if (parts.size() > 3) {
    const std::optional<double> marker_mm = NumberOf<double>(parts[3]);
    if (!marker_mm) throw wrong("");
    grid.marker_mm = *marker_mm;
  }
  if (parts.size() > 4) grid.dictionary = parts[4];
  std::string why;
  if (!grid.IsValid(&why)) throw wrong(why);
  return grid;
}

std::vector<std::vector<Eigen::Vector2d>> CharucoMarkers(const TargetGrid& grid,
                                                         bool first_is_white) {
  std::vector<std::vector<Eigen::Vector2d>> markers;
  const double border_mm = 0.5 * (grid.square_mm - grid.marker_mm);
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) {
      if (!IsWhite(column, row, first_is_white)) continue;
      const Eigen::Vector2d corner_mm(column * grid.square_mm + border_mm,
                                      row * grid.square_mm + border_mm);
      const double side_mm = grid.marker_mm;
      markers.push_back({corner_mm, corner_mm + Eigen::Vector2d(side_mm, 0),
                         corner_mm + Eigen::Vector2d(side_mm, side_mm),
                         corner_mm + Eigen::Vector2d(0, side_mm)});
    }
  }
  return markers;
}

std::vector<GridShape> BlackShapes(const TargetGrid& grid) {
  std::string why;
  if (!grid.IsValid(&why)) throw Error("grid: " + why);
  std::vector<GridShape> shapes;
  if (grid.pattern == GridPattern::kCircles) {
    const double radius_mm = kCirclePart * grid.square_mm;
    for (const Eigen::Vector2d& centre_mm : GridPoints(grid))
      shapes.push_back({true, centre_mm.x(), centre_mm.y(), 2 * radius_mm, 2 * radius_mm});
    return shapes;
  }
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) {
      if (IsWhite(column, row, false)) continue;
      shapes.push_back(
          {false, column * grid.square_mm, row * grid.square_mm, grid.square_mm, grid.square_mm});
    }
  }
  if (grid.pattern != GridPattern::kCharuco) return shapes;
  int number = 0;
  for (const std::vector<Eigen::Vector2d>& corners : CharucoMarkers(grid, false)) {
    const std::vector<std::vector<bool>> modules = MarkerModules(grid.dictionary, number++);
    const double module_mm = grid.marker_mm / static_cast<double>(modules.size());
    for (std::size_t i = 0; i < modules.size(); ++i) {
      // One rectangle for each run of black modules.
      for (std::size_t j = 0; j < modules[i].size();) {
        std::size_t end = j;
        while (end < modules[i].size() && modules[i][end]) ++end;
        if (end > j) {
          shapes.push_back({false, corners[0].x() + static_cast<double>(j) * module_mm,
                            corners[0].y() + static_cast<double>(i) * module_mm,
                            static_cast<double>(end - j) * module_mm, module_mm});
        }
        j = end + 1;
      }
    }
  }
  return shapes;
}

std::vector<Eigen::Vector2d> GridPoints(const TargetGrid& grid) {
  const bool is_circles = grid.pattern == GridPattern::kCircles;
  const int columns = is_circles ? grid.columns : grid.columns - 1;
  const int rows = is_circles ? grid.rows : grid.rows - 1;
  const double first_mm = is_circles ? kCirclePart * grid.square_mm : grid.square_mm;
  std::vector<Eigen::Vector2d> points;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column)
      points.emplace_back(first_mm + column * grid.square_mm, first_mm + row * grid.square_mm);
  }
  return points;
}

int DictionaryNumber(const std::string& name) {
  const auto* const found = std::find(kDictionaries.begin(), kDictionaries.end(), name);
  return found == kDictionaries.end() ? -1 : static_cast<int>(found - kDictionaries.begin());
}

std::vector<std::vector<bool>> MarkerModules(const std::string& dictionary, int number) {
#ifdef THICKLENS_HAS_ARUCO
  const int kind = DictionaryNumber(dictionary);
  if (kind < 0) throw Error(fmt::format("there is no dictionary of markers '{}'", dictionary));
  const cv::Ptr<cv::aruco::Dictionary> markers = cv::aruco::getPredefinedDictionary(kind);
  if (number < 0 || number >= markers->bytesList.rows) {
    throw Error(
        fmt::format("the dictionary {} has {} markers, number {} is needed: choose a larger "
                    "dictionary or fewer squares",
                    dictionary, markers->bytesList.rows, number));
  }
  const int side = markers->markerSize + 2;
  cv::Mat image;
  cv::aruco::drawMarker(markers, number, side, image, 1);
  std::vector<std::vector<bool>> modules(static_cast<std::size_t>(side));
  for (int row = 0; row < side; ++row) {
    for (int column = 0; column < side; ++column)
      modules[static_cast<std::size_t>(row)].push_back(image.at<std::uint8_t>(row, column) == 0);
  }
  return modules;
#else
  throw Error(
      fmt::format("marker {} of {} cannot be drawn: this program was built without OpenCV's "
                  "aruco module (Debian package libopencv-contrib-dev)",
                  number, dictionary));
#endif
}

std::optional<SheetMark> SheetMarkOf(int number) {
  const int index = (number - kFirstMark) / kCorners;
  if (number < kFirstMark || index >= static_cast<int>(kMarkSidesMm.size())) return std::nullopt;
  return SheetMark{(number - kFirstMark) % kCorners, kMarkSidesMm[static_cast<std::size_t>(index)]};
}

std::optional<int> NumberOfSheetMark(int corner, double side_mm) {
  const auto* const above =
      std::upper_bound(kMarkSidesMm.begin(), kMarkSidesMm.end(), side_mm * (1 + 1e-9));
  if (above == kMarkSidesMm.begin()) return std::nullopt;
  return kFirstMark + kCorners * static_cast<int>(above - kMarkSidesMm.begin() - 1) + corner;
}

}  // namespace thicklens::model

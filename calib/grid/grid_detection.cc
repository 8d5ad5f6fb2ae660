#include "calib/grid/grid_detection.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#ifdef THICKLENS_HAS_ARUCO
#include <opencv2/aruco.hpp>
#endif

namespace thicklens::calib {
namespace {

// Patterns are looked for in an image of at most this size, and their corners in the whole one.
constexpr int kSearchSidePx = 1600;
constexpr std::size_t kMinPoints = 8;
constexpr double kWhitePart = 0.995;  // quantile of the light that is shown as white
constexpr int kMinMarkers = 3;

// 8-bit linear light, which detectors expect.
cv::Mat Bytes(const cv::Mat& light) {
  std::vector<float> values;
  const int stride = std::max(1, static_cast<int>(light.total() / 100000));
  for (int i = 0; i < static_cast<int>(light.total()); i += stride)
    values.push_back(light.at<float>(i / light.cols, i % light.cols));
  const auto white = values.begin() + static_cast<std::ptrdiff_t>(
                                          kWhitePart * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), white, values.end());
  cv::Mat bytes;
  light.convertTo(bytes, CV_8U, 255.0 / std::max(*white, 1e-6F));
  return bytes;
}

// Shrinks a large image, and returns by which factor.
double Shrunk(cv::Mat* bytes) {
  const double shrink =
      std::min(1.0, static_cast<double>(kSearchSidePx) / std::max(bytes->cols, bytes->rows));
  if (shrink < 1) cv::resize(*bytes, *bytes, {}, shrink, shrink, cv::INTER_AREA);
  return shrink;
}
cv::Point2f AtFullSize(const cv::Point2f& at, double shrink) {
  return {static_cast<float>((at.x + 0.5) / shrink - 0.5),
          static_cast<float>((at.y + 0.5) / shrink - 0.5)};
}

double At(const cv::Mat& light, const cv::Point2d& at) {
  const int x = std::clamp(static_cast<int>(std::lround(at.x)), 0, light.cols - 1);
  const int y = std::clamp(static_cast<int>(std::lround(at.y)), 0, light.rows - 1);
  return light.at<float>(y, x);
}

cv::TermCriteria Precisely() {
  return {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 100, 1e-4};
}

// A full grid, row by row; turned so that rows run to the right and columns down as they are on the
// target: never mirrored, and the first row on top where two readings are possible.
class OrderedGrid {
 public:
  OrderedGrid(std::vector<cv::Point2f> points, int columns, int rows)
      : points_(std::move(points)), columns_(columns), rows_(rows) {
    if (AlongRow().cross(AlongColumn()) < 0) Mirror();
  }

  const cv::Point2f& Point(int column, int row) const {
    return points_[static_cast<std::size_t>(row * columns_ + column)];
  }
  cv::Point2f AlongRow() const { return Point(columns_ - 1, 0) - Point(0, 0); }
  cv::Point2f AlongColumn() const { return Point(0, rows_ - 1) - Point(0, 0); }

  void TurnRound() { std::reverse(points_.begin(), points_.end()); }
  // Turns by a quarter; only where there are as many columns as rows.
  void TurnQuarter() {
    std::vector<cv::Point2f> turned(points_.size());
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < columns_; ++column)
        turned[static_cast<std::size_t>(row * columns_ + column)] = Point(row, rows_ - 1 - column);
    }
    points_ = turned;
  }
  void MakeUpright() {
    // The reading whose rows run most to the right; a quarter turn exists for squares alone.
    const bool is_square = columns_ == rows_;
    for (int turn = 0; turn < 4; ++turn) {
      const cv::Point2f x = AlongRow();
      const bool is_upright = is_square ? x.x >= std::abs(x.y) : x.x > 0 || (x.x == 0 && x.y > 0);
      if (is_upright) return;
      is_square ? TurnQuarter() : TurnRound();
    }
  }

  GridView View() const {
    GridView view;
    for (std::size_t i = 0; i < points_.size(); ++i) {
      view.ids.push_back(static_cast<int>(i));
      view.image_px.emplace_back(points_[i].x, points_[i].y);
    }
    return view;
  }
  std::vector<cv::Point2f>& points() { return points_; }

 private:
  void Mirror() {
    for (int row = 0; row < rows_; ++row) {
      const auto first = points_.begin() + static_cast<std::ptrdiff_t>(row) * columns_;
      std::reverse(first, first + columns_);
    }
  }

  std::vector<cv::Point2f> points_;
  int columns_, rows_;
};

std::optional<GridView> DetectChequerboard(const cv::Mat& light, const model::TargetGrid& grid) {
  const int columns = grid.columns - 1, rows = grid.rows - 1;
  cv::Mat bytes = Bytes(light);
  const double shrink = Shrunk(&bytes);
  std::vector<cv::Point2f> corners;
  if (!cv::findChessboardCornersSB(bytes, {columns, rows}, corners, cv::CALIB_CB_ACCURACY) ||
      corners.size() != static_cast<std::size_t>(columns * rows))
    return std::nullopt;
  for (cv::Point2f& corner : corners) corner = AtFullSize(corner, shrink);
  OrderedGrid ordered(corners, columns, rows);
  if (shrink < 1) {
    const double side_px = cv::norm(ordered.Point(1, 0) - ordered.Point(0, 0));
    const int half = std::clamp(static_cast<int>(0.3 * side_px), 2, 30);
    cv::cornerSubPix(light, ordered.points(), {half, half}, {-1, -1}, Precisely());
  }
  if ((grid.columns + grid.rows) % 2 == 1) {
    // Upside down, the square of the first corner would be white.
    const cv::Point2d at = ordered.Point(0, 0);
    const cv::Point2d x = 0.5 * cv::Point2d(ordered.Point(1, 0) - ordered.Point(0, 0));
    const cv::Point2d y = 0.5 * cv::Point2d(ordered.Point(0, 1) - ordered.Point(0, 0));
    const double black = At(light, at - x - y) + At(light, at + x + y);
    const double white = At(light, at + x - y) + At(light, at - x + y);
    if (black > white) ordered.TurnRound();
  } else {
    ordered.MakeUpright();
  }
  return ordered.View();
}

// The centroid of the darkness around a point, within half of the distance to the next.
cv::Point2f CentroidOfDisc(const cv::Mat& light, const cv::Point2f& at, double half_px) {
  const int reach = std::max(2, static_cast<int>(half_px));
  const cv::Rect window =
      cv::Rect(static_cast<int>(std::lround(at.x)) - reach,
               static_cast<int>(std::lround(at.y)) - reach, 2 * reach + 1, 2 * reach + 1) &
      cv::Rect(0, 0, light.cols, light.rows);
  if (window.width < 2 * reach + 1 || window.height < 2 * reach + 1) return at;
  const cv::Mat part = light(window);
  // The light of the paper as a plane through the border of the window, where lamps are uneven.
  const double x0 = 0.5 * (part.cols - 1), y0 = 0.5 * (part.rows - 1);
  double sum = 0, slope_x = 0, slope_y = 0, square_x = 0, square_y = 0;
  int count = 0;
  for (int y = 0; y < part.rows; ++y) {
    for (int x = 0; x < part.cols; ++x) {
      if (x > 0 && y > 0 && x < part.cols - 1 && y < part.rows - 1) continue;
      const double value = part.at<float>(y, x);
      sum += value;
      slope_x += (x - x0) * value;
      slope_y += (y - y0) * value;
      square_x += (x - x0) * (x - x0);
      square_y += (y - y0) * (y - y0);
      ++count;
    }
  }
  double mass = 0, mx = 0, my = 0, darkest = 0;
  cv::Mat dark(part.size(), CV_64F);
  for (int y = 0; y < part.rows; ++y) {
    for (int x = 0; x < part.cols; ++x) {
      const double paper =
          sum / count + slope_x / square_x * (x - x0) + slope_y / square_y * (y - y0);
      dark.at<double>(y, x) = paper - part.at<float>(y, x);
      darkest = std::max(darkest, dark.at<double>(y, x));
    }
  }
  for (int y = 0; y < part.rows; ++y) {
    for (int x = 0; x < part.cols; ++x) {
      const double weight = dark.at<double>(y, x);
      if (weight < 0.05 * darkest) continue;  // noise of the paper
      mass += weight;
      mx += weight * x;
      my += weight * y;
    }
  }
  if (!(mass > 0)) return at;
  return {static_cast<float>(window.x + mx / mass), static_cast<float>(window.y + my / mass)};
}

std::optional<GridView> DetectCircles(const cv::Mat& light, const model::TargetGrid& grid) {
  const cv::Mat bytes = Bytes(light);
  cv::SimpleBlobDetector::Params blobs;
  blobs.minArea = 20;
  blobs.maxArea = static_cast<float>(light.total()) / 9;
  blobs.minDistBetweenBlobs = 4;
  std::vector<cv::Point2f> centres;
  if (!cv::findCirclesGrid(bytes, {grid.columns, grid.rows}, centres,
                           cv::CALIB_CB_SYMMETRIC_GRID | cv::CALIB_CB_CLUSTERING,
                           cv::SimpleBlobDetector::create(blobs)))
    return std::nullopt;
  OrderedGrid ordered(centres, grid.columns, grid.rows);
  ordered.MakeUpright();
  const double apart_px = std::min(cv::norm(ordered.Point(1, 0) - ordered.Point(0, 0)),
                                   cv::norm(ordered.Point(0, 1) - ordered.Point(0, 0)));
  // The window is one of paper around the disc.
  for (cv::Point2f& centre : ordered.points())
    centre = CentroidOfDisc(light, centre, 0.5 * apart_px);
  return ordered.View();
}

// Corners of the squares near the markers that were found.
class CharucoCorners {
 public:
  CharucoCorners(const model::TargetGrid& grid, const std::vector<FoundMarker>& found,
                 bool first_is_white)
      : grid_(grid), places_(model::CharucoMarkers(grid, first_is_white)) {
    for (const FoundMarker& marker : found) {
      if (marker.number >= 0 && marker.number < static_cast<int>(places_.size()))
        found_.push_back(marker);
    }
  }

  // Number of markers that lie where this layout has them.
  int Agreeing() const {
    if (found_.size() < kMinMarkers) return 0;
    std::vector<cv::Point2f> from, to;
    for (const FoundMarker& marker : found_) AddCorners(marker, &from, &to);
    cv::Mat inliers;
    const double reach_px = 0.3 * SquarePx();
    const cv::Mat map = cv::findHomography(from, to, cv::RANSAC, reach_px, inliers);
    return map.empty() ? 0 : cv::countNonZero(inliers) / 4;
  }

  std::optional<GridView> Find(const cv::Mat& light) const {
    const std::vector<Eigen::Vector2d> corners = model::GridPoints(grid_);
    std::vector<int> ids;
    std::vector<cv::Point2f> points;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      std::vector<cv::Point2f> from, to;
      int near = 0;
      for (const FoundMarker& marker : found_) {
        const auto& place = places_[static_cast<std::size_t>(marker.number)];
        const Eigen::Vector2d centre_mm = 0.5 * (place[0] + place[2]);
        if ((centre_mm - corners[i]).norm() > 1.6 * grid_.square_mm) continue;
        AddCorners(marker, &from, &to);
        ++near;
      }
      if (near < 2) continue;
      const cv::Mat map = cv::findHomography(from, to);
      if (map.empty()) continue;
      std::vector<cv::Point2f> at = {Float(corners[i])}, image;
      cv::perspectiveTransform(at, image, map);
      if (image[0].x < 2 || image[0].y < 2 || image[0].x > static_cast<float>(light.cols) - 3 ||
          image[0].y > static_cast<float>(light.rows) - 3)
        continue;
      ids.push_back(static_cast<int>(i));
      points.push_back(image[0]);
    }
    if (points.size() < kMinPoints) return std::nullopt;
    // The white border of a marker is the room around a corner without other edges.
    const double border_px =
        0.5 * (grid_.square_mm - grid_.marker_mm) / grid_.square_mm * SquarePx();
    const int half = std::clamp(static_cast<int>(std::lround(border_px)), 2, 20);
    const std::vector<cv::Point2f> before = points;
    cv::cornerSubPix(light, points, {half, half}, {-1, -1}, Precisely());
    GridView view;
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (cv::norm(points[i] - before[i]) > half) continue;
      view.ids.push_back(ids[i]);
      view.image_px.emplace_back(points[i].x, points[i].y);
    }
    if (view.ids.size() < kMinPoints) return std::nullopt;
    return view;
  }

 private:
  static cv::Point2f Float(const Eigen::Vector2d& at) {
    return {static_cast<float>(at.x()), static_cast<float>(at.y())};
  }

  void AddCorners(const FoundMarker& marker, std::vector<cv::Point2f>* from,
                  std::vector<cv::Point2f>* to) const {
    const auto& place = places_[static_cast<std::size_t>(marker.number)];
    for (std::size_t i = 0; i < place.size(); ++i) {
      from->push_back(Float(place[i]));
      to->push_back(Float(marker.corners_px[i]));
    }
  }

  double SquarePx() const {
    double smallest_px = 1e9;
    for (const FoundMarker& marker : found_)
      smallest_px = std::min(smallest_px, (marker.corners_px[1] - marker.corners_px[0]).norm());
    return smallest_px * grid_.square_mm / grid_.marker_mm;
  }

  const model::TargetGrid& grid_;
  std::vector<std::vector<Eigen::Vector2d>> places_;
  std::vector<FoundMarker> found_;
};

std::optional<GridView> DetectCharuco(const cv::Mat& light, const model::TargetGrid& grid) {
  const std::vector<FoundMarker> found = FindMarkers(light, grid.dictionary);
  const CharucoCorners black(grid, found, false), white(grid, found, true);
  const int black_fits = black.Agreeing(), white_fits = white.Agreeing();
  if (std::max(black_fits, white_fits) < kMinMarkers) return std::nullopt;
  return (black_fits >= white_fits ? black : white).Find(light);
}

}  // namespace

Eigen::Vector2d FoundMarker::CentrePx() const {
  // The crossing of the diagonals is the image of the centre in any perspective.
  const Eigen::Vector2d a = corners_px[2] - corners_px[0], b = corners_px[3] - corners_px[1];
  const Eigen::Vector2d from = corners_px[1] - corners_px[0];
  const double twice = a.x() * b.y() - a.y() * b.x();
  if (twice == 0) return corners_px[0];
  return corners_px[0] + a * ((from.x() * b.y() - from.y() * b.x()) / twice);
}

bool CanFindMarkers() {
#ifdef THICKLENS_HAS_ARUCO
  return true;
#else
  return false;
#endif
}

std::vector<FoundMarker> FindMarkers(const cv::Mat& light, const std::string& dictionary) {
  std::vector<FoundMarker> markers;
#ifdef THICKLENS_HAS_ARUCO
  const int kind = model::DictionaryNumber(dictionary);
  if (kind < 0) return markers;
  cv::Mat bytes = Bytes(light);
  const double shrink = Shrunk(&bytes);
  const auto parameters = cv::aruco::DetectorParameters::create();
  // Modules of a few px need more samples each, and blurred marks several thresholds.
  parameters->perspectiveRemovePixelPerCell = 8;
  parameters->perspectiveRemoveIgnoredMarginPerCell = 0.25;
  parameters->adaptiveThreshWinSizeMax = 63;
  parameters->minMarkerPerimeterRate = 0.02;
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> numbers;
  cv::aruco::detectMarkers(bytes, cv::aruco::getPredefinedDictionary(kind), corners, numbers,
                           parameters);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    for (cv::Point2f& corner : corners[i]) corner = AtFullSize(corner, shrink);
    const double side_px = cv::norm(corners[i][1] - corners[i][0]);
    const int half = std::clamp(static_cast<int>(side_px / 16), 2, 10);
    cv::cornerSubPix(light, corners[i], {half, half}, {-1, -1}, Precisely());
    FoundMarker marker;
    marker.number = numbers[i];
    for (const cv::Point2f& corner : corners[i]) marker.corners_px.emplace_back(corner.x, corner.y);
    markers.push_back(marker);
  }
#else
  static_cast<void>(light);
  static_cast<void>(dictionary);
#endif
  return markers;
}

std::optional<GridView> DetectGrid(const cv::Mat& light, const model::TargetGrid& grid) {
  switch (grid.pattern) {
    case model::GridPattern::kCharuco:
      return DetectCharuco(light, grid);
    case model::GridPattern::kCircles:
      return DetectCircles(light, grid);
    case model::GridPattern::kChequerboard:
      break;
  }
  return DetectChequerboard(light, grid);
}

}  // namespace thicklens::calib
